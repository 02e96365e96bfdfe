// SPDX-License-Identifier: Apache-2.0
// The checksum `label_sum` of what readers use of episodes beside their rows: attributes of demos
// and of failed episodes, and the counts of steps. It does not depend on the order of episodes, so
// that of a merged file is the sum of those of its shards.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "engine/rows/episode_sink.hpp"
#include "io/dataset/content_sum.hpp"
#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_objects.hpp"

namespace tangere {

/// Attributes of other names count nothing, so a user may add some.
class LabelSum {
 public:
  /// Adds the attributes of a demo as they are laid out. Throws std::logic_error for an attribute
  /// that LabelSum does not list.
  void add_demo(std::int64_t episode, std::span<const h5::FileAttribute> attributes);
  /// Adds those of an open /data/demo_<episode>. Throws IoError for one that cannot be read.
  void add_demo(std::int64_t episode, const h5::Id& demo);
  /// Adds those of an open /failed/episode_<episode>. Throws IoError for one that cannot be read.
  void add_failed(std::int64_t episode, const h5::Id& failed);
  void add(const EpisodeSteps& steps);
  [[nodiscard]] std::uint64_t value() const { return sum_.value() + steps_; }

 private:
  ContentSum sum_;
  std::uint64_t steps_ = 0;
};

/// Attribute of a mask that `merge` writes.
inline constexpr const char* kMaskSum = "name_sum";
/// The checksum that it has: of the names in the mask, in their order.
std::uint64_t sum_of_names(std::span<const std::string> names);
/// Throws IoError if an open mask has that attribute and other names. One that a user has put there
/// has none.
void check_mask(const h5::Id& mask, const std::string& name);

}  // namespace tangere
