// SPDX-License-Identifier: Apache-2.0
// The settings in force: the caller's if given, else the scene's.
#pragma once

#include "engine/step/group_step.hpp"
#include "engine/step/stepper.hpp"

namespace tangere {

/// Throws InputError if the timestep or the tolerance is not a positive number.
StepSettings step_settings(const Model& model, const StepperOptions& options);

}  // namespace tangere
