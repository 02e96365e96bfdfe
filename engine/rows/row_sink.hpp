// SPDX-License-Identifier: Apache-2.0
// The interface between a rollout and whoever stores it. Only here do tasks/ (which produces) and
// io/ (which stores) meet.
#pragma once

#include <cstdint>
#include <span>

#include "engine/scene/field_form.hpp"
#include "engine/step/shear_state.hpp"
#include "engine/step/sleep_state.hpp"

namespace tangere {

/// Row t of a trajectory, for all environments: the state before step t (row 0: the start).
struct StateRow {
  std::int64_t step;          ///< t
  double time;                ///< t h [s]
  std::span<const double> q;  ///< (E, nq); empty if not requested at this row
  std::span<const double> v;  ///< (E, nv); as q
  /// (E, nb, 7) x y z qw qx qy qz of all body frames in the world, or of the requested ones; empty
  /// if none is requested at this row.
  std::span<const double> body_pose;
  /// (E, nb, 6) angular, then linear velocity of its origin, world axes; as the poses.
  std::span<const double> body_twist;
  /// (E, n, 3) world positions of the end effectors [m]; empty if n = 0 or not requested.
  std::span<const double> end_effectors = {};
};

/// What step t (from row t to row t + 1) used, and how its solve went.
struct StepRow {
  std::int64_t step;  ///< t
  std::span<const double>
      u;  ///< (E, nu) controls as given, before clipping; empty if not requested
  std::span<const std::int32_t> iterations;  ///< (E) Newton passes, sub-steps included
  std::span<const std::int8_t> status;       ///< (E) StepStatus
  std::span<const double> residual;          ///< (E) scaled residual at acceptance, dimensionless
};

/// A reading of one sensor in one form, for all environments.
struct TactileRow {
  FieldOutput output;               ///< sensor: index into Model::sensors()
  std::int64_t frame;               ///< 0, 1, 2 …
  std::int64_t step;                ///< row of q that it was read from
  std::span<const double> numbers;  ///< (E, numbers_of(points, form))
};

/// Action j of a task and its result, for all environments. Environments whose episode is over take
/// no action: their rows hold 0.
struct ActionRow {
  std::int64_t action;             ///< j
  std::int64_t step;               ///< row of q after the action
  std::span<const double> u;       ///< (E, width) as the task received it
  std::span<const double> reward;  ///< (E)
  /// (E) whether the episode has succeeded; set from its last action on.
  std::span<const std::uint8_t> terminated, truncated, success;
};

/// Energy balance at row t of a trajectory, for all environments (engine/sense/energy_balance.hpp).
struct AuditRow {
  std::int64_t step;                 ///< t
  std::span<const double> energy;    ///< (E, 3) of motion, of height, held [J]
  std::span<const double> momentum;  ///< (E, 6) linear [kg m/s], angular [kg m²/s]
  /// (E, 3) work of motors, dissipation by damping and friction, and error of the integrator in the
  /// step before this row [J]; empty at row 0. Zeros if an environment took no step.
  std::span<const double> passed;
};

/// Shear state at row t of a trajectory, for all environments.
struct MemoryRow {
  std::int64_t step;                   ///< t
  std::span<const ShearState> memory;  ///< (E)
};

/// Which bodies sleep at row t of a trajectory, for all environments. It follows the StateRow.
struct SleepRow {
  std::int64_t step;                  ///< t
  std::span<const SleepState> sleep;  ///< (E)
};

/// Receives rows in ascending order. A sink that cannot store throws IoError; the rollout stops and
/// passes it on.
class RowSink {
 public:
  virtual ~RowSink() = default;
  virtual void write(const StateRow& row) = 0;
  virtual void write(const StepRow& row) = 0;
  virtual void write(const TactileRow& row) = 0;
  virtual void write(const ActionRow&) {}  ///< tasks only
  virtual void write(const AuditRow&) {}   ///< only if requested
  virtual void write(const MemoryRow&) {}  ///< only if requested
  virtual void write(const SleepRow&) {}   ///< only with q and v
};

}  // namespace tangere
