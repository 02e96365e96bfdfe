// SPDX-License-Identifier: Apache-2.0
// Options of a Stepper.
#pragma once

#include <optional>

#include "engine/model/scheme.hpp"

namespace tangere {

/// Tolerance of differentiable runs. A gradient is exact for states that solve their equations, so
/// its error is about as large.
inline constexpr double kGradientTolerance = 1e-9;

/// Options of a Stepper. Defaults are those of the scene.
struct StepperOptions {
  std::optional<Integrator> integrator{};
  std::optional<double> timestep{};   ///< [s]
  std::optional<double> tolerance{};  ///< scaled residual, dimensionless
  /// Steps are cut into parts that keep this accuracy (docs/accuracy.md), relative, below 1. 0:
  /// every step is one part.
  std::optional<double> accuracy{};
  /// Bodies sleep that have moved by less than this share of their size for a while
  /// (docs/sleeping.md), below 1. 0: none does.
  std::optional<double> sleep{};
  /// Steps have the bits of steps that are differentiated: contacts that can never exert a force
  /// are evaluated too, and where neither caller nor scene names a tolerance it is
  /// kGradientTolerance. Bodies may not sleep then.
  bool differentiable = false;
};

/// Returns the options of differentiable steps.
inline StepperOptions differentiable(StepperOptions options) {
  options.differentiable = true;
  return options;
}

}  // namespace tangere
