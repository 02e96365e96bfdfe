// SPDX-License-Identifier: Apache-2.0
// Warning about runs whose steps needed far more Newton iterations than usual.
#pragma once

#include <string>

#include "engine/scene/scheme.hpp"
#include "tasks/run/step_counts.hpp"

namespace tangere {

/// Returns a sentence where steps took more than 8 evaluations of the residual a stage, or more
/// than a twentieth of them were split; "" where they did not, and for fewer than 20 steps.
std::string costly_steps(Integrator integrator, const StepCounts& counts);

}  // namespace tangere
