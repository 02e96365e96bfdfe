// SPDX-License-Identifier: Apache-2.0
// Checks of the initial state: bodies that overlap so deeply that contact springs eject them,
// bodies so far from the origin that their positions are rounded, and paths that start inside
// surfaces.
#pragma once

#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// Returns a line for each contact whose points start deeper in the other body than a tenth of
/// their own extent, or of a sphere's radius, at the starting state of the scene's first
/// environment with seed 0.
std::vector<std::string> start_overlaps(const Model& model);

/// Returns a line for each sensed body inside which the sensor starts: with any point in bodies of
/// its own kinematic tree, and deeper than a tenth of its extent in others. The line has the number
/// of these points, the depth [m] and the normal force that they read there [N].
std::vector<std::string> sensors_inside(const Model& model);

/// Returns a line for each pair of bodies with contact points far apart (coarse_contacts) that no
/// step is checked for (Interpenetration), because one of them has no distance that resolves it.
std::vector<std::string> unchecked_overlaps(const Model& model);

/// Returns a line for each body whose position is rounded by more than 1e-9 of its size, because it
/// starts far from the middle of its scene or the scene is far from the world's origin.
std::vector<std::string> rounded_places(const Model& model);

/// Returns a line for each path of a transmission with a point inside a surface that it goes
/// around, at the starting state of the scene's first environment with seed 0: it goes straight
/// through that surface.
std::vector<std::string> paths_through_surfaces(const Model& model);

/// Returns a line for each joint whose coordinate is that of a transmission and starts outside its
/// limits, at the starting state of the scene's first environment with seed 0.
std::vector<std::string> transmissions_outside_limits(const Model& model);

}  // namespace tangere
