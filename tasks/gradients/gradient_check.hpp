// SPDX-License-Identifier: Apache-2.0
// Gradients of one environment's rollout, checked on the spot: the adjoint against central
// differences of whole rollouts and against tangents in dual numbers.
#pragma once

#include <string>
#include <vector>

#include "tasks/gradients/gradient_compare.hpp"
#include "tasks/gradients/gradients.hpp"

namespace tangere {

struct CheckOptions : CompareOptions {
  std::int64_t steps = 0;
  StepperOptions stepper;
};

/// Of environment 0 of `start`. Throws InputError when a step of its rollout finds no solution, and
/// when it continues a run of a scheme of two steps.
GradientCheck check_gradient(const Batch& start, const StepControls& controls,
                             const RolloutLoss& loss, const CheckOptions& options);

}  // namespace tangere
