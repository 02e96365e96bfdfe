// SPDX-License-Identifier: Apache-2.0
// What tapes of rollouts and episodes record, and the derivatives that enter on the way back.
#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "engine/base/precision.hpp"
#include "engine/step/stepper.hpp"

namespace tangere {

/// Fills the controls (nu) of one environment's step. Several threads call it, possibly more than
/// once for a step.
using StepControls = std::function<void(std::int64_t step, int environment, std::span<double> u)>;

struct TapeOptions {
  /// Steps of a scene's rollout; actions of a task's episode at most, 0: the task's horizon.
  std::int64_t length = 0;
  int threads = 1;
  /// Steps are solved to kGradientTolerance where neither these nor the scene name a tolerance.
  StepperOptions stepper;
  Precision precision = Precision::f64;  ///< of tactile fields; derivatives are in double
  /// Also by the scene's numbers (engine/derivative/number_gradients.hpp).
  bool parameters = false;
  /// Also by tactile points' own numbers (engine/derivative/tactile_point_numbers.hpp); only losses
  /// of a scene have these derivatives.
  bool points = false;
  /// Limit for the states on tapes [bytes]: of each thread, or of a TaskTape. What is longer is run
  /// again from checkpoints, with the same bits.
  double tape_bytes = 1e9;
};

/// Derivatives of a loss by what an action leads to; empty spans mean zeros.
struct ActionCotangents {
  std::span<const double> observation = {};  ///< (E, observation)
  std::span<const double> reward = {};       ///< (E)
  std::span<const double> q = {}, v = {};    ///< (E, nv) by the state after it, q along the dofs
};

}  // namespace tangere
