// SPDX-License-Identifier: Apache-2.0
// Lays a data set out for Minari with links and virtual datasets; no number is stored twice.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/dataset/demo_links.hpp"
#include "io/dataset/grown_file.hpp"

namespace tangere {

/// The view at FOLDER/minari/ID/data, where ID is `dataset_id` of /scene. Everything throws
/// IoError.
class MinariView {
 public:
  /// Begins the view and replaces an existing one. `shard` is any object in one of the folder's
  /// shards.
  MinariView(const std::string& folder, const h5::Id& shard, const DemoMembers& members);

  /// Adds demos of a file in ascending order. `file` is a name in the data set's folder, without
  /// path.
  void add(std::string_view file, std::span<const LinkedDemo> demos);
  /// Writes what is left, and metadata.json. `linked`: size of the files with the numbers [bytes].
  void commit(std::uint64_t linked);
  /// Observations of more than 2^18 numbers, which the view does not have.
  [[nodiscard]] const std::vector<std::string>& left_out() const { return left_out_; }
  /// "tangere/NAME-v0", "tangere/TASK/NAME-v0".
  [[nodiscard]] const std::string& id() const { return id_; }

 private:
  void hide_states();
  [[nodiscard]] std::string metadata(std::uint64_t bytes) const;

  DemoMembers members_;  // without those
  std::vector<std::string> left_out_;
  std::string id_, folder_, to_folder_;  // the last: the way back from the view
  std::string command_, version_;
  std::string task_, python_class_, policy_;  // empty for a scene alone
  std::vector<std::string> readings_;         // of sensors, beside what the task observes
  std::string low_ = "-1.0", high_ = "1.0";
  std::optional<GrownFile> file_;
  std::vector<h5::FileMember> episodes_;
  std::int64_t count_ = 0, steps_ = 0;
  std::uint64_t seed_ = 0;
};

}  // namespace tangere
