// SPDX-License-Identifier: Apache-2.0
// Computes rollouts of a batch and gradients of losses over them: forward, then back, block by
// block on all threads.
#pragma once

#include <memory>
#include <span>

#include "engine/derivative/loss.hpp"
#include "engine/step/batch.hpp"
#include "tasks/gradients/gradient_options.hpp"

namespace tangere {

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
