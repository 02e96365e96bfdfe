// SPDX-License-Identifier: Apache-2.0
// Gradients of one environment's rollout, checked on the spot: the adjoint against central differences of whole rollouts and
// against tangents in dual numbers.
#pragma once

#include <string>
#include <vector>

#include "tasks/gradients.hpp"

namespace tangere {

struct CheckOptions {
  std::int64_t steps = 0;
  int entries = 24;        ///< of each input that differences are taken of, drawn if there are more; 0: all
  std::uint64_t seed = 0;  ///< of that draw and of the directions
  StepperOptions stepper;
};

/// One kind of input. Errors are relative to the norm of the gradient by it, (numbers of the scene: by their relative change).
struct CheckedInput {
  std::string name;                ///< "u", "q", "v", "numbers"
  std::size_t entries = 0;         ///< the gradient has
  std::size_t compared = 0;        ///< with differences
  std::size_t kinks = 0;           ///< left out: differences that do not settle
  double norm = 0;                 ///< of the gradient
  double difference_error = 0;     ///< largest among those compared
  std::string worst;               ///< where
  double tangent_error = 0;        ///< |g·d - tangent|/(|g| |d|) along a random direction
};

struct GradientCheck {
  double loss = 0;
  std::vector<CheckedInput> inputs;
  [[nodiscard]] double max_relative_error() const;
  [[nodiscard]] std::size_t entries() const;  ///< compared
  [[nodiscard]] std::size_t kinks() const;
};

/// Of environment 0 of `start`. Throws InputError when a step of its rollout finds no solution.
GradientCheck check_gradient(const Batch& start, const StepControls& controls, const RolloutLoss& loss,
                             const CheckOptions& options);

}  // namespace tangere
