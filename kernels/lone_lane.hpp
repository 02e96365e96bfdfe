// SPDX-License-Identifier: Apache-2.0
// Contact sums of a single lane: eight of its points at a time through the law, then one after the other into the sums.
#pragma once

#include "kernels/stage.hpp"

namespace tangere::kernels {

/// One lane of Lanes<Arch>: a double that rounds like them.
template <class Arch>
struct OneLane {
  double x;
  OneLane() = default;
  OneLane(double value) : x(value) {}  // NOLINT(google-explicit-constructor)
};
template <class A>
OneLane<A> operator+(OneLane<A> a, OneLane<A> b) {
  return a.x + b.x;
}
template <class A>
OneLane<A> operator*(OneLane<A> a, OneLane<A> b) {
  return a.x * b.x;
}
template <class A>
OneLane<A>& operator+=(OneLane<A>& a, OneLane<A> b) {
  return a = a + b;
}
/// Fused exactly where Lanes<Arch> fuses.
template <class A>
OneLane<A> mul_add(OneLane<A> a, OneLane<A> b, OneLane<A> c) {
  if constexpr (kFuses<A>) return __builtin_fma(a.x, b.x, c.x);
  return a.x * b.x + c.x;
}

template <class A>
Lanes<A> spread(const Lanes<A>& a, int lane) {
  alignas(64) double x[kGroup];
  store_lanes(a, x);
  return Lanes<A>(x[lane]);
}
template <class A>
Vec3<Lanes<A>> spread(const Vec3<Lanes<A>>& a, int lane) {
  return {spread(a.x, lane), spread(a.y, lane), spread(a.z, lane)};
}

template <class A>
bool operator<(OneLane<A> a, OneLane<A> b) {
  return a.x < b.x;
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

/// Sums over the candidates of `lane`, the same in every lane.
template <bool Derivatives, class A>
void sum_lone_sphere(const SphereMotion<Lanes<A>>& all, const LawParameters<Lanes<A>>& laws,
                     const CandidateList<Lanes<A>>& list, int lane, SphereSums<Lanes<A>>& sums) {
  using N = Lanes<A>;
  using One = OneLane<A>;
  const SphereMotion<N> motion = {spread(all.centre, lane), spread(all.q, lane), spread(all.o, lane), all.radius};
  const LawParameters<N> law = {spread(laws.kn, lane), spread(laws.kt, lane),      spread(laws.mu, lane),
                                spread(laws.damping, lane), laws.law, laws.ramp};
  constexpr int kRows = SphereChunk<N>::kPoints;
  alignas(64) SphereSums<One> own;
  clear<Derivatives>(own);
  SphereChunk<N> rows;
  SphereChunk<One> chunk;
  for (int first = 0; first < list.own_count; first += kRows * kGroup) {
    const int rest = (list.own_count - first + kGroup - 1) / kGroup, count = rest < kRows ? rest : kRows;
    Vec3<N> xi[kRows];
    for (int i = 0; i < count; ++i) {
      const double* at = list.own + first + i * kGroup;
      xi[i] = {load_lanes<A>(at), load_lanes<A>(at + list.stride), load_lanes<A>(at + 2 * list.stride)};
    }
    fill_chunk<Derivatives>(motion, law, xi, count, rows);
    for (int c = 0; c < rows.count; ++c) add_row<Derivatives>(rows, rows.touching[c], own, chunk);
  }
  const double* from = reinterpret_cast<const double*>(&own);
  N* to = reinterpret_cast<N*>(&sums);
  constexpr std::size_t count = Derivatives ? sizeof(own) / sizeof(double) : 6;  // f and m come first
  for (std::size_t i = 0; i < count; ++i) to[i] = N(from[i]);
}

/// Plain numbers have one lane and no list of its own.
template <bool Derivatives, class N>
void sum_lone_sphere(const SphereMotion<N>&, const LawParameters<N>&, const CandidateList<N>&, int, SphereSums<N>&) {}

}  // namespace tangere::kernels
