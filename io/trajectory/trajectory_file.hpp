// SPDX-License-Identifier: Apache-2.0
// What `simulate` writes: one HDF5 file with the trajectory of a batch (schema in docs/files.md).
#pragma once

#include <memory>
#include <string>

#include "engine/rows/row_sink.hpp"
#include "io/trajectory/trajectory_layout.hpp"

namespace tangere {

/// Derivatives of a loss over the whole run, for every environment.
struct GradientArrays {
  std::string loss, meaning;
  std::span<const double> value;                            ///< (E)
  std::span<const double> u;                                ///< (E, T, nu)
  std::span<const double> q, v;                             ///< (E, nv) by the initial state
  std::span<const double> numbers;                          ///< (E, k) by the scene's numbers
  std::span<const std::string> number_names, number_units;  ///< (k)
  std::span<const double> points;  ///< (E, all tactile points, kPointNumbers) by their own numbers
                                   ///< (engine/derivative/tactile_point_numbers.hpp); or empty
};

/// Writes `<output>.part` and gives it its name on commit(). Destroyed before that, it leaves
/// nothing behind.
class TrajectoryFile : public RowSink {
 public:
  /// Creates every group, dataset and attribute. Throws IoError when the output exists (and
  /// `overwrite` is false), its folder is missing or not writable, or the disk has no room for the
  /// uncompressed small datasets; InputError for sizes no file can hold.
  TrajectoryFile(const std::string& output, const TrajectoryLayout& layout, bool overwrite);
  ~TrajectoryFile() override;

  void write(const StateRow& row) override;
  void write(const StepRow& row) override;
  void write(const TactileRow& row) override;
  void write(const ActionRow& row) override;
  void write(const AuditRow& row) override;
  void write(const MemoryRow& row) override;
  void write(const SleepRow& row) override;
  /// Called at most once. Sizes are those of the layout.
  void write(const GradientArrays& gradients);

  /// Checks that every row came, closes, syncs and renames. Throws IoError.
  void commit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
