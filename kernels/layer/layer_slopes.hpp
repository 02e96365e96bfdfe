// SPDX-License-Identifier: Apache-2.0
// Derivatives of the force at a point (kernels/layer/layer_force.hpp) by the motion of the shape:
// its displacement (θ; ρ) and the change of its twist, pad axes at the pad's origin. With the slope
// δn = n_ρ ρ₂ + n_θ θ of the normal at a fixed place x, ρ₂ = ρ + θ × x
// (kernels/contact/pair_contact.hpp), and φ = -n·o
//   δ̇ = slant·ρ₂;  an underside moves by -δ̇ o, so that δn gains n_ρ o δ̇, and
//   δslant = δn/φ + n (δn·o)/φ²;   else δslant = c δn
//   depth = δ + r(δ) slant·u,  u = v + ω × x
#pragma once

#include "kernels/layer/contact_depth.hpp"
#include "kernels/layer/layer_force.hpp"

namespace tangere::kernels {

/// Derivatives of a vector by a turn θ and a shift ρ, or by the parts of a twist.
template <class N>
struct Slopes {
  Mat3<N> turn, shift;
};
template <class N>
Slopes<N> operator+(const Slopes<N>& a, const Slopes<N>& b) {
  return {a.turn + b.turn, a.shift + b.shift};
}
template <class N>
Slopes<N> operator-(const Slopes<N>& a, const Slopes<N>& b) {
  return {a.turn - b.turn, a.shift - b.shift};
}
template <class N>
Slopes<N> operator*(const N& s, const Slopes<N>& a) {
  return {s * a.turn, s * a.shift};
}
template <class N>
Slopes<N> operator*(const Mat3<N>& m, const Slopes<N>& a) {
  return {m * a.turn, m * a.shift};
}
/// Returns a rᵀ for a row r.
template <class N>
Slopes<N> outer_slopes(const Vec3<N>& a, const Vec6<N>& r) {
  return {outer(a, r.a), outer(a, r.l)};
}
/// Returns the row bᵀ M.
template <class N>
Vec6<N> row_of(const Vec3<N>& b, const Slopes<N>& m) {
  return {transposed_times(m.turn, b), transposed_times(m.shift, b)};
}
/// Returns M by (ρ₂, θ) as one by (θ, ρ): ρ₂ = ρ - [x] θ.
template <class N>
Slopes<N> about_origin(const Mat3<N>& rho_slope, const Mat3<N>& theta_slope, const Vec3<N>& x) {
  return {theta_slope - times_skew(rho_slope, x), rho_slope};
}
template <class N>
Slopes<N> selected(const auto& mask, const Slopes<N>& a, const Slopes<N>& b) {
  Slopes<N> out;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) {
      out.turn.m[i][j] = select(mask, a.turn.m[i][j], b.turn.m[i][j]);
      out.shift.m[i][j] = select(mask, a.shift.m[i][j], b.shift.m[i][j]);
    }
  return out;
}

template <class N>
struct LayerSlopes {
  Vec6<N> depth, depth_by_twist;  ///< rows
  Slopes<N> slant, place, friction, friction_by_twist;
};

/// Returns the slopes of the normal at a place by the shape's motion. Outside, edges are round.
template <class Shape, class N>
Slopes<N> normal_slopes(const Shape& shape, const Touch<N>& t, const Vec3<N>& place, Mat3<N>& n_rho,
                        Vec3<N>& n) {
  const Vec3<N> y = transposed_times(t.Q, place - t.c);
  Mat3<N> hessian;
  Distance<N> at;
  if constexpr (Shape::kBending == Bending::general) {
    at = shape.evaluate(y, hessian);
  } else {
    at = distance_at(shape, y);
    hessian = shape.hessian(y);
  }
  n = t.Q * at.n;
  const Mat3<N> H = t.Q * hessian * transpose(t.Q), turned = times_skew(H, n), turn = skew(n);
  n_rho = -H;
  Mat3<N> n_theta;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) n_theta.m[i][j] = mul_add(at.d, turned.m[i][j], -turn.m[i][j]);
  return about_origin(n_rho, n_theta, place - at.d * n);
}

