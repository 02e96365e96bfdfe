// SPDX-License-Identifier: Apache-2.0
// The settings in force: the caller's if given, else the scene's.
#pragma once

#include "engine/step/group_step.hpp"
#include "engine/step/stepper.hpp"

namespace tangere {

/// Throws InputError if the timestep or the tolerance is not a positive number, if the accuracy or
/// sleep is none, or if the scene does not allow bodies to sleep.
StepSettings step_settings(const Model& model, const StepperOptions& options);

/// Throws InputError if bodies may sleep, for what takes derivatives of steps.
void refuse_sleep(const Model& model, const StepSettings& settings);

}  // namespace tangere
