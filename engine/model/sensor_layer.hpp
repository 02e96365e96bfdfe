// SPDX-License-Identifier: Apache-2.0
// Compiles the coupled layer of a sensor (docs/layer.md), or its table (docs/table.md).
#pragma once

#include <memory>

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Cells of a layer, at most: their compliance has 8 bytes for each pair.
inline constexpr int kMostLayerCells = 4096;

/// Compiles the table of a sensor that has one. Throws InputError (file:line) for a sensor that
/// cannot have one. Arguments: as below.
std::shared_ptr<const CompiledLayer> compile_pressure_table(const TactileDescription& d,
                                                            const CompiledSensor& sensor,
                                                            int pressure_sign);

/// Throws InputError (file:line) for a sensor that cannot have a layer. `sensor`: with its points,
/// imperfections and body. `pressure_sign`: as in SensorInfo.
std::shared_ptr<const CompiledLayer> compile_sensor_layer(const TactileDescription& d,
                                                          const CompiledSensor& sensor,
                                                          int pressure_sign);

/// Returns the pairs of a sensor's body with those that it senses, whose loads its layer carries.
/// Throws InputError (file:line) for one by the layer of another sensor.
std::vector<int> load_contacts(const CompiledModel& model, const CompiledSensor& sensor);

/// Throws InputError (file:line) where a sensor's layer is the contact, but a sensed body has no
/// contact with its points.
void check_layer_contacts(const CompiledModel& model, const CompiledSensor& sensor);

}  // namespace tangere
