// SPDX-License-Identifier: Apache-2.0
// Tactile sensors that are lists of points, in tiles. A step of compile().
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Computes tiles, axes and pressure sign of a list of points.
CompiledSensor compile_points(const TactileDescription& description, const CompiledBody& body,
                              SensorInfo& info);

}  // namespace tangere
