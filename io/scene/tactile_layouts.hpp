// SPDX-License-Identifier: Apache-2.0
// Places the points of curved tactile pads: on a hemisphere, a cylinder or a mesh, or from a file.
#pragma once

#include <string>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Returns `count` points on the half z ≥ 0 of a sphere [m], evenly spaced along a spiral from the
/// pole, so that each has the same area. axis0 points away from the pole, axis1 = normal × axis0,
/// normals point outward. No image.
std::vector<TactilePoint> hemisphere_points(double radius, int count);

/// Assigns a pixel to each point of a hemisphere. Equal areas of the hemisphere are equal
/// areas of the image, and the pole is its middle. x increases down the rows, y along the columns.
/// A point whose pixel is taken gets the nearest free pixel. rows × cols must be at least the
/// number of points.
void draw_hemisphere(int rows, int cols, std::vector<TactilePoint>& points);

/// Returns rings of `around` points about z, `along` of them from z = -length/2 to length/2, ends
/// included [m]. axis0 points around, axis1 along z, normals outward. Image: row = ring, column =
/// index around.
std::vector<TactilePoint> cylinder_points(double radius, double length, int along, int around);

/// Cuts every triangle into equal small ones with edges of at most `pitch` [m] and returns their
/// middles. axis0 lies along the triangle's first edge. Returns none if there would be more than
/// `most`.
std::vector<TactilePoint> mesh_points(const MeshShape& mesh, double pitch, std::size_t most);

/// Returns a point at `position` [m] from unit vectors that are orthogonal: axis1 = normal × axis0.
TactilePoint listed_point(const Vector3& position, const Vector3& normal, const Vector3& axis1);

/// Reads a count, then a line for each point: "position" "row col" "normal" "axis0" "axis1",
/// optionally followed by "kn kt mu damping" as factors of the sensor's coefficients, of which that
/// of kt is of ks, too. Directions are normalised. Positions are in the file's unit. Throws IoError
/// if the file cannot be read, InputError with file:line and what was expected.
std::vector<TactilePoint> read_tactile_points(const std::string& path);

/// Moves points by a pose: directions rotate, positions rotate and shift.
void move_points(const Pose& pose, std::vector<TactilePoint>& points);

}  // namespace tangere
