// SPDX-License-Identifier: Apache-2.0
// Places the points of curved tactile pads: on a hemisphere, a cylinder, a mesh, or as a file says.
#pragma once

#include <string>
#include <vector>

#include "engine/model/scene.hpp"

namespace tangere {

/// `count` points on the half z ≥ 0 of a sphere [m], evenly spaced along a spiral from the pole:
/// each has the same area. axis0 points away from the pole, axis1 = normal × axis0, normals
/// outward. No image.
std::vector<TactilePoint> hemisphere_points(double radius, int count);

/// Gives each point of a hemisphere a pixel of its own: equal areas of the hemisphere are equal
/// areas of the image, the pole is its middle, x goes down the rows and y along the columns. A
/// point whose pixel an earlier one has takes the nearest that is free. rows × cols must be as many
/// as the points, or more.
void draw_hemisphere(int rows, int cols, std::vector<TactilePoint>& points);

/// Rings of `around` points about z, `along` of them from z = -length/2 to length/2, ends included
/// [m]. axis0 goes around, axis1 along z, normals outward. Image: row = ring, column = around.
std::vector<TactilePoint> cylinder_points(double radius, double length, int along, int around);

/// Every triangle is cut into equal small ones with edges of at most `pitch` [m]; their middles are
/// the points. axis0 lies along the triangle's first edge. Returns none if there would be more than
/// `most`.
std::vector<TactilePoint> mesh_points(const MeshShape& mesh, double pitch, std::size_t most);

/// Reads a count, then a line for each point: "position" "row col" "normal" "axis0" "axis1", and
/// perhaps "kn kt mu damping", factors of the sensor's. Directions are normalised. Positions are in
/// the file's unit. Throws IoError if the file cannot be read, InputError with file:line and what
/// was expected.
std::vector<TactilePoint> read_tactile_points(const std::string& path);

/// The points moved by a pose: directions turn, positions turn and shift.
void move_points(const Pose& pose, std::vector<TactilePoint>& points);

}  // namespace tangere
