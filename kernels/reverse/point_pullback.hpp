// SPDX-License-Identifier: Apache-2.0
// Reverse mode through one touching point (kernels/contact/pair_contact.hpp). It turns a cotangent
// f̄ of the force on body 1 into those of the displacement ε = (θ; ρ) and relative twist W of body
// 2, and of the contact's coefficients. It takes some 150 operations and no matrices. With m̄ = μ t
// (t = 0 when sticking) and B the friction bound divided by μ:
//   d̄ = (N_d n - B_d m̄)·f̄,  r̄ = (N_ḋ n - B_ḋ m̄)·f̄,  n̄ = N f̄,  s̄ = -s (f̄ - t (t·f̄))
//       through f = N n + f_t(v_t, B)
//   r̄ -= n·s̄,  n̄ -= ḋ s̄
//       through v_t = u - ḋ n
//   n̄ += r̄ u,  ū = s̄ + r̄ n
//       through ḋ = n·u
//   W̄ = (x₂ × v̄; v̄), v̄ = -ū;  x̄ = ω × ū
//       through u = -(v + ω × x₂)
//   d̄ -= n·x̄,  n̄ -= d x̄
//       through x₂ = ξ - d n
//   ρ̄ = -d̄ n - H n̄,  θ̄ = x₂ × ρ̄ + n × (I - dH) n̄
//       through d and n
#pragma once

#include "kernels/contact/pair_contact.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere::kernels {

/// Adds cotangents of the law's coefficients. f̄ is zero where nothing touches.
template <class N>
void pull_back_law(const LawParameters<N>& law, const PointContact<N>& p, const Vec3<N>& f_bar,
                   Coefficients<N>& out) {
  const N along_t = dot(p.tangential.direction, f_bar);
  const N slip = p.tangential.slip;
  out.kt -= (N(1.0) - slip) * dot(p.vt, f_bar);
  out.mu -= p.normal.bound * along_t;
  pull_back_normal_force(law, p.d, p.rate, p.normal, dot(p.n, f_bar), -(law.mu * along_t), out);
}

/// Cotangents of everything but the coefficients that a point's force depends on, at fixed n.
template <class N>
struct ForceCotangent {
  Vec3<N> slide, u;  ///< of v_t at fixed u, and of u
  N rate, d;
};

/// Computes them through f = N n + f_t, v_t = u - ḋ n and ḋ = n·u.
template <class N>
ForceCotangent<N> pull_back_force(const LawParameters<N>& law, const PointContact<N>& p,
                                  const Vec3<N>& f_bar) {
  const Vec3<N>& t = p.tangential.direction;
  const N along_n = dot(p.n, f_bar), along_t = dot(t, f_bar), bound = -(law.mu * along_t);
  const Vec3<N> slide = (-p.tangential.scale) * mul_add(-along_t, t, f_bar);
  const N rate =
      mul_add(p.normal.rate_slope, along_n, p.normal.bound_rate * bound) - dot(p.n, slide);
  return {slide, mul_add(rate, p.n, slide), rate,
          mul_add(p.normal.d_slope, along_n, p.normal.bound_d * bound)};
}

/// Returns H n̄, where H = κ (I - n nᵀ - e z zᵀ) for balls and rods.
template <class Shape, class N>
Vec3<N> bend(const PointContact<N>& p, const Vec3<N>& n_bar) {
  if constexpr (Shape::kBending == Bending::general) return p.hessian * n_bar;
  Vec3<N> bent = mul_add(-dot(p.n, n_bar), p.n, n_bar);
  if constexpr (Shape::kBending == Bending::rod) bent = mul_add(-dot(p.axis, n_bar), p.axis, bent);
  return p.curvature * bent;
}

/// Cotangents of the places of a point and a shape: ρ̄ is that of ρ₂, through which d and n depend
/// on the shape's place, d̄ its part through d, and x̄ is that of x₂ at fixed d and n. If the point
/// moves instead of the shape, ξ̄ = x̄ - ρ̄.
template <class N>
struct PlaceCotangent {
  Vec3<N> x, rho;
  N d;
};

/// Adds one point's share of the motion's cotangents. f̄ is zero where nothing touches.
template <class Shape, class N>
PlaceCotangent<N> pull_back_motion(const LawParameters<N>& law, const PointContact<N>& p,
                                   const Vec3<N>& omega, const Vec3<N>& f_bar,
                                   TouchCotangent<N>& out) {
  const ForceCotangent<N> bar = pull_back_force(law, p, f_bar);
  out.twist.a += cross(bar.u, p.x2);
  out.twist.l -= bar.u;
  const Vec3<N> x_bar = cross(omega, bar.u);
  const N minus_d_bar = dot(p.n, x_bar) - bar.d;
  const Vec3<N> n_bar = mul_add(
      p.normal.force, f_bar, mul_add(-p.rate, bar.slide, mul_add(bar.rate, p.u, (-p.gap) * x_bar)));
  Vec3<N> rho = minus_d_bar * p.n, turned = n_bar;
  if constexpr (Shape::kBending != Bending::flat) {
    const Vec3<N> bent = bend<Shape>(p, n_bar);
    rho -= bent;
    turned = mul_add(-p.gap, bent, turned);
  }
  out.displacement.a += cross(p.x2, rho) + cross(p.n, turned);
  out.displacement.l += rho;
  return {x_bar, rho, -minus_d_bar};
}

/// Pulls back a cotangent x̄ of x₂ = ξ - d n: x̄, ρ̄ = n (n·x̄) + d H x̄ and d̄ = -n·x̄.
template <class Shape, class N>
PlaceCotangent<N> pull_back_place(const PointContact<N>& p, const Vec3<N>& x_bar) {
  const N along = dot(p.n, x_bar);
  Vec3<N> rho = along * p.n;
  if constexpr (Shape::kBending != Bending::flat) rho += p.gap * bend<Shape>(p, x_bar);
  return {x_bar, rho, -along};
}

/// Returns the cotangent of a shape's size from those of its place and of d. Q: the shape's axes in
/// its columns.
template <class Shape, class N>
Vec3<N> pull_back_size(const Shape& shape, const PointContact<N>& p, const Mat3<N>& Q,
                       const Vec3<N>& c, const Vec3<N>& xi, const Vec3<N>& rho, const N& d_bar) {
  if constexpr (Shape::kBending == Bending::ball) {  // the same in any axes
    return shape.size_share(xi, p.n, rho);
  } else if constexpr (requires { shape.size_share(xi, p.d, rho, d_bar); }) {
    return shape.size_share(transposed_times(Q, xi - c), p.d, transposed_times(Q, rho), d_bar);
  } else {
    return shape.size_share(transposed_times(Q, xi - c), transposed_times(Q, p.n),
                            transposed_times(Q, rho));
  }
}

}  // namespace tangere::kernels
