// SPDX-License-Identifier: Apache-2.0
// Derivatives of the force at a point (engine/layer/layer_force.hpp) by the motion of the shape:
// its displacement (θ; ρ) and the change of its twist, pad axes at the pad's origin. With the slope
// δn = n_ρ ρ₂ + n_θ θ of the normal at a fixed place x, ρ₂ = ρ + θ × x
// (kernels/contact/pair_contact.hpp), and φ = -n·o
//   δ̇ = slant·ρ₂;  an underside moves by -δ̇ o, so that δn gains n_ρ o δ̇, and
//   δslant = δn/φ + n (δn·o)/φ²;   else δslant = c δn
//   depth = δ + r(δ) slant·u,  u = v + ω × x
#pragma once

#include "engine/layer/layer_force.hpp"

namespace tangere {

/// Derivatives of a vector by a turn θ and a shift ρ, or by the parts of a twist.
struct Slopes {
  kernels::Mat3<double> turn, shift;
};

/// Column k of six.
inline kernels::Vec3<double> column(const Slopes& m, int k) {
  const kernels::Mat3<double>& of = k < 3 ? m.turn : m.shift;
  return {of.m[0][k % 3], of.m[1][k % 3], of.m[2][k % 3]};
}
inline Slopes operator+(const Slopes& a, const Slopes& b) {
  return {a.turn + b.turn, a.shift + b.shift};
}
inline Slopes operator*(double s, const Slopes& a) { return {s * a.turn, s * a.shift}; }
inline Slopes operator*(const kernels::Mat3<double>& m, const Slopes& a) {
  return {m * a.turn, m * a.shift};
}
/// Returns a rᵀ for a row r.
inline Slopes outer(const kernels::Vec3<double>& a, const kernels::Vec6<double>& r) {
  return {kernels::outer(a, r.a), kernels::outer(a, r.l)};
}
/// Returns the row bᵀ M.
inline kernels::Vec6<double> row(const kernels::Vec3<double>& b, const Slopes& m) {
  return {transposed_times(m.turn, b), transposed_times(m.shift, b)};
}

struct LayerSlopes {
  kernels::Vec6<double> depth, depth_by_twist;  ///< rows
  Slopes slant, place, friction, friction_by_twist;
};

/// Returns M by (ρ₂, θ) as one by (θ, ρ): ρ₂ = ρ - [x] θ.
inline Slopes about_origin(const kernels::Mat3<double>& rho_slope,
                           const kernels::Mat3<double>& theta_slope,
                           const kernels::Vec3<double>& x) {
  return {theta_slope - times_skew(rho_slope, x), rho_slope};
}

/// Computes the slopes of depth, slant and place.
template <class Shape>
void depth_slopes(const Shape& shape, const kernels::Touch<double>& t, const CompiledLayer& layer,
                  const KnownDepth& known, const LayerDepth<double>& at, LayerSlopes& out) {
  const kernels::Mat3<double> one = kernels::diagonal(1.0), none = kernels::zero33<double>();
  kernels::PointContact<double> g;
  kernels::find_place(shape, t.Q, t.c, at.place, g);
  kernels::Mat3<double> n_rho, n_theta;
  kernels::differentiate_normal<Shape>(g, one - kernels::outer(g.n, g.n), n_rho, n_theta);
  Slopes normal = about_origin(n_rho, n_theta, g.x2);
  const kernels::Vec6<double> shallow = {cross(at.place, at.slant), at.slant};  // of δ
  out.place = {none, none};
  if (known.by == DepthBy::underside) {
    const kernels::Vec3<double> o = {0, 0, double(layer.outward)};
    const double inverse = 1 / -dot(g.n, o);
    normal = normal + outer(n_rho * o, shallow);
    out.slant = (inverse * one + kernels::outer((inverse * inverse) * g.n, o)) * normal;
    out.place = -1.0 * outer(o, shallow);
  } else {
    out.slant = (known.by == DepthBy::side ? kSteepest : 1.0) * normal;
  }
  const double r = relaxation_at(layer, known.depth), fading = kFading * layer.grid.thickness;
  const bool fades = known.depth > 0 && known.depth < fading;
  const kernels::Vec3<double> u = t.v + cross(t.omega, at.place);
  const double rate = dot(at.slant, u), whole = 1 + (fades ? layer.relaxation / fading * rate : 0);
  out.depth = whole * shallow + r * (row(u, out.slant) + row(cross(at.slant, t.omega), out.place));
  out.depth_by_twist = r * shallow;
}

/// Slopes of a spring's force by displacement and twist.
struct SpringSlopes {
  Slopes motion, twist;
};
template <class Shape, class Point>
SpringSlopes spring_slopes(const kernels::LawParameters<double>& law, const Point& p,
                           const kernels::Vec3<double>& omega, bool elastic) {
  kernels::PointDerivative<double> r = kernels::differentiate<Shape>(law, p, omega);
  if (elastic) kernels::differentiate_spring<Shape>(law, p, r);
  return {about_origin(r.f_rho, r.f_theta, p.x2), {times_skew(r.f_u, p.x2), -1.0 * r.f_u}};
}

/// Computes the slopes of friction. With f = N n + T and its normal part f₀ = N n,
/// δ(T/N) = (δf - δf₀)/N - T (n·δf₀)/N².
template <class Shape>
void friction_slopes(const Shape& shape, const LayerShape& of, const kernels::Touch<double>& t,
                     const kernels::Vec3<double>& xi, const kernels::Anchor<double>& anchor,
                     const LayerForce<double>& force, LayerSlopes& out) {
  kernels::LawParameters<double> law = {t.law, of.law, of.ramp};
  law.friction_tangent = of.secant ? 0 : 1;
  kernels::ElasticPoint<double> p;
  kernels::find_place(shape, t.Q, t.c, xi, p);
  kernels::find_motion(law, t.omega, t.v, p);
  kernels::ElasticPoint<double> smooth = p;
  smooth.tangential = {0, 0, {0, 0, 0}};
  if (of.elastic)
    kernels::add_spring(law, t.Q, t.c, anchor, p);
  else
    p.tangential = kernels::friction(law, p.normal, p.vt);
  const kernels::Vec3<double> held = of.elastic ? p.hold * p.w : p.tangential.scale * p.vt;
  const SpringSlopes whole = spring_slopes<Shape>(law, p, t.omega, of.elastic),
                     normal = spring_slopes<Shape>(law, smooth, t.omega, false);
  const double inverse = 1 / force.normal;
  const kernels::Vec3<double> q = -inverse * held, &s = force.at.slant;
  const double square = dot(s, s), along = dot(s, q);
  // T/N, then its part across the slant.
  const auto across = [&](const Slopes& f, const Slopes& f0, const Slopes* slant) {
    const Slopes by = inverse * (f + -1.0 * f0 + -1.0 * outer(q, row(p.n, f0)));
    kernels::Vec6<double> along_dot = row(s, by);
    if (slant != nullptr) along_dot += row(q - (2 * along / square) * s, *slant);
    Slopes out_by = by + (-1 / square) * outer(s, along_dot);
    if (slant != nullptr) out_by = out_by + (-along / square) * *slant;
    return out_by;
  };
  out.friction = across(whole.motion, normal.motion, &out.slant);
  out.friction_by_twist = across(whole.twist, normal.twist, nullptr);
}

/// Returns the slopes of the force at a point inside the shape. Outside, where edges are round,
/// normals have no slopes of this form.
template <class Shape>
LayerSlopes layer_slopes(const Shape& shape, const LayerShape& of, const kernels::Touch<double>& t,
                         const kernels::Vec3<double>& xi, const CompiledLayer& layer,
                         const KnownDepth& known, const kernels::Anchor<double>& anchor,
                         const LayerForce<double>& force) {
  LayerSlopes out;
  depth_slopes(shape, t, layer, known, force.at, out);
  const kernels::Mat3<double> none = kernels::zero33<double>();
  out.friction = out.friction_by_twist = {none, none};
  if (force.normal > 0) friction_slopes(shape, of, t, xi, anchor, force, out);
  return out;
}

}  // namespace tangere
