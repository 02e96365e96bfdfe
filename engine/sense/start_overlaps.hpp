// SPDX-License-Identifier: Apache-2.0
// Bodies that start where a step cannot do well: deep inside one another, so that springs as deep
// throw them apart, or so far away that their positions are rounded.
#pragma once

#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// Returns a line for each contact whose points start deeper in the other body than a tenth of
/// their own extent, or of a sphere's radius, at the starting state of the scene's first
/// environment with seed 0.
std::vector<std::string> start_overlaps(const Model& model);

/// Returns a line for each body that a sensor feels and in which it starts: with any point in
/// bodies of its own kinematic tree, and deeper than a tenth of its extent in others. The line has
/// the number of these points, the depth [m] and the normal force that they read there [N].
std::vector<std::string> sensors_inside(const Model& model);

/// Returns a line for each pair of bodies with contact points far apart (coarse_contacts) that no
/// step is checked for (Interpenetration), because one of them has no distance that resolves it.
std::vector<std::string> unchecked_overlaps(const Model& model);

/// Returns a line for each body that starts so far from the middle of its scene, or whose scene is
/// so far from the world's origin, that its position is rounded to more than 1e-9 of its size.
std::vector<std::string> rounded_places(const Model& model);

}  // namespace tangere
