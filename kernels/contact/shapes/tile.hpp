// SPDX-License-Identifier: Apache-2.0
// A shape against the points of one tile of a pad: common inputs of the shapes' brackets.
#pragma once

#include "kernels/contact/contact_types.hpp"
#include "kernels/contact/shapes/distance_grid.hpp"
#include "kernels/numbers/linalg.hpp"

namespace tangere::kernels {

/// A shape in pad axes: pose, twist relative to the pad at the pad's origin, and the sensor's
/// contact parameters.
template <class N>
struct Touch {
  Mat3<N> Q;
  Vec3<N> c;
  Vec3<N> omega, v;
  Coefficients<N> law;
};

struct TouchShape {
  PrimitiveShape shape;
  double size[3];                      ///< as in PairContact [m]
  const DistanceGrid* grid = nullptr;  ///< of a mesh
};

/// A point relative to its tile's centre, pad axes [m].
template <class N, bool Curved>
struct PointOffset {
  N x, y;  ///< z = 0
};
template <class N>
struct PointOffset<N, true> {
  N x, y, z;
};
/// Returns a row of a matrix times the offset: a x + b y + c z.
template <class N>
N along(const N& a, const N& b, const N&, const PointOffset<N, false>& s) {
  return mul_add(a, s.x, b * s.y);
}
template <class N>
N along(const N& a, const N& b, const N& c, const PointOffset<N, true>& s) {
  return mul_add(a, s.x, mul_add(b, s.y, c * s.z));
}

/// Returns the square of its length.
template <class N>
N square_of(const PointOffset<N, false>& s) {
  return mul_add(s.x, s.x, s.y * s.y);
}
template <class N>
N square_of(const PointOffset<N, true>& s) {
  return mul_add(s.x, s.x, mul_add(s.y, s.y, s.z * s.z));
}

inline constexpr int kBracketRows = 14;  ///< largest number that a shape has

}  // namespace tangere::kernels
