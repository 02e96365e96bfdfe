// SPDX-License-Identifier: Apache-2.0
// Options of tapes of rollouts and episodes, input cotangents of the reverse pass, and gradients.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "engine/base/precision.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/step_counts.hpp"

namespace tangere {

struct TaskView;

/// Fills the controls (nu) of one environment's step. Several threads call it, possibly more than
/// once for a step.
using StepControls = std::function<void(std::int64_t step, int environment, std::span<double> u)>;
/// Fills the action of an episode from `view` and `observation`. Several threads call it.
using TaskActions = std::function<void(const TaskView& view, std::span<const double> observation,
                                       std::span<double> action)>;

struct TapeOptions {
  /// Steps of a scene's rollout; actions of a task's episode at most, 0: the task's horizon.
  std::int64_t length = 0;
  int threads = 1;
  /// Steps are solved to kGradientTolerance where neither these nor the scene name a tolerance.
  StepperOptions stepper;
  Precision precision = Precision::f64;  ///< of tactile fields; derivatives are in double
  /// Also by the scene's numbers (engine/derivative/number_gradients.hpp).
  bool parameters = false;
  /// Also by tactile points' own numbers (engine/derivative/tactile_point_numbers.hpp); gradients
  /// of returns leave these out.
  bool points = false;
  /// Limit for the states on tapes [bytes]: of each thread, or of a TaskTape. Longer rollouts are
  /// recomputed from checkpoints, with the same bits.
  double tape_bytes = 1e9;
};

/// Cotangents of the results of an action; empty spans mean zeros.
struct ActionCotangents {
  std::span<const double> observation = {};  ///< (E, observation)
  std::span<const double> reward = {};       ///< (E)
  std::span<const double> q = {}, v = {};    ///< (E, nv) by the state after it, q along the dofs
};

/// Results of a reverse pass by the start of episodes; empty spans are skipped.
struct StartCotangents {
  std::span<double> q, v;              ///< (E, nv) by the states at the first action, q along dofs
  std::span<double> parameters = {};   ///< (E, NumberGradients::count())
  std::span<double> points = {};       ///< (E, tactile_points(), kPointNumbers)
  std::span<double> shear_state = {};  ///< (E, points, 3), by entries that the start has
};

/// Gradient of one loss or of the return, for every environment or episode. An environment that
/// fails contributes its states until then and stands still afterwards.
struct LossGradient {
  std::vector<double> value;       ///< (E)
  std::vector<double> u;           ///< (E, steps, nu) by controls; of a task (E, A, action)
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

/// The value is the sum of rewards until the end. A derivative by a component of an action beyond
/// its bounds is 0. The initial state is that at the first action: the reset (settling, warm-up)
/// and all random draws count as constant.
struct TaskGradients : GradientCounts, LossGradient {
  std::vector<std::int64_t> length;  ///< (E) actions until the end
  std::vector<double> action;        ///< (E, A, action) as chosen; zeros after the end
};

}  // namespace tangere
