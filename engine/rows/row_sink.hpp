// SPDX-License-Identifier: Apache-2.0
// What a rollout hands to whoever stores it. The only place where tasks/ (which produces) and io/
// (which stores) meet.
#pragma once

#include <cstdint>
#include <span>

namespace tangere {

/// Row t of a trajectory, all environments: the state before step t (row 0: the start).
struct StateRow {
  std::int64_t step;          ///< t
  double time;                ///< t h [s]
  std::span<const double> q;  ///< (E, nq)
  std::span<const double> v;  ///< (E, nv)
  std::span<const double>
      body_pose;  ///< (E, nb, 7) x y z qw qx qy qz of each body frame in the world
  std::span<const double>
      body_twist;  ///< (E, nb, 6) angular, then linear velocity of its origin, world axes
  std::span<const double> end_effectors =
      {};  ///< (E, n, 3) world positions of the end effectors [m]; empty if n = 0
};

/// What step t (from row t to row t + 1) used and how its solve went.
struct StepRow {
  std::int64_t step;                         ///< t
  std::span<const double> u;                 ///< (E, nu) controls as given, before clipping
  std::span<const std::int32_t> iterations;  ///< (E) Newton passes, sub-steps included
  std::span<const std::int8_t> status;       ///< (E) StepStatus
  std::span<const double> residual;          ///< (E) scaled residual at acceptance, dimensionless
};

/// A tactile field of one sensor, all environments.
struct TactileRow {
  int sensor;                     ///< index into Model::sensors()
  std::int64_t frame;             ///< 0, 1, 2 …
  std::int64_t step;              ///< the row of q it was read from
  std::span<const double> force;  ///< (E, points, 3) [N]: f·axis0, f·axis1, -f·(axis0 × axis1)
};

/// What action j of a task was and came to, all environments. Those whose episode is over take
/// none: their rows hold 0.
struct ActionRow {
  std::int64_t action;             ///< j
  std::int64_t step;               ///< row of q after it
  std::span<const double> u;       ///< (E, width) as the task took it
  std::span<const double> reward;  ///< (E)
  std::span<const std::uint8_t> terminated, truncated,
      success;  ///< (E) of the episode, from its last action on
};

/// Receives rows in ascending order. A sink that cannot store throws IoError; the rollout stops and
/// passes it on.
class RowSink {
 public:
  virtual ~RowSink() = default;
  virtual void write(const StateRow& row) = 0;
  virtual void write(const StepRow& row) = 0;
  virtual void write(const TactileRow& row) = 0;
  virtual void write(const ActionRow&) {}  ///< of a task only
};

}  // namespace tangere
