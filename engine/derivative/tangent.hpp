// SPDX-License-Identifier: Apache-2.0
// Forward derivatives of taped steps along one direction, by dual numbers in the kernels' own
// templates. They are the second route by which gradients are checked. One environment at a time, a
// hundred times slower than a step.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/step/stepper.hpp"
#include "engine/step/tape.hpp"

namespace tangere {

/// How a state changes along a direction, (nv) each. Positions are along the dofs of v.
struct StateTangent {
  std::vector<double> q, v;
  std::vector<double> previous_q, previous_v;  ///< of the state one step before
  /// Of the shear state, three numbers for each of its entries. Empty: zeros.
  std::vector<double> shear = {};
  /// Of earlier states, newest first: q, then v. Tangent::step() keeps them for sensors with lag.
  std::vector<std::vector<double>> past = {};
};

class Tangent {
 public:
  explicit Tangent(const Model& model, const StepperOptions& options = {});
  ~Tangent();

  /// Advances the tangent of the state after `step` steps by one step, as environment `lane` of the
  /// block took it. `u`, `u_dot`: (nu) its controls and how they change. `numbers_dot`: how the
  /// scene's numbers change, as rows of BlockCotangent::parameters, or empty. `points_dot`: how
  /// every sensor's points change, (points, kPointNumbers)
  /// (engine/derivative/tactile_point_numbers.hpp), or empty: the shear state depends on them.
  void step(const Batch& batch, int block, int lane, const BlockTape& tape, std::int64_t step,
            std::span<const double> u, std::span<const double> u_dot,
            std::span<const double> numbers_dot, StateTangent& state,
            std::span<const std::vector<double>> points_dot = {});

  /// Computes how a sensor's reading, (points, 3), changes with a state of the tape, with the
  /// scene's numbers and with every point's own numbers. `points_dot`: (points, kPointNumbers), or
  /// empty. For a sensor with lag, `batch` must hold the state and the earlier ones
  /// (BlockTape::show).
  void field(const Batch& batch, int block, int lane, const BlockTape& tape, std::int64_t step,
             int sensor, std::span<const double> numbers_dot, std::span<const double> points_dot,
             const StateTangent& state, std::span<double> field_dot);

  /// Computes how the places of the end effectors, (end effectors, 3), change with a state of the
  /// tape and with the scene's numbers.
  void end_effectors(const Batch& batch, int block, int lane, const BlockTape& tape,
                     std::int64_t step, std::span<const double> numbers_dot,
                     const StateTangent& state, std::span<double> change);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
