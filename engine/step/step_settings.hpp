// SPDX-License-Identifier: Apache-2.0
// The settings in force: the caller's if given, else the scene's.
#pragma once

#include "engine/model/model.hpp"
#include "engine/step/stepper_options.hpp"

namespace tangere {

struct StepSettings {
  Integrator integrator;
  double timestep;
  double tolerance;
  int max_iterations;
  double accuracy = 0;  ///< relative, of the parts of a step; 0: every step is one part
  /// Skip the final residual evaluation where quadratic convergence predicts that the tolerance is
  /// met, and share factors between stages. False with an explicit tolerance.
  bool spare = false;
  /// Steps that create energy are taken by BDF1 or in parts, and those in which bodies turn too far
  /// by SDIRK2 or in parts.
  bool bounded_energy = true;
  bool keep_inert_contacts = false;  ///< those that can never push, in steps without a tape, too
  double sleep = 0;  ///< share of its size that a body may move and still rest; 0: none sleeps
};

/// Throws InputError if the timestep or the tolerance is not a positive number, if the accuracy or
/// sleep is none, or if the scene does not allow bodies to sleep.
StepSettings step_settings(const Model& model, const StepperOptions& options);

/// Throws InputError if bodies may sleep, for what takes derivatives of steps.
void refuse_sleep(const Model& model, const StepSettings& settings);

}  // namespace tangere
