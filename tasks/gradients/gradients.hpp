// SPDX-License-Identifier: Apache-2.0
// Computes rollouts of a batch and gradients of losses over them: forward, then back, block by
// block on all threads.
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

/// Owns the threads and their scratch. Use it for many rollouts of one model, as in a descent.
class GradientRollouts {
 public:
  /// `losses` must outlive this object. Throws InputError when steps or threads is below 1, and
  /// when tape_bytes is too small for a rollout with checkpoints.
  GradientRollouts(const Model& model, const GradientOptions& options,
                   std::span<const RolloutLoss* const> losses);
  ~GradientRollouts();
  GradientRollouts(GradientRollouts&&) noexcept;
  GradientRollouts& operator=(GradientRollouts&&) noexcept;

  /// Returns gradients of every loss over `steps` steps from the states of `start`, which does not
  /// change. The bits depend neither on the number of threads nor on tape_bytes. Throws InputError
  /// when `start` is of another Model.
  GradientSummary run(const Batch& start, const StepControls& controls,
                      const GradientGoOn& go_on = {});

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Makes room for gradients, filled with zeros.
GradientSummary empty_gradients(const Model& model, int environments,
                                const GradientOptions& options, std::size_t losses);

/// Memory of gradients and of the tapes of all threads [bytes].
double gradient_bytes(const Model& model, int environments, const GradientOptions& options,
                      int losses);

/// Does the same for one rollout.
GradientSummary rollout_gradients(const Batch& start, const StepControls& controls,
                                  const GradientOptions& options,
                                  std::span<const RolloutLoss* const> losses);

}  // namespace tangere
