// SPDX-License-Identifier: Apache-2.0
// A cuboid that a convex body touches from one side. For each solve the faces on that side are
// chosen (kernels/step/faces.hpp), and all points of the body are measured against their planes:
//   d = max n·y - s_n over the chosen faces, where |y_k| ≤ s_k + overhang along all other axes,
//       else no contact
// so d continues below the far side, and n is constant over a face that is the only chosen one.
// If no face is chosen, d is that to the nearest face, point by point, as in CuboidDistance.
// The same planes serve a cuboid that lies flush on another one of its link.
#pragma once

#include "kernels/contact/shapes/plane.hpp"

namespace tangere::kernels {

/// Both rules as one: the largest of six signed distances to planes, of which those that do not
/// count are far away.
template <class N>
struct CuboidFace {
  static constexpr Bending kBending = Bending::flat;
  static constexpr PointSumForm kSums = PointSumForm::faces;
  Vec3<N> upper, lower;  ///< distances of the planes from the centre
  Vec3<N> extent;  ///< beyond it, |y_k| is no contact; always below kFarAway, for filler points

  /// `side`: of each axis +1 or -1 where the face at that end is chosen, else 0. `overhang` [m]:
  /// how far beyond the edges of chosen faces a point may lie.
  static CuboidFace of(const Vec3<N>& half, const Vec3<N>& side, double overhang) {
    const N no_plane(1e9);
    const auto open = abs(side.x) + abs(side.y) + abs(side.z) < N(0.5);
    const auto plane = [&](const N& s, const N& sign) {
      return select(open | (sign > N(0.5)), s, no_plane);
    };
    const auto reach = [&](const N& s, const N& sign) {
      return select(open | (abs(sign) > N(0.5)), N(kPlaneReach), s + N(overhang));
    };
    return {{plane(half.x, side.x), plane(half.y, side.y), plane(half.z, side.z)},
            {plane(half.x, -side.x), plane(half.y, -side.y), plane(half.z, -side.z)},
            {reach(half.x, side.x), reach(half.y, side.y), reach(half.z, side.z)}};
  }

  /// A cuboid that another one goes on from some of its faces by `beyond` [m]: of axis k the upper
  /// face is number 2 k, the lower one 2 k + 1. Their planes are moved out so far. Beyond the faces
  /// is no contact: there the other cuboid is touched.
  static CuboidFace continued(const Vec3<N>& half, const double* beyond) {
    const auto plane = [&](const N& s, int face) { return s + N(beyond[face]); };
    const auto reach = [&](const N& s, int face) {
      return beyond[face] > 0 || beyond[face + 1] > 0 ? s : N(kPlaneReach);
    };
    return {{plane(half.x, 0), plane(half.y, 2), plane(half.z, 4)},
            {plane(half.x, 1), plane(half.y, 3), plane(half.z, 5)},
            {reach(half.x, 0), reach(half.y, 2), reach(half.z, 4)}};
  }

  Distance<N> evaluate(const Vec3<N>& y, N& curvature) const {
    const N zero(0.0), one(1.0);
    curvature = zero;
    const Vec3<N> above = y - upper, below = -y - lower;
    const Vec3<N> q = {max(above.x, below.x), max(above.y, below.y), max(above.z, below.z)};
    const auto sign = [&](const N& a, const N& b) { return select(a >= b, one, -one); };
    const auto x_first = (q.x >= q.y) & (q.x >= q.z);  // the first of x, y, z on ties
    const auto y_first = q.y >= q.z;
    const N d = select(x_first, q.x, select(y_first, q.y, q.z));
    return {select(reaches(y, zero), d, one),
            {select(x_first, sign(above.x, below.x), zero),
             select(x_first, zero, select(y_first, sign(above.y, below.y), zero)),
             select(x_first, zero, select(y_first, zero, sign(above.z, below.z)))}};
  }
  Distance<N> inside(const Vec3<N>& y, N& curvature) const { return evaluate(y, curvature); }

  /// As in CuboidDistance: a face moves along its normal.
  Vec3<N> size_share(const Vec3<N>&, const Vec3<N>& n, const Vec3<N>& rho) const {
    return {n.x * rho.x, n.y * rho.y, n.z * rho.z};
  }

  /// Whether y is at most m from where the chosen faces count.
  auto reaches(const Vec3<N>& y, const N& m) const {
    return (abs(y.x) <= extent.x + m) & (abs(y.y) <= extent.y + m) & (abs(y.z) <= extent.z + m);
  }
};

template <class N>
auto nearer_than(const CuboidFace<N>& shape, const Vec3<N>& y, const N& m) {
  const Vec3<N> above = y - shape.upper, below = -y - shape.lower;
  const N d = max(max(max(above.x, below.x), max(above.y, below.y)), max(above.z, below.z));
  return (d < m) & shape.reaches(y, m);
}

}  // namespace tangere::kernels
