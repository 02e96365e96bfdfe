// SPDX-License-Identifier: Apache-2.0
// Normalised tactile flow map: the pattern of shear on a set of pads, without its scale
// (docs/contact.md).
#pragma once

#include <span>

namespace tangere {

/// A tactile field that goes into a flow map, (points, 3) as Readout gives it [N].
template <class T>
struct ShearField {
  std::span<const T> force;
  std::span<const T> before =
      {};  ///< a field of the same sensor that is subtracted; empty: nothing is
};

/// The first two components of every field, divided by the largest length among all points of all
/// of them: pads, steps or both share one scale. `flow`: (points of the first field, 2), then of
/// the second …; dimensionless, lengths up to
/// 1. All zero where that length is not above `smallest` [N], so without contact. Returns the
/// length [N]. Throws InputError when sizes do not fit. Lengths are computed in double, whatever is
/// stored.
double normalised_flow(std::span<const ShearField<double>> fields, std::span<double> flow,
                       double smallest = 0);
double normalised_flow(std::span<const ShearField<float>> fields, std::span<float> flow,
                       double smallest = 0);

/// Where derivatives by a field are added, as ShearField; empty spans: they are not asked for.
struct ShearCotangent {
  std::span<double> force, before;
};

/// The other way: from the derivatives of a loss by the flow map to those by every field. The
/// largest length changes with the first point that has it. Nothing is added where the map is all
/// zero.
void normalised_flow_vjp(std::span<const ShearField<double>> fields,
                         std::span<const double> flow_cotangent,
                         std::span<const ShearCotangent> out, double smallest = 0);

}  // namespace tangere
