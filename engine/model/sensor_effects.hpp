// SPDX-License-Identifier: Apache-2.0
// Rows of the table of effects (effects.cpp) for optional parts of a sensor. Every function takes
// the index of a sensor; −1: all sensors.
#pragma once

#include "engine/model/effects.hpp"

namespace tangere {

EffectInfo find_imperfections(const Scene& scene, int element);
void drop_imperfections(Scene& scene, int element, Way way);
EffectInfo find_markers(const Scene& scene, int element);
void drop_markers(Scene& scene, int element, Way way);
/// Contacts that the points of sensors make.
EffectInfo find_feedback(const Scene& scene, int element);
void drop_feedback(Scene& scene, int element, Way way);

}  // namespace tangere
