// SPDX-License-Identifier: Apache-2.0
// Contact sums over a sphere's candidates. Many lanes: row by row of the list. One lane: eight of its points at a time
// through the law, then one after the other into the sums, in list order. The same bits, for a third of the work.
#pragma once

#include "kernels/one_lane.hpp"
#include "kernels/stage.hpp"

namespace tangere::kernels {

/// One row of the list after the other.
template <bool Derivatives, class N>
void sum_sphere_rows(const SphereMotion<N>& motion, const LawParameters<N>& law, const CandidateList<N>& list,
                     SphereSums<N>& sums) {
  clear<Derivatives>(sums);
  SphereChunk<N> chunk;
  for (int k = 0; k < list.count; k += SphereChunk<N>::kPoints) {
    const int count = list.count - k < SphereChunk<N>::kPoints ? list.count - k : SphereChunk<N>::kPoints;
    Vec3<N> xi[SphereChunk<N>::kPoints];
    for (int i = 0; i < count; ++i)
      xi[i] = {list.points[3 * (k + i)], list.points[3 * (k + i) + 1], list.points[3 * (k + i) + 2]};
    fill_chunk<Derivatives>(motion, law, xi, count, chunk);
    add_chunk<Derivatives>(sums, chunk);
  }
}

/// Adds the touching points of row i of a chunk of vectors, in order.
template <bool Derivatives, class A>
void add_row(const SphereChunk<Lanes<A>>& rows, int i, SphereSums<OneLane<A>>& sums, SphereChunk<OneLane<A>>& chunk) {
  using Point = SpherePoint<OneLane<A>>;
  static_assert(sizeof(Point) == Point::kAll * sizeof(double));
  const unsigned slip = lane_bits(rows.slip[i]);
  const double* fields = reinterpret_cast<const double*>(&rows.point[i]);
  chunk.count = chunk.slips = 0;
  for (unsigned left = lane_bits(rows.touch[i]); left != 0; left &= left - 1) {
    const int l = __builtin_ctz(left), to = chunk.count;
    const bool slips = ((slip >> l) & 1U) != 0;
    const auto copy = [&, point = reinterpret_cast<double*>(&chunk.point[to])](int begin, int end) {
      for (int f = begin; f < end; ++f) point[f] = fields[f * kGroup + l];
    };
    copy(0, Point::kValues);
    if (Derivatives) copy(Point::kValues, Point::kDerivatives);
    if (Derivatives && slips) copy(Point::kDerivatives, Point::kAll);
    chunk.touching[chunk.count++] = to;
    if (slips) chunk.slipping[chunk.slips++] = to;
  }
  add_chunk<Derivatives>(sums, chunk);
}

/// Sums over one lane's own candidates; motion and law the same in every lane of the vectors.
template <bool Derivatives, class A, class List>
void sum_own_points(const SphereMotion<Lanes<A>>& motion, const LawParameters<Lanes<A>>& law, const List& list,
                    SphereSums<OneLane<A>>& sums) {
  constexpr int kRows = SphereChunk<Lanes<A>>::kPoints;
  clear<Derivatives>(sums);
  SphereChunk<Lanes<A>> rows;
  SphereChunk<OneLane<A>> chunk;
  for (int first = 0; first < list.own_count; first += kRows * kGroup) {
    const int rest = (list.own_count - first + kGroup - 1) / kGroup, count = rest < kRows ? rest : kRows;
    Vec3<Lanes<A>> xi[kRows];
    for (int i = 0; i < count; ++i) {
      const double* at = list.own + first + i * kGroup;
      xi[i] = {load_lanes<A>(at), load_lanes<A>(at + list.stride), load_lanes<A>(at + 2 * list.stride)};
    }
    fill_chunk<Derivatives>(motion, law, xi, count, rows);
    for (int c = 0; c < rows.count; ++c) add_row<Derivatives>(rows, rows.touching[c], sums, chunk);
  }
}

/// The sums of a stage: by rows, or of the lone lane.
template <bool Derivatives, class N>
void sum_sphere_points(const SphereMotion<N>& motion, const LawParameters<N>& law, const CandidateList<N>& list, int,
                       SphereSums<N>& sums) {
  sum_sphere_rows<Derivatives>(motion, law, list, sums);
}

template <bool Derivatives, class A>
void sum_sphere_points(const SphereMotion<OneLane<A>>& motion, const LawParameters<OneLane<A>>& law,
                       const CandidateList<OneLane<A>>& list, int, SphereSums<OneLane<A>>& sums) {
  using N = Lanes<A>;
  const auto all = [](const Vec3<OneLane<A>>& a) { return Vec3<N>{N(a.x.x), N(a.y.x), N(a.z.x)}; };
  sum_own_points<Derivatives, A>({all(motion.centre), all(motion.q), all(motion.o), N(motion.radius.x)},
                                 {N(law.kn.x), N(law.kt.x), N(law.mu.x), N(law.damping.x), law.law, law.ramp}, list,
                                 sums);
}

template <bool Derivatives, class A>
void sum_sphere_points(const SphereMotion<Lanes<A>>& motion, const LawParameters<Lanes<A>>& law,
                       const CandidateList<Lanes<A>>& list, int lone, SphereSums<Lanes<A>>& sums) {
  if (lone < 0) {
    sum_sphere_rows<Derivatives>(motion, law, list, sums);
    return;
  }
  using N = Lanes<A>;
  const auto spread = [lone](const N& a) { return N(reinterpret_cast<const double*>(&a)[lone]); };
  const auto all = [&](const Vec3<N>& a) { return Vec3<N>{spread(a.x), spread(a.y), spread(a.z)}; };
  alignas(64) SphereSums<OneLane<A>> own;
  sum_own_points<Derivatives, A>(
      {all(motion.centre), all(motion.q), all(motion.o), motion.radius},
      {spread(law.kn), spread(law.kt), spread(law.mu), spread(law.damping), law.law, law.ramp}, list, own);
  const double* from = reinterpret_cast<const double*>(&own);
  N* to = reinterpret_cast<N*>(&sums);
  constexpr std::size_t count = Derivatives ? sizeof(own) / sizeof(double) : 6;  // f and m come first
  for (std::size_t i = 0; i < count; ++i) to[i] = N(from[i]);
}

}  // namespace tangere::kernels
