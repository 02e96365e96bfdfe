// SPDX-License-Identifier: Apache-2.0
// Evaluates the contact law for a chunk of points and adds it to the sums of their pair.
//
// A family of shapes provides a Motion (numbers only, the same for all points), its Place (ξ, or ξ
// with the point's anchors), Point, Pass and Sums, and
//   find_distance(motion, place, point, pass)
//       distance and normal; returns where the point touches
//   find_slide(motion, point, pass)          velocities
//   with_law(motion, law)                    the motion with a point's own coefficients
//   find_force<Derivatives>(…)
//       force and what its derivative needs; returns where the point slips
//   add_chunk<Derivatives>(sums, chunk)      the chunk's points in order
// Families: kernels/contact/sphere_contact.hpp, kernels/contact/face_contact.hpp, and both with
// shear springs: kernels/contact/elastic_sphere_contact.hpp, elastic_face_contact.hpp.
#pragma once

#include <utility>

#include "kernels/contact/contact_law.hpp"

namespace tangere::kernels {

template <class P>
struct PointChunk {
  using N = typename P::Number;
  using Mask = decltype(std::declval<N>() < std::declval<N>());
  static constexpr int kPoints =
      sizeof(N) == sizeof(double) ? 8 : 4;  // as many of lanes as the first-level cache holds
  P point[kPoints];
  Mask touch[kPoints], slip[kPoints];        ///< the lanes in which a point touches and slips
  int touching[kPoints], slipping[kPoints];  ///< indices of points that touch or slip in some lane
  int count = 0, slips = 0;
};

/// Evaluates the law at the touching points of a chunk, which stand for `areas` [m²]. It is a call
/// of its own: inlined, it would slow down points whose coefficients count per point.
template <bool Derivatives, class Motion, class N>
[[gnu::noinline]] void fill_per_area(const Motion& z, const LawParameters<N>& law, const N* areas,
                                     const typename Motion::Place* place,
                                     PointChunk<typename Motion::Point>& chunk) {
  for (int c = 0; c < chunk.count; ++c) {
    const int i = chunk.touching[c];
    LawParameters<N> own = law;
    set_weighted(law, areas[i], own);
    const Motion moved = with_law(z, own);
    typename Motion::Pass pass;
    find_distance(moved, place[i], chunk.point[i], pass);
    find_slide(moved, chunk.point[i], pass);
    chunk.slip[i] = find_force<Derivatives>(moved, own, pass, chunk.point[i]);
    if (any(chunk.slip[i])) chunk.slipping[chunk.slips++] = i;
  }
}

/// Evaluates the law at `count` ≤ kPoints places, pass by pass. Each pass depends on one square
/// root, so the latencies of the roots of different points overlap. `areas`: for which the places
/// stand [m²]: coefficients count per area; null: they count per point.
template <bool Derivatives, class Motion, class N>
void fill_chunk(const Motion& z, const LawParameters<N>& law, const typename Motion::Place* place,
                const N* areas, int count, PointChunk<typename Motion::Point>& chunk) {
  typename Motion::Pass pass[PointChunk<typename Motion::Point>::kPoints];
  chunk.count = chunk.slips = 0;
  for (int i = 0; i < count; ++i) {
    chunk.touch[i] = find_distance(z, place[i], chunk.point[i], pass[i]);
    if (any(chunk.touch[i])) chunk.touching[chunk.count++] = i;
  }
  if (areas != nullptr) return fill_per_area<Derivatives>(z, law, areas, place, chunk);
  for (int c = 0; c < chunk.count; ++c)
    find_slide(z, chunk.point[chunk.touching[c]], pass[chunk.touching[c]]);
  for (int c = 0; c < chunk.count; ++c) {
    const int i = chunk.touching[c];
    chunk.slip[i] = find_force<Derivatives>(z, law, pass[i], chunk.point[i]);
    if (any(chunk.slip[i])) chunk.slipping[chunk.slips++] = i;
  }
}

// The sums below must stay in registers. Inlining is forced, because GCC's heuristics do not
// guarantee it.
template <class N>
[[gnu::always_inline]] inline void add_outer(Mat3<N>& sum, const Vec3<N>& a, const Vec3<N>& b) {
  const N x[3] = {a.x, a.y, a.z}, y[3] = {b.x, b.y, b.z};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) sum.m[i][j] = mul_add(x[i], y[j], sum.m[i][j]);
}

/// A symmetric matrix: xx, xy, xz, yy, yz, zz.
template <class N>
struct UpperTriangle {
  N m[6];
};
/// Adds a bᵀ, which is known to be symmetric.
template <class N>
[[gnu::always_inline]] inline void add_upper(UpperTriangle<N>& sum, const Vec3<N>& a,
                                             const Vec3<N>& b) {
  sum.m[0] = mul_add(a.x, b.x, sum.m[0]);
  sum.m[1] = mul_add(a.x, b.y, sum.m[1]);
  sum.m[2] = mul_add(a.x, b.z, sum.m[2]);
  sum.m[3] = mul_add(a.y, b.y, sum.m[3]);
  sum.m[4] = mul_add(a.y, b.z, sum.m[4]);
  sum.m[5] = mul_add(a.z, b.z, sum.m[5]);
}
template <class N>
Mat3<N> full(const UpperTriangle<N>& s) {
  return {{{s.m[0], s.m[1], s.m[2]}, {s.m[1], s.m[3], s.m[4]}, {s.m[2], s.m[4], s.m[5]}}};
}

/// Adds points one after the other to a few sums that stay in registers: f(sum, point).
template <class Sum, class P, class F>
[[gnu::always_inline]] inline void add_each(Sum& sum, const P* point, const int* which, int count,
                                            const F& f) {
  Sum local = sum;
  for (int i = 0; i < count; ++i) f(local, point[which[i]]);
  sum = local;
}

}  // namespace tangere::kernels