/// Computes the slopes of depth, slant and place.
template <class Shape, class N>
void depth_slopes(const Shape& shape, const Touch<N>& t, const LayerLaw& law,
                  const LayerPoint<N>& p, LayerSlopes<N>& out) {
  const N zero(0.0), one(1.0);
  const auto under = p.by < N(0.5);
  const auto sideways = (p.by > N(1.5)) & (p.by < N(2.5));
  Mat3<N> n_rho;
  Vec3<N> n;
  const Slopes<N> normal = normal_slopes(shape, t, p.at.place, n_rho, n);
  const Vec3<N> o = {zero, zero, N(law.outward)};
  const Vec6<N> shallow = {cross(p.at.place, p.at.slant), p.at.slant};  // of δ
  const N inverse = one / select(under, -dot(n, o), one);
  const Slopes<N> moving = normal + outer_slopes(n_rho * o, shallow);
  const Slopes<N> underside = (diagonal(inverse) + outer((inverse * inverse) * n, o)) * moving;
  out.slant = selected(under, underside, select(sideways, N(kSteepest), one) * normal);
  out.place = select(under, -one, zero) * outer_slopes(o, shallow);
  const N r = fading_relaxation(law, p.known);
  const auto fades = (p.known > zero) & (p.known < N(law.fading));
  const Vec3<N> u = t.v + cross(t.omega, p.at.place);
  const N whole = one + select(fades, N(law.relaxation / law.fading), zero) * dot(p.at.slant, u);
  out.depth =
      whole * shallow + r * (row_of(u, out.slant) + row_of(cross(p.at.slant, t.omega), out.place));
  out.depth_by_twist = r * shallow;
}

/// Slopes of a spring's force by displacement and twist.
template <class N>
struct SpringSlopes {
  Slopes<N> motion, twist;
};
template <class Shape, class N, class Point>
SpringSlopes<N> spring_slopes(const LawParameters<N>& law, const Point& p, const Vec3<N>& omega,
                              bool elastic) {
  PointDerivative<N> r = differentiate<Shape>(law, p, omega);
  if (elastic) differentiate_spring<Shape>(law, p, r);
  return {about_origin(r.f_rho, r.f_theta, p.x2), {times_skew(r.f_u, p.x2), -r.f_u}};
}

/// Computes the slopes of friction where p.normal > 0. With f = N n + T and its normal part
/// f₀ = N n, δ(T/N) = (δf - δf₀)/N - T (n·δf₀)/N².
template <class Shape, class N>
void friction_slopes(const Shape& shape, const LayerShape& of, const Touch<N>& t,
                     const LayerPoint<N>& point, LayerSlopes<N>& out) {
  const N zero(0.0), one(1.0);
  LawParameters<N> law = {t.law, of.law, of.ramp};
  law.friction_tangent = N(of.secant ? 0.0 : 1.0);
  ElasticPoint<N> p;
  find_place(shape, t.Q, t.c, point.xi, p);
  find_motion(law, t.omega, t.v, p);
  ElasticPoint<N> smooth = p;
  smooth.tangential = {zero, zero, zero3<N>()};
  if (of.elastic)
    add_spring(law, t.Q, t.c, point.anchor, p);
  else
    p.tangential = friction(law, p.normal, p.vt);
  const Vec3<N> held = of.elastic ? p.hold * p.w : p.tangential.scale * p.vt;
  const SpringSlopes<N> whole = spring_slopes<Shape>(law, p, t.omega, of.elastic),
                        normal = spring_slopes<Shape>(law, smooth, t.omega, false);
  const auto acting = point.normal > zero;
  const N inverse = select(acting, one, zero) / select(acting, point.normal, one);
  const Vec3<N> q = -inverse * held, &s = point.at.slant;
  const N square = one / dot(s, s), along = dot(s, q) * square;
  // T/N, then its part across the slant.
  const auto ratio = [&](const Slopes<N>& f, const Slopes<N>& f0) {
    return inverse * (f - f0 - outer_slopes(q, row_of(p.n, f0)));
  };
  const Slopes<N> motion = ratio(whole.motion, normal.motion),
                  twist = ratio(whole.twist, normal.twist);
  const Vec6<N> along_motion = row_of(s, motion) + row_of(q - (N(2.0) * along) * s, out.slant);
  out.friction = motion - outer_slopes(square * s, along_motion) - along * out.slant;
  out.friction_by_twist = twist - outer_slopes(square * s, row_of(s, twist));
}

}  // namespace tangere::kernels
