// SPDX-License-Identifier: Apache-2.0
// Shear state after an accepted step, s' = λ s at the touching points, and the forces there.
#pragma once

#include "kernels/shear/anchors_from_state.hpp"

namespace tangere::kernels {

/// Returns by what the coefficients of eight points are multiplied: factors of their own, or areas.
template <class A>
Coefficients<Lanes<A>> coefficient_scales(const ShearSpringPoints& points, int k) {
  Coefficients<Lanes<A>> scale;
  for (std::size_t i = 0; i < kCoefficients; ++i) {
    scale[i] = Lanes<A>(1.0);
    if (points.factors != nullptr)
      scale[i] = load_lanes<A>(points.factors + int(factor_index(i)) * points.stride + k);
    if (points.weights != nullptr && scales_with_area(i))
      scale[i] = load_lanes<A>(points.weights + k);
  }
  return scale;
}

/// The law of eight points.
template <class A>
LawParameters<Lanes<A>> law_at(const LoadedTouch<Lanes<A>>& t, const ShearSpringPoints& points,
                               int k) {
  LawParameters<Lanes<A>> law = t.law;
  if (points.factors == nullptr && points.weights == nullptr) return law;
  const Coefficients<Lanes<A>> scale = coefficient_scales<A>(points, k);
  for (std::size_t i = 0; i < kCoefficients; ++i) law[i] = law[i] * scale[i];
  return law;
}

template <class Shape, class N>
ElasticPoint<N> meet_elastic(const Shape& shape, const LoadedTouch<N>& t,
                             const LawParameters<N>& law, const Vec3<N>& xi,
                             const Anchor<N>& anchor) {
  ElasticPoint<N> p;
  find_place(shape, t, xi, p);
  find_motion(law, t.omega, t.v, p);
  add_spring(law, t.Q, t.c, anchor, p);
  return p;
}

/// Computes s' and the forces at the end of a step. `s`: (4, stride) out: s' in body 1's axes, then
/// 1 at points that touch, else 0. `force`: (3, stride) out, on body 1, its axes; or null.
template <class A>
void advance(const ShearSpringTouch& end, const ShearSpringPoints& points, double* s,
             double* force) {
  using N = Lanes<A>;
  const LoadedTouch<N> t = loaded<N>(end);
  with_shape<N>(end, [&](const auto& shape) {
    const int stride = points.stride;
    for (int k = 0; k < points.count; k += kGroup) {
      ElasticPoint<N> p;
      find_place(shape, t, load3<A>(points.places, stride, k), p);
      const N touches = select(p.d < N(0.0), N(1.0), N(0.0));
      if (!any(p.d < N(0.0))) {
        store_lanes(touches, s + 3 * stride + k);
        if (force != nullptr) store3(zero3<N>(), force, stride, k);
        continue;
      }
      const LawParameters<N> law = law_at<A>(t, points, k);
      find_motion(law, t.omega, t.v, p);
      add_spring(law, t.Q, t.c, load_anchors<A>(points, k), p);
      store3((touches * p.hold) * p.s, s, stride, k);
      store_lanes(touches, s + 3 * stride + k);
      if (force != nullptr) store3(p.force, force, stride, k);
    }
  });
}

/// Computes the entries at the end of a step, with anchors that are given or found here. Points go
/// through it four vectors at a time, pass by pass, so that the latencies of different points
/// overlap.
template <class A>
void advance_entries(ShearUpdate& u) {
  using N = Lanes<A>;
  constexpr int kVectors = 4;
  struct Pass {
    N d;
    Vec3<N> n, x2, s;
    Anchor<N> anchor;
    N square, limit;
    unsigned touching;
  } passes[kVectors];
  const ShearSpringPoints& points = u.points;
  const LoadedTouch<N> end = loaded<N>(*u.end);
  LoadedTouch<N> start;
  if (u.start != nullptr) start = loaded<N>(*u.start);
  const bool own_law = points.factors != nullptr || points.weights != nullptr;
  with_shape<N>(*u.end, [&](const auto& shape) {
    for (int chunk = 0; chunk < points.count; chunk += kVectors * kGroup) {
      const auto each = [&](const auto& f) {
        for (int i = 0; i < kVectors && chunk + i * kGroup < points.count; ++i)
          f(chunk + i * kGroup, passes[i]);
      };
      const auto numbers = [&](int k) { return PointNumbers{u.end->of->first, u.index + k}; };
      const auto place = [&](int k) { return load3<A>(points.places, points.stride, k); };
      each([&](int k, Pass& pass) {
        PointContact<N> p;
        find_place(shape, end, place(k), p);
        pass.touching = lane_bits(p.d < N(0.0));
        pass.d = p.d, pass.n = p.n, pass.x2 = p.x2;
      });
      if (u.start != nullptr)
        each([&](int k, Pass& pass) {
          if (pass.touching != 0) pass.s = read_entries<A>(numbers(k), points.count - k, u.before);
        });
      each([&](int k, Pass& pass) {
        if (pass.touching == 0) return;
        pass.anchor = u.start == nullptr ? load_anchors<A>(points, k)
                                         : recalled(shape, start, place(k), pass.s);
      });
      each([&](int k, Pass& pass) {
        if (pass.touching == 0) return;
        LawParameters<N> own;
        if (own_law) own = law_at<A>(end, points, k);
        const LawParameters<N>& law = own_law ? own : end.law;
        const Anchor<N>& anchor = pass.anchor;
        PointContact<N> p;
        p.d = pass.d, p.n = pass.n, p.x2 = pass.x2;
        find_motion(law, end.omega, end.v, p);
        const Spring<N> spring = stretched(law.ks, law.kt, p.d, p.n, p.vt,
                                           anchor.b - (end.c + end.Q * anchor.a), anchor.gap);
        pass.s = spring.s;
        pass.square = spring.square;
        pass.limit = law.mu * p.normal.bound;
      });
      each([&](int, Pass& pass) {
        if (pass.touching != 0)
          pass.s = held(pass.square, inverse_sqrt(pass.square), pass.limit) * pass.s;
      });
      each([&](int k, const Pass& pass) {
        if (pass.touching != 0)
          u.after = write_entries<A>(numbers(k), pass.s, pass.touching, u.after);
      });
    }
  });
}

}  // namespace tangere::kernels
