// SPDX-License-Identifier: Apache-2.0
// The readings of a batch in reverse: turns cotangents of tactile fields, end effectors and bodies
// into those of the state.
#pragma once

#include <memory>
#include <span>

#include "engine/derivative/adjoint.hpp"
#include "engine/sense/tactile_frame.hpp"

namespace tangere {

/// Throws InputError (file:line) if one of these sensors has lag: its reading depends on earlier
/// states (SensorInfo::past_states).
void check_has_no_lag(const Model& model, std::span<const FieldOutput> outputs);

/// Owns the scratch of one thread. Allocates in the constructor, and whenever a call has more tiles
/// than any before. For each state call place(); then for each loss clear(), any number of fields
/// and end effectors, and finish(). Fields are recomputed in double, independent of the precision
/// in which they were read. What sensors with lag read of earlier states goes to
/// BlockCotangent::past: the batch must hold these states (BlockTape::show).
class ReadoutPullback {
 public:
  explicit ReadoutPullback(const Model& model);
  ~ReadoutPullback();
  ReadoutPullback(ReadoutPullback&&) noexcept;
  ReadoutPullback& operator=(ReadoutPullback&&) noexcept;

  /// Computes poses and twists of the environments of a block in their present state.
  void place(const Batch& batch, int block);
  void clear();
  /// Takes the cotangents of a sensor's field in lane `lane` of the block: `tiles` of 8 × 8 points
  /// (CompactFrame::tiles) with `cotangents` (tiles, 3, 8, 8). Points outside the tiles, or where
  /// nothing touches, have no derivative. `parameters`: (parameter_rows, 16) of the loss, to which
  /// derivatives by the sensor's coefficients and the sizes of what touches it are added, or empty;
  /// finish() adds those by places of joints to BlockCotangent::parameters.
  /// `points`: (points, kPointNumbers) of the sensor, to which derivatives by every point's own
  /// numbers are added (engine/derivative/tactile_point_numbers.hpp), or empty.
  void field(int lane, int sensor, std::span<const int> tiles, std::span<const double> cotangents,
             std::span<double> parameters = {}, std::span<double> points = {});
  /// The same for `cotangents` of the whole field, (points, 3).
  void dense_field(int lane, int sensor, std::span<const double> cotangents,
                   std::span<double> parameters = {}, std::span<double> points = {});
  /// The same for `cotangents` of the pressure, (points): the force without friction.
  void pressure(int lane, int sensor, std::span<const double> cotangents,
                std::span<double> parameters = {}, std::span<double> points = {});
  /// The same for `cotangents` of the field without the sensor's imperfections, (points, 3).
  void ideal_field(int lane, int sensor, std::span<const double> cotangents,
                   std::span<double> parameters = {}, std::span<double> points = {});
  /// The same for `cotangents` of a picture of a sensor without a layer, before it is rounded:
  /// numbers_of(sensor, form). The motion of printed markers has no derivative.
  void picture(int lane, FieldOutput output, std::span<const double> cotangents,
               std::span<double> parameters = {});
  /// Takes the cotangent of an end effector's world position, (3).
  void end_effector(int lane, int end_effector, std::span<const double> cotangent);
  /// Takes the cotangents of a body's pose (7) and twist (6), as Readout::bodies() returns them.
  /// The part of a quaternion's cotangent along the quaternion has no effect.
  void body(int lane, int body, std::span<const double> pose, std::span<const double> twist);
  /// Adds the collected cotangents to q and v of `out`, in all lanes.
  void finish(BlockCotangent& out);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
