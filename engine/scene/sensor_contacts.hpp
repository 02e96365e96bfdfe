// SPDX-License-Identifier: Apache-2.0
// Contacts of a sensor whose points touch: what feedback="true" adds to a scene.
#pragma once

#include "engine/scene/scene.hpp"

namespace tangere {

/// Adds a contact of the sensor's points with every body that it senses. The scene reader calls it
/// for feedback; a scene that is made in C++ needs it for LayerDescription::feedback. Throws
/// InputError (file:line) for points with factors, for a body whose own sensor has a contact with
/// the sensor's body already, and where nothing is sensed.
void add_sensor_contacts(Scene& scene, const TactileDescription& sensor);

}  // namespace tangere
