// SPDX-License-Identifier: Apache-2.0
// Anchors from an accepted state and its shear state s (zero at points that do not touch). With x,
// n, d the place, normal and distance at that state and G = (Q, c):
//   b = x,  a = Qᵀ(x - s - c),  g = max(d, 0)
// Reverse, with y = Q ā: x̄ = b̄ + y, s̄ = -y, ρ̄ -= y, θ̄ -= (x - s) × y, d̄ = ḡ where d ≥ 0, and
// on through x, n and d:
//   a pair, x = ξ - d n:       d̄ -= n·x̄, n̄ -= d x̄;  ρ̄ -= d̄ n + H n̄, θ̄ += x × ρ̄ + n × (I - dH) n̄
//   the ground, x = ξ_c - r n: n̄ -= r x̄;            ρ̄ -= d̄ n,       θ̄ += ξ_c × ρ̄ + n × n̄
// Moving the point is moving the shape the other way, then both: ξ̄ = x̄ - ρ̄.
#pragma once

#include "kernels/reverse/point_pullback.hpp"
#include "kernels/shear/shear_types.hpp"
#include "kernels/step/faces.hpp"

namespace tangere::kernels {

/// The same for eight points.
template <class N>
struct LoadedTouch {
  Mat3<N> Q;
  Vec3<N> c, omega, v;
  LawParameters<N> law;
  N radius;
  bool ground;
};
template <class N>
LoadedTouch<N> loaded(const ShearSpringTouch& t) {
  const auto spread = [](const double& a) { return N(a); };
  return {broadcast<N>(t.shape.R),
          broadcast<N>(t.shape.p),
          broadcast<N>(t.twist.a),
          broadcast<N>(t.twist.l),
          {transformed(t.law, spread), t.of->contact.law, t.of->contact.ramp},
          N(t.radius),
          t.of->ground};
}

/// Calls f with the touched shape. The ground is a plane.
template <class N, class F>
void with_shape(const ShearSpringTouch& t, const F& f) {
  with_touched<N>(t.of->contact, broadcast<N>(t.size), broadcast<N>(t.faces), f);
}

/// The same as find_place() where a point touches. Elsewhere it takes the nearest face without
/// rounding its edges, so that H has the form of the inside for points that have not landed, too.
template <class Shape, class N>
[[gnu::always_inline]] inline void find_face_place(const Shape& shape, const LoadedTouch<N>& t,
                                                   const Vec3<N>& xi, PointContact<N>& p) {
  const Distance<N> at = shape.inside(transposed_times(t.Q, xi - t.c), p.curvature);
  p.d = at.d;
  p.n = t.Q * at.n;
  if constexpr (Shape::kBending == Bending::rod) p.axis = {t.Q.m[0][2], t.Q.m[1][2], t.Q.m[2][2]};
  p.x2 = xi - p.d * p.n;
}

/// Computes distance, normal and the place where the force acts of a point at ξ.
template <class Shape, class N>
[[gnu::always_inline]] inline void find_place(const Shape& shape, const LoadedTouch<N>& t,
                                              const Vec3<N>& xi, PointContact<N>& p) {
  if (!t.ground) {
    if constexpr (Shape::kSums == PointSumForm::faces) {
      find_face_place(shape, t, xi, p);
    } else {
      find_place(shape, t.Q, t.c, xi, p);
    }
    return;
  }
  p.n = {t.Q.m[0][2], t.Q.m[1][2], t.Q.m[2][2]};
  const N height = dot(p.n, xi - t.c);
  const N reach(kPlaneReach);  // padding lies beyond it
  p.d = select(dot(xi, xi) < reach * reach, height - t.radius, reach);
  p.x2 = xi - t.radius * p.n;
  p.curvature = N(0.0);
}

/// Pulls cotangents of d, n and x back to (θ; ρ) of body 2 and adds them. Returns ξ̄.
template <class Shape, class N>
Vec3<N> pull_back_touch_point(const LoadedTouch<N>& t, const PointContact<N>& p, const Vec3<N>& xi,
                              N d, Vec3<N> n, const Vec3<N>& x, Vec6<N>& out) {
  if (t.ground) {
    n -= t.radius * x;
    const Vec3<N> rho = -d * p.n;
    out.l += rho;
    out.a += cross(xi, rho) + cross(p.n, n);
    return x - rho;
  }
  d = d - dot(p.n, x);
  n -= p.d * x;
  Vec3<N> rho = -d * p.n, turned = n;
  if constexpr (Shape::kBending != Bending::flat) {
    const Vec3<N> bent = bend<Shape>(p, n);
    rho -= bent;
    turned = mul_add(-p.d, bent, turned);
  }
  out.l += rho;
  out.a += cross(p.x2, rho) + cross(p.n, turned);
  return x - rho;
}

template <class N>
Vec3<N> s_of(const PointContact<N>& p, const Vec3<N>& s_start) {
  return select(p.d < N(0.0), s_start, zero3<N>());
}

template <class Shape, class N>
Anchor<N> recalled(const Shape& shape, const LoadedTouch<N>& t, const Vec3<N>& xi,
                   const Vec3<N>& s_start) {
  PointContact<N> p;
  find_place(shape, t, xi, p);
  const Vec3<N> s = s_of(p, s_start);
  return {p.x2, transposed_times(t.Q, p.x2 - s - t.c), max(p.d, N(0.0))};
}

/// Adds to (θ; ρ) of body 2 and to ξ̄, and returns s̄.
template <class Shape, class N>
Vec3<N> pull_back_recall(const Shape& shape, const LoadedTouch<N>& t, const Vec3<N>& xi,
                         const Vec3<N>& s_start, const Anchor<N>& bar, Vec6<N>& out,
                         Vec3<N>& xi_bar) {
  const N zero(0.0);
  PointContact<N> p;
  find_place(shape, t, xi, p);
  const Vec3<N> y = t.Q * bar.a, at = p.x2 - s_of(p, s_start);
  out.l -= y;
  out.a -= cross(at, y);
  xi_bar += pull_back_touch_point<Shape>(t, p, xi, select(p.d > zero, bar.gap, zero), zero3<N>(),
                                         bar.b + y, out);
  return select(p.d < zero, -y, zero3<N>());
}

template <class A>
Vec3<Lanes<A>> load3(const double* rows, int stride, int k) {
  return {load_lanes<A>(rows + k), load_lanes<A>(rows + stride + k),
          load_lanes<A>(rows + 2 * stride + k)};
}
template <class A>
void store3(const Vec3<Lanes<A>>& x, double* rows, int stride, int k) {
  store_lanes(x.x, rows + k), store_lanes(x.y, rows + stride + k);
  store_lanes(x.z, rows + 2 * stride + k);
}
template <class A>
Anchor<Lanes<A>> load_anchors(const ShearSpringPoints& points, int k) {
  return load_anchor<Lanes<A>>(
      [&](int i) { return load_lanes<A>(points.anchors + i * points.stride + k); });
}

/// Converts the elastic displacements s, in rows 3 to 5 of the anchors, to anchors a.
template <class A>
void recall(const ShearSpringTouch& touch, const ShearSpringPoints& points) {
  using N = Lanes<A>;
  const LoadedTouch<N> t = loaded<N>(touch);
  with_shape<N>(touch, [&](const auto& shape) {
    double* const anchors = points.anchors;
    const int stride = points.stride;
    for (int k = 0; k < points.count; k += kGroup) {
      const Anchor<N> x = recalled(shape, t, load3<A>(points.places, stride, k),
                                   load3<A>(anchors + 3 * stride, stride, k));
      store3(x.b, anchors, stride, k);
      store3(x.a, anchors + 3 * stride, stride, k);
      store_lanes(x.gap, anchors + 6 * stride + k);
    }
  });
}

}  // namespace tangere::kernels
