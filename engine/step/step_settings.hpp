// SPDX-License-Identifier: Apache-2.0
// The settings in force: the caller's, else the scene's.
#pragma once

#include "engine/step/group_step.hpp"
#include "engine/step/stepper.hpp"

namespace tangere {

/// Throws InputError for a step or a tolerance that is not a positive number.
StepSettings step_settings(const Model& model, const StepperOptions& options);

}  // namespace tangere
