// SPDX-License-Identifier: Apache-2.0
// What a batch is measured by, in reverse: cotangents of tactile fields and end effectors to those
// of the state.
#pragma once

#include <memory>
#include <span>

#include "engine/derivative/adjoint.hpp"
#include "engine/sense/tactile_frame.hpp"

namespace tangere {

/// Owns the scratch of one thread; allocates when made, and for more tiles at once than ever
/// before. For each state: place(), then for each loss clear(), any number of fields and end
/// effectors, and finish(). Fields are computed anew in double; nothing is kept of how they were
/// read.
class ReadoutPullback {
 public:
  explicit ReadoutPullback(const Model& model);
  ~ReadoutPullback();
  ReadoutPullback(ReadoutPullback&&) noexcept;
  ReadoutPullback& operator=(ReadoutPullback&&) noexcept;

  /// Poses and twists of the environments of a block in their present state.
  void place(const Batch& batch, int block);
  void clear();
  /// Of the field of a sensor in lane `lane` of the block, as `tiles` of 8 × 8 points
  /// (CompactFrame::tiles) with `cotangents` (tiles, 3, 8, 8). Points outside the tiles, or where
  /// nothing touches, have no derivative. `parameters`: (parameter_rows, 16) of the loss to add
  /// those by the sensor's coefficients and the sizes of what touches it to, or empty. `points`:
  /// (points, kPointNumbers) of the sensor to add those by every point's own numbers to
  /// (engine/derivative/tactile_point_numbers.hpp), or empty.
  void field(int lane, int sensor, std::span<const int> tiles, std::span<const double> cotangents,
             std::span<double> parameters = {}, std::span<double> points = {});
  /// The same with `cotangents` of the whole field, (points, 3).
  void dense_field(int lane, int sensor, std::span<const double> cotangents,
                   std::span<double> parameters = {}, std::span<double> points = {});
  /// Of the world position of an end effector, (3).
  void end_effector(int lane, int end_effector, std::span<const double> cotangent);
  /// Adds what was collected to q and v of `out`, all lanes.
  void finish(BlockCotangent& out);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
