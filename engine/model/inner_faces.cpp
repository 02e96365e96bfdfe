// SPDX-License-Identifier: Apache-2.0
// A face is covered where its corners lie in the other cuboid, and so does a place outside of it.
#include "engine/model/inner_faces.hpp"

#include <algorithm>

namespace tangere {

using kernels::PairContact;
using kernels::Vec3;

namespace {

constexpr double kFlush = 1e-6;    // tolerance, as a share of the smallest half edge
constexpr double kOutside = 1e-3;  // how far outside of a face the other cuboid is looked for

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

bool is_fixed_cuboid(const PairContact& p) {
  return p.shape == PrimitiveShape::cuboid && p.weights != nullptr && p.size_row < 0;
}

}  // namespace

void find_inner_faces(CompiledModel& m) {
  for (PairContact& pair : m.pairs) {
    if (!is_fixed_cuboid(pair)) continue;
    for (const PairContact& other : m.pairs) {
      if (&other == &pair || !is_fixed_cuboid(other) || other.body1 != pair.body1 ||
          other.link2 != pair.link2)
        continue;
      for (int axis = 0; axis < 3; ++axis)
        for (const double end : {1.0, -1.0})
          if (covers(other, pair, axis, end)) pair.inner_faces |= kernels::face_bit(axis, end);
    }
  }
}

}  // namespace tangere
