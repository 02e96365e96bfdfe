// SPDX-License-Identifier: Apache-2.0
// What a caller may change about steps.
#pragma once

#include <optional>

#include "engine/scene/scheme.hpp"

namespace tangere {

/// What a caller may change about the solve. Defaults come from the scene.
struct StepperOptions {
  std::optional<Integrator> integrator;
  std::optional<double> timestep;   ///< [s]
  std::optional<double> tolerance;  ///< scaled residual, dimensionless
  /// Steps are cut into parts that keep this accuracy (docs/accuracy.md), relative, below 1. 0:
  /// every step is one part.
  std::optional<double> accuracy{};
  /// Bodies sleep that have moved by less than this share of their size for a while
  /// (docs/sleeping.md), below 1. 0: none does.
  std::optional<double> sleep{};
  /// Steps without a tape take contacts that can never push, too. So they have the bits of steps
  /// with one.
  bool keep_inert_contacts = false;
};

}  // namespace tangere
