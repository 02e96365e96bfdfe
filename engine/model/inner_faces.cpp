// SPDX-License-Identifier: Apache-2.0
// A face is covered where its corners lie in the other cuboid, and so does a place outside of it.
// Its plane is then that of the other cuboid's far side, so a place inside of both is as deep as in
// the solid that they make.
#include "engine/model/inner_faces.hpp"

#include <algorithm>

namespace tangere {

using kernels::PairContact;
using kernels::Vec3;

namespace {

constexpr double kFlush = 1e-6;    // tolerance, as a share of the smallest half edge
constexpr double kOutside = 1e-3;  // how far outside of a face the other cuboid is tried

double& axis_of(Vec3<double>& v, int k) { return k == 0 ? v.x : k == 1 ? v.y : v.z; }
double axis_of(const Vec3<double>& v, int k) { return k == 0 ? v.x : k == 1 ? v.y : v.z; }

double smallest(const Vec3<double>& half) { return std::min({half.x, half.y, half.z}); }

/// Whether a cuboid holds a place of its link.
bool holds(const PairContact& cuboid, const Vec3<double>& place, double tolerance) {
  const Vec3<double> y = transposed_times(cuboid.frame2.R, place - cuboid.frame2.p);
  for (int k = 0; k < 3; ++k)
    if (std::abs(axis_of(y, k)) > axis_of(cuboid.size, k) + tolerance) return false;
  return true;
}

/// Whether a cuboid covers the face at the upper (+1) or lower (-1) end of an axis of another.
bool covers(const PairContact& cover, const PairContact& cuboid, int axis, double end) {
  const double least = std::min(smallest(cuboid.size), smallest(cover.size));
  const auto in_link = [&](Vec3<double> y, double outward) {
    axis_of(y, axis) = end * (axis_of(cuboid.size, axis) + outward);
    return cuboid.frame2.R * y + cuboid.frame2.p;
  };
  for (const double a : {-1.0, 1.0})
    for (const double b : {-1.0, 1.0}) {
      Vec3<double> corner = cuboid.size;
      axis_of(corner, (axis + 1) % 3) *= a;
      axis_of(corner, (axis + 2) % 3) *= b;
      if (!holds(cover, in_link(corner, 0), kFlush * least)) return false;
    }
  return holds(cover, in_link({0, 0, 0}, kOutside * least), 0);
}

/// How far a cuboid reaches beyond a face of another, along the face's normal [m].
double reach_beyond(const PairContact& cover, const PairContact& cuboid, int axis, double end) {
  const Vec3<double> normal =
      end * Vec3<double>{cuboid.frame2.R.m[0][axis], cuboid.frame2.R.m[1][axis],
                         cuboid.frame2.R.m[2][axis]};
  const Vec3<double> along = transposed_times(cover.frame2.R, normal);
  const double middle = dot(normal, cover.frame2.p - cuboid.frame2.p),
               half = std::abs(along.x) * cover.size.x + std::abs(along.y) * cover.size.y +
                      std::abs(along.z) * cover.size.z;
  return middle + half - axis_of(cuboid.size, axis);
}

bool is_fixed_cuboid(const PairContact& p) {
  return p.shape == PrimitiveShape::cuboid && p.weights != nullptr && p.size_row < 0;
}

/// Whether a cuboid holds all of another. Of two equal ones the first holds the second.
bool holds_all(const PairContact& outer, const PairContact& inner) {
  const double least = std::min(smallest(outer.size), smallest(inner.size));
  for (int corner = 0; corner < 8; ++corner) {
    Vec3<double> y = inner.size;
    for (int k = 0; k < 3; ++k)
      if ((corner >> k & 1) != 0) axis_of(y, k) = -axis_of(y, k);
    if (!holds(outer, inner.frame2.R * y + inner.frame2.p, kFlush * least)) return false;
  }
  return true;
}

}  // namespace

void find_inner_faces(CompiledModel& m) {
  const auto same = [](const PairContact& a, const PairContact& b) {
    return a.body1 == b.body1 && a.link2 == b.link2;
  };
  for (PairContact& pair : m.pairs) {
    if (!is_fixed_cuboid(pair)) continue;
    for (PairContact& other : m.pairs) {
      if (&other == &pair || !is_fixed_cuboid(other) || !same(pair, other)) continue;
      if (holds_all(other, pair) && (&other < &pair || !holds_all(pair, other))) {
        pair.n_points = pair.n_tiles = 0;  // nothing touches what is inside
        break;
      }
      for (int axis = 0; axis < 3; ++axis)
        for (const double end : {1.0, -1.0}) {
          if (!covers(other, pair, axis, end)) continue;
          double& beyond = pair.beyond[2 * axis + (end > 0 ? 0 : 1)];
          beyond = std::max(beyond, reach_beyond(other, pair, axis, end));
          pair.covered = true;
        }
    }
  }
}

}  // namespace tangere
