// SPDX-License-Identifier: Apache-2.0
// Numbers that every tactile point has of its own: its position and its coefficients. Derivatives
// by them show where sensing pays, and fit a skin that is not uniform.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

class Batch;

/// A point's own numbers: its position x y z in its body's frame, with its axes held fixed, then
/// its coefficients (the sensor's times the point's factors).
inline constexpr int kPointNumbers = 7;

/// Name of number k, "x", "y", "z", "kn" …, and its unit where a sensor has this law.
const char* point_number_name(int k);
const char* point_number_unit(int k, ContactLaw law);

/// Number of points of all sensors. They are ordered sensor by sensor, each in the order of its
/// field.
int tactile_points(const Model& model);
/// Index of a sensor's first point in that order.
int first_tactile_point(const Model& model, int sensor);

/// Returns kn, kt, mu and damping of a sensor in an environment.
ContactCoefficients sensor_coefficients(const Batch& batch, int environment, int sensor);

/// Adds `change`, (points, kPointNumbers), to the own numbers of a sensor's points, in their units.
/// An array becomes a list, which has neither rows nor columns. Throws InputError if `change` has
/// another size, or changes a coefficient that is 0 for the sensor: points only have factors of it.
void add_to_points(TactileDescription& sensor, std::span<const double> change);

}  // namespace tangere
