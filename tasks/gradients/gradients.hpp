// SPDX-License-Identifier: Apache-2.0
// Rollouts of a batch and the gradients of losses over them: forward, then back, block by block on
// all threads.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/precision.hpp"
#include "engine/derivative/loss.hpp"
#include "engine/step/batch.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

/// Asked before every step; false stops at this safe point.
using GradientGoOn = std::function<bool()>;
/// Fills the controls (nu) of one environment's step. Called from several threads, more than once
/// for a step.
using StepControls = std::function<void(std::int64_t step, int environment, std::span<double> u)>;

struct GradientOptions {
  std::int64_t steps = 0;
  int threads = 1;
  StepperOptions stepper;
  Precision precision =
      Precision::f64;  ///< of the tactile fields that losses see; derivatives are taken in double
  bool parameters = false;  ///< by the scene's numbers too (engine/derivative/number_gradients.hpp)
  bool points =
      false;  ///< by every tactile point's own numbers too (engine/derivative/tactile_point_numbers.hpp)
  /// The states on a thread's tape may take so much [bytes]; a longer rollout is run again from
  /// checkpoints, with the same bits.
  double tape_bytes = 1e9;
};

/// Of one loss, for every environment. Of one that failed: of its states until then, standing still
/// afterwards.
struct LossGradient {
  std::vector<double> value;       ///< (E)
  std::vector<double> u;           ///< (E, steps, nu)
  std::vector<double> q, v;        ///< (E, nv) by the initial state; q along the dofs of v
  std::vector<double> parameters;  ///< (E, NumberGradients::count()) or empty
  std::vector<double> points;      ///< (E, tactile_points(model), kPointNumbers) or empty
};

/// How the rollouts or episodes of gradients went.
struct GradientCounts {
  /// In the order of environments. Of a task: those of its episodes in their order, steps are
  /// actions, -1 the reset.
  std::vector<FailedEnvironment> failures;
  std::int64_t newton_iterations = 0;
  std::int64_t recomputed_steps = 0;  ///< of blocks, from checkpoints
  bool stopped = false;               ///< on the way: gradients are not complete
};

struct GradientSummary : GradientCounts {
  std::vector<LossGradient> losses;
};

/// Owns the threads and their scratch: for many rollouts of one model, as in a descent.
class GradientRollouts {
 public:
  /// `losses` must outlive it. Throws InputError for steps or threads below 1 and for a tape_bytes
  /// that does not hold the states of a rollout with checkpoints.
  GradientRollouts(const Model& model, const GradientOptions& options,
                   std::span<const RolloutLoss* const> losses);
  ~GradientRollouts();
  GradientRollouts(GradientRollouts&&) noexcept;
  GradientRollouts& operator=(GradientRollouts&&) noexcept;

  /// Gradients of every loss over `steps` steps from the states of `start`, which is not changed.
  /// The same bits for any number of threads and whatever tape_bytes. Throws InputError when
  /// `start` is of another Model.
  GradientSummary run(const Batch& start, const StepControls& controls,
                      const GradientGoOn& go_on = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Room for them, zeros.
GradientSummary empty_gradients(const Model& model, int environments,
                                const GradientOptions& options, std::size_t losses);

/// Memory of gradients and of the tapes of all threads [bytes].
double gradient_bytes(const Model& model, int environments, const GradientOptions& options,
                      int losses);

/// The same, once.
GradientSummary rollout_gradients(const Batch& start, const StepControls& controls,
                                  const GradientOptions& options,
                                  std::span<const RolloutLoss* const> losses);

}  // namespace tangere
