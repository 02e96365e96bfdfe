// SPDX-License-Identifier: Apache-2.0
// What gradients of rollouts are asked for, and what they come to.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/base/precision.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

/// Is called before every step. False stops the computation before that step.
using GradientGoOn = std::function<bool()>;
/// Fills the controls (nu) of one environment's step. Several threads call it, possibly more than
/// once for a step.
using StepControls = std::function<void(std::int64_t step, int environment, std::span<double> u)>;

struct GradientOptions {
  std::int64_t steps = 0;
  int threads = 1;
  StepperOptions stepper;
  Precision precision =
      Precision::f64;  ///< of the tactile fields that losses see; derivatives are in double
  bool parameters =
      false;  ///< also by the scene's numbers (engine/derivative/number_gradients.hpp)
  bool points =
      false;  ///< also by tactile points' own numbers (engine/derivative/tactile_point_numbers.hpp)
  /// Limit for the states on a thread's tape [bytes]. A longer rollout is run again from
  /// checkpoints, with the same bits.
  double tape_bytes = 1e9;
};

/// Gradient of one loss, for every environment. An environment that fails contributes its states
/// until then and stands still afterwards.
struct LossGradient {
  std::vector<double> value;       ///< (E)
  std::vector<double> u;           ///< (E, steps, nu)
  std::vector<double> q, v;        ///< (E, nv) by the initial state; q along the dofs of v
  std::vector<double> parameters;  ///< (E, NumberGradients::count()) or empty
  std::vector<double> points;      ///< (E, tactile_points(model), kPointNumbers) or empty
};

/// How the rollouts or episodes went.
struct GradientCounts {
  /// In the order of environments. For a task: in the order of its episodes; steps count actions,
  /// and -1 is the reset.
  std::vector<FailedEnvironment> failures;
  std::int64_t newton_iterations = 0;
  std::int64_t recomputed_steps = 0;  ///< from checkpoints, counted by block
  bool stopped = false;               ///< before the end: gradients are incomplete
};

struct GradientSummary : GradientCounts {
  std::vector<LossGradient> losses;
};

}  // namespace tangere
