// SPDX-License-Identifier: Apache-2.0
// Numbers that every tactile point has of its own: where it is, and its coefficients. Derivatives by them say where sensing
// pays, and fit a skin that is not the same everywhere.
#pragma once

#include <span>
#include <vector>

#include "engine/model.hpp"

namespace tangere {

/// Of a point: its place x y z in its body's frame [m], its axes left as they are; then its own kn, kt, mu, kd or c (the
/// sensor's times its factors).
inline constexpr int kPointNumbers = 7;

/// All points of all sensors, one sensor after the other, each in the order of its field.
int tactile_points(const Model& model);
/// Of which these come before those of a sensor.
int first_tactile_point(const Model& model, int sensor);

/// The points of an array, row by row, with its axes: what a sensor is whose points are given one by one, field included.
std::vector<TactilePoint> list_points(const RectArray& array);

/// Changes the points of a sensor; an array becomes a list. `change`: (points, kPointNumbers), [m] and parts of the sensor's
/// coefficients (what is added to TactilePoint::factors).
void add_to_points(TactileDescription& sensor, std::span<const double> change);

}  // namespace tangere
