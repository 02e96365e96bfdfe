// SPDX-License-Identifier: Apache-2.0
// Turns the coefficients of a sensor's imperfections into weights of steps and points.
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Fills the members of a sensor, and of its SensorInfo, that describe imperfections. The points of
/// the sensor must be set. `timestep`: of the scene [s]. Throws InputError (file:line) for values
/// out of range.
void compile_imperfections(const TactileDescription& description, double timestep,
                           CompiledSensor& sensor, SensorInfo& info);

}  // namespace tangere
