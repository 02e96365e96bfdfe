// SPDX-License-Identifier: Apache-2.0
// The datasets of a demo in the order of the file, and the bytes that describe them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/rows/episode_sink.hpp"
#include "io/dataset/chunk_codec.hpp"
#include "io/dataset/dataset_layout.hpp"
#include "io/hdf5/h5_objects.hpp"

namespace tangere {

/// Attributes of a demo's group.
struct DemoFacts {
  std::int64_t rows = 0;                 ///< R
  std::optional<EpisodeEnd> end;         ///< of a task
  std::vector<double> randomized;        ///< as many as the layout has names
  std::vector<double> gains;             ///< of R, G, B of the layout's gained pictures
  std::optional<std::int64_t> touching;  ///< rows of obs with contact; none: not stored
};

/// The same facts as attributes of the group. all() refers to the given facts and to this object.
class DemoAttributes {
 public:
  explicit DemoAttributes(const DemoFacts& facts);
  DemoAttributes(const DemoAttributes&) = delete;
  DemoAttributes& operator=(const DemoAttributes&) = delete;
  [[nodiscard]] std::span<const h5::FileAttribute> all() const { return all_; }

 private:
  std::array<unsigned char, 8> samples_, total_, policy_, touching_;
  std::array<unsigned char, 1> terminated_, success_;
  std::vector<h5::FileAttribute> all_;
};

/// Datasets of a demo: actions, rewards, dones, obs/<name> …, final_obs/<name> …, then derivatives
/// in the order of their names, then samples/<name> ….
class DemoFormat {
 public:
  static constexpr std::size_t kActions = 0, kRewards = 1, kDones = 2, kFirst = 3;

  explicit DemoFormat(const DatasetLayout& layout);

  [[nodiscard]] std::size_t datasets() const { return sample(samples_.size()); }
  [[nodiscard]] std::size_t observations() const { return names_.size(); }
  [[nodiscard]] std::size_t obs(std::size_t name) const { return kFirst + name; }
  [[nodiscard]] std::size_t final_obs(std::size_t name) const {
    return kFirst + names_.size() + name;
  }
  [[nodiscard]] std::size_t gradients() const { return gradients_.size(); }
  [[nodiscard]] std::size_t gradient(std::size_t k) const { return kFirst + 2 * names_.size() + k; }
  [[nodiscard]] const std::vector<DatasetSample>& samples() const { return samples_; }
  [[nodiscard]] std::size_t sample(std::size_t k) const { return gradient(gradients_.size()) + k; }
  /// "obs/pad of demo_": its number follows.
  [[nodiscard]] const std::string& title(std::size_t dataset) const { return titles_[dataset]; }
  [[nodiscard]] std::size_t row_bytes(std::size_t dataset) const { return row_bytes_[dataset]; }
  /// Bytes of a number of a dataset.
  [[nodiscard]] std::size_t number_bytes(std::size_t dataset) const {
    return h5::bytes_of(types_[dataset]);
  }
  [[nodiscard]] std::size_t rank(std::size_t dataset) const { return shapes_[dataset].size() + 1; }
  /// Rows of a dataset in a demo of `rows`.
  [[nodiscard]] std::int64_t rows_of(std::size_t dataset, std::int64_t rows) const;
  /// Rows of a chunk in a demo of `rows`; 0: contiguous.
  [[nodiscard]] std::int64_t chunk_rows(std::size_t dataset, std::int64_t rows) const;
  /// Whether observations are float32, else float64.
  [[nodiscard]] bool single() const { return single_; }
  /// Whether its rows are JPEG files, whose sizes are known once they are made.
  [[nodiscard]] bool as_jpeg(std::size_t dataset) const {
    return types_[dataset] == h5::NumberType::text;
  }
  /// How an observation is cut into chunks.
  [[nodiscard]] const ChunkPlan& plan(std::size_t dataset) const {
    if (dataset >= sample(0)) return plans_[names_.size() + dataset - sample(0)];
    return plans_[(dataset - kFirst) % names_.size()];
  }
  /// The observations that are touch, ascending.
  [[nodiscard]] const std::vector<std::size_t>& touch() const { return touch_; }
  /// Whether a dataset has the rows of such an observation below obs.
  [[nodiscard]] bool is_touch(std::size_t dataset) const {
    return std::any_of(touch_.begin(), touch_.end(),
                       [&](std::size_t name) { return obs(name) == dataset; });
  }
  /// Index of an observation in pieces of episodes.
  [[nodiscard]] std::size_t source(std::size_t name) const { return sources_[name]; }
  [[nodiscard]] std::size_t source_of_gradient(std::size_t k) const { return gradient_sources_[k]; }
  /// The shape of one row.
  [[nodiscard]] const std::vector<std::uint64_t>& shape(std::size_t dataset) const {
    return shapes_[dataset];
  }
  /// Bytes of the contiguous datasets of a demo, each rounded up to a multiple of eight, without
  /// those of JPEG files.
  [[nodiscard]] std::size_t data_bytes(std::int64_t rows) const;
  /// Bytes of a demo's description, equal for all demos.
  [[nodiscard]] std::size_t header_bytes() const { return header_bytes_; }

  /// Texts that descriptions of demos refer to, stored once per file; empty without derivatives.
  [[nodiscard]] h5::Bytes texts() const;

  /// Appends the description of a demo to bytes that begin at `base` in the file. Returns the
  /// address of its group. `addresses` has, for each dataset, the address of its numbers or of the
  /// index of its chunks. `widths` has the bytes of a row of JPEG files. `texts` is the address of
  /// texts().
  std::uint64_t describe(h5::Bytes& out, std::uint64_t base, const DemoFacts& facts,
                         std::span<const std::uint64_t> addresses,
                         std::span<const std::uint32_t> widths, std::uint64_t texts) const;

 private:
  std::uint64_t describe_observations(h5::Bytes& out, std::uint64_t base, std::int64_t rows,
                                      std::size_t first, std::span<const std::string> names,
                                      std::span<const std::uint64_t> addresses,
                                      std::span<const std::uint32_t> widths) const;
  void describe_dataset(h5::Bytes& out, std::size_t dataset, std::int64_t rows,
                        std::uint64_t address, std::uint32_t width = 1,
                        std::span<const h5::FileText> texts = {}) const;

  bool is_task_, single_;
  std::size_t randomized_, gains_;
  std::vector<std::string> names_, titles_;  // of observations; of datasets
  std::vector<std::size_t> touch_, sources_, gradient_sources_;
  std::vector<GradientArray> gradients_;  // by name
  std::vector<DatasetSample> samples_;
  std::vector<ChunkPlan> plans_;                    // per observation, then per sample
  std::vector<std::vector<std::uint64_t>> shapes_;  // of a row, per dataset
  std::vector<h5::NumberType> types_;
  std::vector<std::size_t> row_bytes_;
  std::string compression_;
  std::size_t header_bytes_ = 0;
};

}  // namespace tangere
