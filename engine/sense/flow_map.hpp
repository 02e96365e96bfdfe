// SPDX-License-Identifier: Apache-2.0
// Normalised tactile flow map: the pattern of shear on a set of pads, independent of its scale
// (docs/contact.md).
#pragma once

#include <span>

namespace tangere {

/// A tactile field that enters a flow map, (points, 3) as Readout returns it [N].
template <class T>
struct ShearField {
  std::span<const T> force;
  /// A field of the same sensor that is subtracted; empty: none.
  std::span<const T> before = {};
};

/// Divides the first two components of all fields by their largest length among all points of all
/// fields. Pads, steps or both thus share one scale. `flow`: (points of the first field, 2), then
/// those of the second …; dimensionless, lengths up to 1. It is all zero where the largest length
/// is not above `smallest` [N], which includes no contact. Returns the largest length [N]. Throws
/// InputError when sizes do not fit. Lengths are computed in double, whatever is stored.
double normalised_flow(std::span<const ShearField<double>> fields, std::span<double> flow,
                       double smallest = 0);
double normalised_flow(std::span<const ShearField<float>> fields, std::span<float> flow,
                       double smallest = 0);

/// Where derivatives by a ShearField are added. Empty spans: none is computed.
struct ShearCotangent {
  std::span<double> force, before;
};

/// The reverse: turns derivatives of a loss by the flow map into those by every field. If several
/// points have the largest length, it changes with the first of them. Nothing is added where the
/// map is all zero.
void normalised_flow_vjp(std::span<const ShearField<double>> fields,
                         std::span<const double> flow_cotangent,
                         std::span<const ShearCotangent> out, double smallest = 0);

}  // namespace tangere
