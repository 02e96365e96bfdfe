// SPDX-License-Identifier: Apache-2.0
// Pullback of the shear update of a step. From cotangents f̄ of forces, x̄ of their points of
// application and s̄' of the shear state after the step, with B the friction bound divided by μ and
// t = w/|w|:
//   stick: w̄ = -f̄, s̄ = s̄'
//   slip:  B̄ = -μ t·f̄ + (s·s̄') μ/|w|,  w̄ = -λ (f̄ - t (t·f̄)) - (s·s̄') λ t/|w|,  s̄ = λ s̄'
//          μ̄ = B (-t·f̄ + s·s̄'/|w|)
//   s̄ += k_s w̄,  v̄_t = k_t w̄,  k̄_s = s·w̄,  k̄_t = v_t·w̄
//   d̄ += β'_d (P r)·s̄,  ḡ = d/(d - g)² (P r)·s̄,  s̄₀ = β s̄
//   r̄ = P s̄₀,  n̄ -= η s̄₀ + r (n·s̄₀),  b̄ = r̄,  ρ̄ -= r̄,  θ̄ -= A × r̄,  ā = -Qᵀ r̄
// and the rest as in kernels/reverse/point_pullback.hpp.
#pragma once

#include "kernels/reverse/tactile_pullback.hpp"
#include "kernels/shear/update_shear_state.hpp"

