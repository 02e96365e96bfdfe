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

/// Adds the candidates of `lane` to the sums, which come back the same in every lane.
template <bool Derivatives, class A>
void sum_lone_sphere(const SphereMotion<Lanes<A>>& all, const LawParameters<Lanes<A>>& laws,
                     const CandidateList<Lanes<A>>& list, int lane, SphereSums<Lanes<A>>& sums) {
  using N = Lanes<A>;
  using One = OneLane<A>;
  const SphereMotion<N> motion = {spread(all.centre, lane), spread(all.q, lane), spread(all.o, lane), all.radius};
  const LawParameters<N> law = {spread(laws.kn, lane), spread(laws.kt, lane),      spread(laws.mu, lane),
                                spread(laws.damping, lane), laws.law, laws.ramp};
  SphereSums<One> own;
  clear(own);
  SpherePoint<N> points;
  for (int k = 0; k < list.own_count; k += kGroup) {
    const double* at = list.own + k;
    const Vec3<N> xi = {load_lanes<A>(at), load_lanes<A>(at + list.stride), load_lanes<A>(at + 2 * list.stride)};
    LaneMask<A> touching, slipping;
    sphere_point<Derivatives>(motion, law, xi, points, touching, slipping);
    if (!any(touching)) continue;
    const unsigned touch = lane_bits(touching), slip = lane_bits(slipping);
    const double* rows = reinterpret_cast<const double*>(&points);
    for (unsigned left = touch; left != 0; left &= left - 1) {
      const int l = __builtin_ctz(left);
      SpherePoint<One> point;
      double* fields = reinterpret_cast<double*>(&point);
      for (std::size_t i = 0; i < sizeof(point) / sizeof(double); ++i) fields[i] = rows[i * kGroup + std::size_t(l)];
      add_point<Derivatives>(own, point, ((slip >> l) & 1U) != 0);
    }
  }
  const double* from = reinterpret_cast<const double*>(&own);
  N* to = reinterpret_cast<N*>(&sums);
  for (std::size_t i = 0; i < sizeof(own) / sizeof(double); ++i) to[i] = N(from[i]);
}

/// Plain numbers have one lane and no list of its own.
template <bool Derivatives, class N>
void sum_lone_sphere(const SphereMotion<N>&, const LawParameters<N>&, const CandidateList<N>&, int, SphereSums<N>&) {}

}  // namespace tangere::kernels
