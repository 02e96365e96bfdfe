// SPDX-License-Identifier: Apache-2.0
// Makes demos of shards members of another file, with links and virtual datasets as bytes, for
// robomimic and for Minari.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/dataset/demo_format.hpp"
#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_trees.hpp"

namespace tangere {

/// A dataset of any demo.
struct DemoArray {
  std::string name;
  h5::NumberType type = h5::NumberType::float32;
  std::vector<std::uint64_t> shape;  ///< of a row
};

/// What all demos of a data set have in common.
struct DemoMembers {
  std::vector<std::string> names;       ///< of its links
  std::vector<DemoArray> observations;  ///< below obs
  /// Second names of observations whose own has a dot, by index: robomimic builds no network for a
  /// name with a dot.
  std::vector<std::pair<std::size_t, std::string>> plain_names;
  std::vector<DemoArray> states;  ///< of these, what Minari gets below infos instead
  std::vector<std::pair<DemoArray, std::uint64_t>> samples;  ///< below samples, with their rows
  DemoArray actions;
  std::vector<std::string> besides;  ///< grad_…, the loss and samples, among `names`
  bool is_task = false, varies = false, has_touch = false;  ///< has_touch: touch is stored
  bool has_gains = false;                                   ///< of pictures
  std::int64_t policies = 0;                                ///< that played, for a task
};

/// Reads the members of a demo. Throws IoError.
DemoMembers members_of(const h5::Id& demo);
/// Reads the facts of a demo. Throws IoError.
DemoFacts facts_of(const h5::Id& demo, const DemoMembers& members);
/// Opens every member, but does not read its numbers. Throws IoError if one is missing, damaged, or
/// of another shape or type.
void check_members(const h5::Id& demo, const DemoMembers& members, const DemoFacts& facts);

struct LinkedDemo {
  std::int64_t number = 0;
  DemoFacts facts;
};

/// Appends groups demo_<i> to bytes that begin at `base`: attributes and members of the demos of
/// `file`, and next_obs, whose row j is row j + 1 of obs and whose last row is final_obs.
/// Observations have their plain names besides. `file` is
/// relative to the folder of the file being written. Returns the groups.
std::vector<h5::FileMember> add_demo_links(h5::Bytes& out, std::uint64_t base,
                                           const DemoMembers& members, std::string_view file,
                                           std::span<const LinkedDemo> demos);

/// Does the same with groups episode_<j>, j from `first`, in Minari's layout, with `states` and
/// derivatives below infos. `seed`: seed of the data set.
std::vector<h5::FileMember> add_minari_episodes(h5::Bytes& out, std::uint64_t base,
                                                const DemoMembers& members, std::string_view file,
                                                std::span<const LinkedDemo> demos,
                                                std::int64_t first, std::uint64_t seed);

}  // namespace tangere