namespace tangere::kernels {

/// Cotangents of w, s and the bound of one point, and shares of its coefficients.
template <class N>
struct SpringCotangent {
  Vec3<N> w, s;
  N bound;
  Coefficients<N> law;
};
template <class N>
SpringCotangent<N> pull_back_spring(const LawParameters<N>& law, const ElasticPoint<N>& p,
                                    const Vec3<N>& f_bar, const Vec3<N>& s_bar) {
  const Vec3<N> t = p.inverse_w * p.w;  // zero where the point sticks
  const N along = dot(t, f_bar), kept = dot(p.s, s_bar) * p.inverse_w;
  SpringCotangent<N> o;
  o.bound = law.mu * (kept - along);
  o.w = (-p.hold) * mul_add(kept - along, t, f_bar);
  o.s = mul_add(law.ks, o.w, p.hold * s_bar);
  o.law = {N(0.0), dot(p.vt, o.w), p.normal.bound * (kept - along), N(0.0), dot(p.s, o.w)};
  pull_back_normal_force(law, p.d, p.rate, p.normal, dot(p.n, f_bar), o.bound, o.law);
  return o;
}

/// Cotangents of an anchor, with those of d and n that come with them.
template <class N>
struct AnchorCotangent {
  Anchor<N> anchor;
  Vec3<N> r, n;
  N d;
};
template <class N>
AnchorCotangent<N> pull_back_anchor(const LoadedTouch<N>& t, const ElasticPoint<N>& p,
                                    const Anchor<N>& anchor, const Vec3<N>& s_bar) {
  const N zero(0.0), one(1.0);
  const N along_s = dot(mul_add(-p.eta, p.n, p.r), s_bar);
  const N inverse = one / select(p.d < zero, p.d - anchor.gap, -one);
  const Vec3<N> s0 = p.beta * s_bar;
  const N along_n = dot(p.n, s0);
  AnchorCotangent<N> o;
  o.d = p.beta_d * along_s;
  o.r = mul_add(-along_n, p.n, s0);
  o.n = -(p.eta * s0 + along_n * p.r);
  o.anchor = {o.r, -transposed_times(t.Q, o.r), p.d * inverse * inverse * along_s};
  return o;
}

/// Cotangents of a point's own place and coefficients.
template <class N>
struct OwnCotangent {
  Vec3<N> xi;
  Coefficients<N> law;
};
/// Adds eight points. A point's ks keeps its ratio to kt.
template <class A>
void add_own(const OwnCotangent<Lanes<A>>& own, const Coefficients<double>& sensor_law,
             double* rows, int stride) {
  using N = Lanes<A>;
  const N ratio(sensor_law.kt == 0 ? 0 : sensor_law.ks / sensor_law.kt);
  const N numbers[kPointNumbers] = {
      own.xi.x,   own.xi.y,       own.xi.z, own.law.kn, mul_add(ratio, own.law.ks, own.law.kt),
      own.law.mu, own.law.damping};
  for (int i = 0; i < kPointNumbers; ++i)
    store_lanes(load_lanes<A>(rows + i * stride) + numbers[i], rows + i * stride);
}

/// Reverses one point at the end of a step: adds to motion and coefficients, and returns the
/// cotangent of its anchor. f̄ and s̄' are zero where nothing touches. x̄ is of where the force acts.
/// `law` is that of the point, `scale` times that of its contact. `own`: ξ̄ is added to, its law is
/// set.
template <class Shape, class N>
Anchor<N> pull_back_elastic(const LoadedTouch<N>& t, const LawParameters<N>& law,
                            const Coefficients<N>& scale, const ElasticPoint<N>& p,
                            const Vec3<N>& xi, const Anchor<N>& anchor, const Vec3<N>& f_bar,
                            const Vec3<N>& x_bar, const Vec3<N>& s_bar, TouchCotangent<N>& out,
                            OwnCotangent<N>& own) {
  const SpringCotangent<N> spring = pull_back_spring(law, p, f_bar, s_bar);
  const AnchorCotangent<N> of = pull_back_anchor(t, p, anchor, spring.s);
  own.law = spring.law;
  for (std::size_t i = 0; i < kCoefficients; ++i)
    out.law[i] = mul_add(scale[i], spring.law[i], out.law[i]);
  const Vec3<N> slide = law.kt * spring.w;
  const N along_n = dot(p.n, f_bar);
  const N rate =
      mul_add(p.normal.rate_slope, along_n, p.normal.bound_rate * spring.bound) - dot(p.n, slide);
  const Vec3<N> u = mul_add(rate, p.n, slide);
  const N d = mul_add(p.normal.d_slope, along_n, p.normal.bound_d * spring.bound) + of.d;
  const Vec3<N> n =
      mul_add(p.normal.force, f_bar, mul_add(-p.rate, slide, mul_add(rate, p.u, of.n)));
  out.twist.a += cross(u, p.x2);
  out.twist.l -= u;
  out.displacement.l -= of.r;
  out.displacement.a -= cross(p.x2 - p.arm, of.r);
  own.xi +=
      pull_back_touch_point<Shape>(t, p, xi, d, n, cross(t.omega, u) + x_bar, out.displacement);
  return of.anchor;
}

template <class A>
void pull_back_memory(const ShearPullback& m) {
  using N = Lanes<A>;
  const LoadedTouch<N> start = loaded<N>(*m.start), end = loaded<N>(*m.end);
  const int stride = m.points.stride;
  const N zero(0.0), one(1.0);
  Vec6<N> y = zero6<N>(), start_bar = zero6<N>();
  if (m.slip != nullptr) y = {broadcast<N>(m.slip->a), broadcast<N>(m.slip->l)};
  TouchCotangent<N> end_bar;
  end_bar.displacement = end_bar.twist = zero6<N>();
  end_bar.law = {zero, zero, zero, zero, zero};
  end_bar.size = zero3<N>();
  with_shape<N>(*m.end, [&]<class Shape>(const Shape& shape) {
    for (int k = 0; k < m.points.count; k += kGroup) {
      const Vec3<N> xi = load3<A>(m.points.places, stride, k);
      const Anchor<N> anchor = load_anchors<A>(m.points, k);
      const LawParameters<N> law = law_at<A>(end, m.points, k);
      const ElasticPoint<N> p = meet_elastic(shape, end, law, xi, anchor);
      const auto touching = p.d < zero;
      if (!any(touching)) continue;
      const N gate = select(touching, one, zero);
      Vec3<N> f_bar = zero3<N>(), x_bar = zero3<N>(), s_bar = zero3<N>();
      OwnCotangent<N> own;
      own.xi = zero3<N>();
      if (m.s_bar != nullptr) s_bar = gate * load3<A>(m.s_bar, stride, k);
      if (m.f_bar != nullptr) f_bar = gate * load3<A>(m.f_bar, stride, k);
      if (m.anchor_bar != nullptr) {
        const Anchor<N> after = {gate * load3<A>(m.anchor_bar, stride, k),
                                 gate * load3<A>(m.anchor_bar + 3 * stride, stride, k), zero};
        s_bar +=
            pull_back_recall(shape, end, xi, p.hold * p.s, after, end_bar.displacement, own.xi);
      }
      if (m.slip != nullptr) {
        f_bar = (-gate) * (y.l + cross(y.a, p.x2));
        x_bar = cross(y.a, p.force);
      }
      Anchor<N> bar = pull_back_elastic<Shape>(end, law, coefficient_scales<A>(m.points, k), p, xi,
                                               anchor, f_bar, x_bar, s_bar, end_bar, own);
      if (m.kept != nullptr) {
        const N kept = load_lanes<A>(m.kept + k), found = one - kept;
        store3(kept * bar.b, m.anchor_out, stride, k);
        store3(kept * bar.a, m.anchor_out + 3 * stride, stride, k);
        bar = {found * bar.b, found * bar.a, found * bar.gap};
      }
      const Vec3<N> s = pull_back_recall(shape, start, xi, load3<A>(m.s_start, stride, k), bar,
                                         start_bar, own.xi);
      if (m.own != nullptr) add_own<A>(own, m.end->law, m.own + k, stride);
      store3(load3<A>(m.s_out, stride, k) + s, m.s_out, stride, k);
    }
  });
  const N* from = &end_bar.displacement.a.x;
  double* to = &m.out->end.displacement.a.x;
  for (std::size_t i = 0; i < sizeof(TouchCotangent<double>) / sizeof(double); ++i)
    to[i] += lane_sum(from[i]);
  const N* begin = &start_bar.a.x;
  double* by = &m.out->start.a.x;
  for (int i = 0; i < 6; ++i) by[i] += lane_sum(begin[i]);
}

}  // namespace tangere::kernels
