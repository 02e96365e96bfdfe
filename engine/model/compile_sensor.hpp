// SPDX-License-Identifier: Apache-2.0
// Tactile sensors in tiles. A step of compile().
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Computes tiles, bounds, axes and pressure sign of a sensor. Throws InputError for degenerate
/// arrays.
CompiledSensor compile_sensor(const TactileDescription& description, const CompiledBody& body,
                              SensorInfo& info);

}  // namespace tangere
