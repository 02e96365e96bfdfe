// SPDX-License-Identifier: Apache-2.0
// What `simulate` writes: one HDF5 file with the trajectory of a batch (schema in docs/files.md).
#pragma once

#include <memory>
#include <string>

#include "engine/rows/channel.hpp"

namespace tangere {

/// Writes `<output>.part` and gives it its name on commit(). Destroyed before that, it leaves
/// nothing behind.
class TrajectoryFile : public RowSink {
 public:
  /// Creates every group, dataset and attribute. Throws IoError when the output exists (and
  /// `overwrite` is false), its folder is missing or not writable, or the disk has no room for the
  /// uncompressed channels; InputError for sizes no file can hold and for two channels of a name.
  TrajectoryFile(const std::string& output, const Recording& recording, bool overwrite);
  ~TrajectoryFile() override;

  void write(std::int64_t step, std::size_t channel, const Numbers& numbers) override;
  /// Adds groups and tables that are known when the run is over.
  void add(const Recording& recording);

  /// Checks that every row came, closes, syncs and renames. Throws IoError.
  void commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Size of a recording without compression [bytes]: of all of it, or of its uncompressed channels
/// alone. Throws InputError when it exceeds 2^63.
std::uint64_t recorded_bytes(const Recording& recording, bool with_compressed = true);

}  // namespace tangere
