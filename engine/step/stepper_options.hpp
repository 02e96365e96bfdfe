// SPDX-License-Identifier: Apache-2.0
// Options of a Stepper.
#pragma once

#include <optional>

#include "engine/scene/scheme.hpp"

namespace tangere {

/// Options of a Stepper. Defaults are those of the scene.
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
  /// Steps without a tape include contacts that can never exert a force, and so have the bits of
  /// steps with a tape.
  bool keep_inert_contacts = false;
};

}  // namespace tangere
