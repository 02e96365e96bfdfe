// SPDX-License-Identifier: Apache-2.0
// Force and derivative of one touching point, and their sums over a pair of bodies.
//
// Everything is in the axes of body 1, which carries the point ξ. G = (Q, c) is body 2's shape
// frame there. W = (ω; v) is the twist of body 2 relative to body 1 at body 1's origin. d and n are
// distance and gradient at ξ. x₂ = ξ - d n is the nearest point on the touched surface. Velocities
// are compared there, and forces act there:
//   u = -(v + ω × x₂)  velocity of body 1 relative to body 2 at x₂;  ḋ = n·u;  v_t = u - ḋ n;
//     f acts on body 1.
// Derivatives are by ε = (θ; ρ), the displacement of body 2 relative to body 1, and by δW. With
// ρ₂ = ρ + θ × x₂ the displacement of body 2's material at x₂, and H the Hessian of d:
//   δd = -n·ρ₂,  δn = -H ρ₂ + (I - dH)(θ × n),  δx₂ = -δd n - d δn,  δu = -(δv + δω × x₂) - ω × δx₂
//   δḋ = δn·u + n·δu,  δv_t = δu - δḋ n - ḋ δn,  δN = N_d δd + N_ḋ δḋ
//   δf = δN n + N δn + δf_t,  δf_t = -s (δv_t - t (t·δv_t)) - μ t δB
//       (t = 0 and no δB when sticking)
// Where ξ is the centre of a ball (ball_contact.hpp), x₂ = ξ - (d + r) n, and d + r takes the place
// of d in δn and δx₂.
// Wrench on body 1 about its origin: w₁ = Σ (x₂ × f; f),  δw₁ = K ε + D δW.
#pragma once

#include "kernels/contact/contact_law.hpp"
#include "kernels/contact/distance.hpp"

namespace tangere::kernels {

/// How a point of body 1 meets body 2, in body 1's axes.
template <class N>
struct PointContact {
  N d, rate;  ///< d, ḋ
  N gap;      ///< distance from ξ to x₂: d, or d + r of a ball around ξ (ball_contact.hpp)
  Vec3<N> n, x2, u, vt;
  NormalForce<N> normal;
  Friction<N> tangential;
  Vec3<N> force;    ///< on body 1, acting at x2
  N curvature;      ///< κ of H (Bending)
  Vec3<N> axis;     ///< rods only: e z
  Mat3<N> hessian;  ///< Bending::general only: H
};

/// Computes distance, normal, bending and the surface point x₂ at ξ. `Q`, `c`: shape frame in body
/// 1.
template <class Shape, class N>
[[gnu::always_inline]] inline void find_place(const Shape& shape, const Mat3<N>& Q,
                                              const Vec3<N>& c, const Vec3<N>& xi,
                                              PointContact<N>& p) {
  const Vec3<N> arm = xi - c;
  if constexpr (Shape::kBending == Bending::flat) {
    const Distance<N> at = shape.evaluate(transposed_times(Q, arm), p.curvature);
    p.d = at.d;
    p.n = Q * at.n;
  } else if constexpr (Shape::kBending == Bending::rod) {
    N straight;
    const Distance<N> at = shape.evaluate(transposed_times(Q, arm), p.curvature, straight);
    p.d = at.d;
    p.n = Q * at.n;
    p.axis = straight * Vec3<N>{Q.m[0][2], Q.m[1][2], Q.m[2][2]};
  } else if constexpr (Shape::kBending == Bending::general) {
    Mat3<N> hessian;
    const Distance<N> at = shape.evaluate(transposed_times(Q, arm), hessian);
    p.d = at.d;
    p.n = Q * at.n;
    p.hessian = Q * hessian * transpose(Q);
  } else {  // a sphere has no orientation
    const Distance<N> at = shape.evaluate(arm, p.curvature);
    p.d = at.d;
    p.n = at.n;
  }
  p.gap = p.d;
  if constexpr (requires { shape.grown; }) p.gap = p.d + shape.grown;
  p.x2 = xi - p.gap * p.n;
}

/// Computes velocities and normal force at a place that is found. `omega`, `v`: W.
template <class N>
[[gnu::always_inline]] inline void find_motion(const LawParameters<N>& law, const Vec3<N>& omega,
                                               const Vec3<N>& v, PointContact<N>& p) {
  p.u = -(v + cross(omega, p.x2));
  p.rate = dot(p.n, p.u);
  p.vt = p.u - p.rate * p.n;
  p.normal = normal_force(law, p.d, p.rate);
}

/// Computes distance, velocities and force at ξ. `Q`, `c`: shape frame in body 1. `omega`, `v`: W.
template <class Shape, class N>
PointContact<N> point_contact(const Shape& shape, const LawParameters<N>& law, const Mat3<N>& Q,
                              const Vec3<N>& c, const Vec3<N>& omega, const Vec3<N>& v,
                              const Vec3<N>& xi) {
  PointContact<N> p;
  find_place(shape, Q, c, xi, p);
  find_motion(law, omega, v, p);
  p.tangential = friction(law, p.normal, p.vt);
  const N touching = select(p.d < N(0.0), N(1.0), N(0.0));
  p.force = touching * (p.normal.force * p.n - p.tangential.scale * p.vt);
  return p;
}

/// Sums over the points of a pair, in body 1's axes about its origin: the wrench, and 6×6 stiffness
/// and damping in blocks {torque, force} × {angular, linear}.
template <class N>
struct PairSums {
  Vec6<N> wrench;
  Mat3<N> k[2][2];
  Mat3<N> d[2][2];

  static PairSums zero() {
    PairSums s;
    s.wrench = zero6<N>();
    for (int i = 0; i < 2; ++i)
      for (int j = 0; j < 2; ++j) s.k[i][j] = s.d[i][j] = zero33<N>();
    return s;
  }
};

/// Derivatives of the force: ∂f/∂u at fixed geometry; ∂f and ∂x₂ by ρ₂ and θ.
template <class N>
struct PointDerivative {
  Mat3<N> f_u, f_rho, f_theta, x_rho, x_theta;
};

/// Derivatives of f by n, u and d at a point.
template <class N>
struct ForceDerivative {
  Mat3<N> f_n, f_u;
  Vec3<N> f_d;
};
///   δḋ = u·δn + n·δu;  δv_t = δu - n δḋ - ḋ δn
template <class N>
ForceDerivative<N> differentiate_force(const LawParameters<N>& law, const PointContact<N>& p) {
  const Vec3<N>&n = p.n, &t = p.tangential.direction;
  const Vec3<N> mt = (law.mu * p.tangential.slip) * t;
  // ∂f/∂ḋ through N and B, and ∂f/∂v_t = -s (I - ttᵀ).
  const Vec3<N> f_rate = p.normal.rate_slope * n - p.normal.bound_rate * mt;
  const Vec3<N> f_depth = p.normal.d_slope * n - p.normal.bound_d * mt;
  const Mat3<N> T = p.tangential.scale * (diagonal(N(1.0)) - outer(t, t));
  const Vec3<N> g = f_rate + T * n;  // coefficient of δḋ
  return {diagonal(p.normal.force) + outer(g, p.u) + p.rate * T, outer(g, n) - T, f_depth};
}

/// δn = n_rho ρ₂ + n_theta θ; H = κ (P - e zzᵀ); n_theta = -(I - dH)[n], with P[n] = [n] and
/// zzᵀ[n] = z (z × n)ᵀ. `P`: I - n nᵀ.
template <class Shape, class N>
void differentiate_normal(const PointContact<N>& p, const Mat3<N>& P, Mat3<N>& n_rho,
                          Mat3<N>& n_theta) {
  const N one(1.0);
  const Vec3<N>& n = p.n;
  constexpr bool kFlat = Shape::kBending == Bending::flat;
  if constexpr (Shape::kBending == Bending::general) {
    n_rho = -p.hessian;
    // Products are fused by hand. GCC 12 fuses sums of products with alternating signs in one
    // number type and not in the other, whatever -ffp-contract says.
    const Mat3<N> turned = times_skew(p.hessian, n), turn = skew(n);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) n_theta.m[i][j] = mul_add(p.gap, turned.m[i][j], -turn.m[i][j]);
  } else {
    n_rho = kFlat ? zero33<N>() : (-p.curvature) * P;
    const N flatten = kFlat ? one : mul_sub_from(p.gap, p.curvature, one);
    n_theta = skew(-(flatten * n));
    if constexpr (Shape::kBending == Bending::rod) {
      n_rho += outer(p.curvature * p.axis, p.axis);
      n_theta = n_theta - outer((p.gap * p.curvature) * p.axis, cross(p.axis, n));
    }
  }
}

template <class Shape, class N>
PointDerivative<N> differentiate(const LawParameters<N>& law, const PointContact<N>& p,
                                 const Vec3<N>& omega) {
  PointDerivative<N> r;
  const Vec3<N>& n = p.n;
  const Mat3<N> nn = outer(n, n);
  constexpr bool kFlat = Shape::kBending == Bending::flat;
  Mat3<N> n_rho, n_theta;
  differentiate_normal<Shape>(p, diagonal(N(1.0)) - nn, n_rho, n_theta);
  // δx₂ = nnᵀ ρ₂ - d δn.
  r.x_rho = kFlat ? nn : nn - p.gap * n_rho;
  r.x_theta = (-p.gap) * n_theta;
  const ForceDerivative<N> f = differentiate_force(law, p);
  r.f_u = f.f_u;
  // δu = -ω × δx₂.
  const Mat3<N> u_rho = cross_columns(-omega, r.x_rho);
  const Mat3<N> u_theta = cross_columns(-omega, r.x_theta);
  r.f_rho = r.f_u * u_rho - outer(f.f_d, n);
  if constexpr (!kFlat) r.f_rho += f.f_n * n_rho;
  r.f_theta = r.f_u * u_theta + f.f_n * n_theta;
  return r;
}

/// Adds the derivative of a point's wrench.
template <class N>
void add_derivative(PairSums<N>& sums, const PointContact<N>& p, PointDerivative<N>& r) {
  const N gate = select(p.d < N(0.0), N(1.0), N(0.0));
  r.f_u = gate * r.f_u;
  r.f_rho = gate * r.f_rho;
  r.f_theta = gate * r.f_theta;
  // By ε = (θ; ρ): ρ₂ = ρ - [x₂]θ. By δW = (δω; δv): δu = -(δv - [x₂]δω).
  const Mat3<N> f_eps_a = r.f_theta - times_skew(r.f_rho, p.x2);
  const Mat3<N> f_w_a = times_skew(r.f_u, p.x2);
  const Mat3<N> x_eps_a = r.x_theta - times_skew(r.x_rho, p.x2);
  sums.k[1][0] += f_eps_a;
  sums.k[1][1] += r.f_rho;
  // δ(x₂ × f) = x₂ × δf - f × δx₂.
  sums.k[0][0] += cross_columns(p.x2, f_eps_a) - cross_columns(p.force, x_eps_a);
  sums.k[0][1] += cross_columns(p.x2, r.f_rho) - cross_columns(p.force, r.x_rho);
  sums.d[1][0] += f_w_a;
  sums.d[1][1] = sums.d[1][1] - r.f_u;
  sums.d[0][0] += cross_columns(p.x2, f_w_a);
  sums.d[0][1] = sums.d[0][1] - cross_columns(p.x2, r.f_u);
}

/// Adds one point, and returns the lanes in which it touches. Points that do not touch (d ≥ 0) add
/// exact zeros.
template <bool Derivatives, class Shape, class N>
unsigned accumulate(PairSums<N>& sums, const Shape& shape, const LawParameters<N>& law,
                    const Mat3<N>& Q, const Vec3<N>& c, const Vec3<N>& omega, const Vec3<N>& v,
                    const Vec3<N>& xi) {
  const PointContact<N> p = point_contact(shape, law, Q, c, omega, v, xi);
  const auto touching = p.d < N(0.0);
  if (!any(touching)) return 0;
  sums.wrench.a += cross(p.x2, p.force);
  sums.wrench.l += p.force;
  if constexpr (Derivatives) {
    PointDerivative<N> r = differentiate<Shape>(law, p, omega);
    add_derivative(sums, p, r);
  }
  return lane_bits(touching);
}

/// Computes everything but friction and force of a point or a sphere on the ground, with velocity
/// at the body's own point p.x2 = ξ = ξ_c - r m (r = 0: a material point). m = Rᵀ n_ground,
/// `height` = n·(p - ground point) and V = body twist, all in body axes. Returns false where no
/// lane touches; then `p` holds d alone.
template <class N>
bool meets_ground(const LawParameters<N>& law, const Vec3<N>& m, const N& height, const Vec6<N>& V,
                  const Vec3<N>& centre, const N& radius, PointContact<N>& p) {
  p.d = dot(m, centre) + height - radius;
  const auto touching = p.d < N(0.0);
  if (!any(touching)) return false;
  p.n = m;
  p.x2 = centre - radius * m;
  p.u = V.l + cross(V.a, p.x2);
  p.rate = dot(m, p.u);
  p.vt = p.u - p.rate * m;
  p.normal = normal_force(law, p.d, p.rate);
  return true;
}

/// The same with friction and force, which acts at ξ.
template <class N>
bool ground_contact(const LawParameters<N>& law, const Vec3<N>& m, const N& height,
                    const Vec6<N>& V, const Vec3<N>& centre, const N& radius, PointContact<N>& p) {
  if (!meets_ground(law, m, height, V, centre, radius, p)) return false;
  p.tangential = friction(law, p.normal, p.vt);
  const N gate = select(p.d < N(0.0), N(1.0), N(0.0));
  p.force = gate * (p.normal.force * m - p.tangential.scale * p.vt);
  return true;
}

/// Derivatives of a ground contact's force by the body's own displacement (θ; ρ) and velocity u.
///   δm = m × θ, δξ = -r m × θ, δd = m·(ρ + θ × ξ_c), u = v + ω × ξ, ḋ = m·u
template <class N>
struct GroundDerivative {
  Mat3<N> f_u, f_rho, f_theta, xi_theta;
};
template <class N>
GroundDerivative<N> differentiate_ground(const LawParameters<N>& law, const Vec6<N>& V,
                                         const Vec3<N>& centre, const N& radius,
                                         const PointContact<N>& p) {
  const N gate = select(p.d < N(0.0), N(1.0), N(0.0));
  const ForceDerivative<N> force = differentiate_force(law, p);
  const Mat3<N> f_u = gate * force.f_u, f_m = gate * force.f_n;
  const Mat3<N> f_d = gate * outer(force.f_d, p.n);  // by ρ; by θ: -f_d [ξ_c]
  const Mat3<N> m_theta = skew(p.n);
  const Mat3<N> xi_theta = (-radius) * m_theta;
  const Mat3<N> u_theta = cross_columns(V.a, xi_theta);
  return {f_u, f_d, f_u * u_theta + f_m * m_theta - times_skew(f_d, centre), xi_theta};
}

/// Adds it to the sums. In the pair's convention body 2 is the ground: ε = -δ₁, δW = -δV₁. Hence
/// the signs of k and d.
template <class N>
void add_ground_derivative(PairSums<N>& sums, const PointContact<N>& p,
                           const GroundDerivative<N>& r) {
  const Vec3<N>&xi = p.x2, &f = p.force;
  const Mat3<N> f_omega = times_skew(r.f_u, xi);  // f_u δω × ξ = -f_u [ξ] δω
  sums.k[1][0] = sums.k[1][0] - r.f_theta;
  sums.k[1][1] = sums.k[1][1] - r.f_rho;
  sums.k[0][0] = sums.k[0][0] - (cross_columns(xi, r.f_theta) - cross_columns(f, r.xi_theta));
  sums.k[0][1] = sums.k[0][1] - cross_columns(xi, r.f_rho);
  sums.d[1][0] += f_omega;
  sums.d[1][1] = sums.d[1][1] - r.f_u;
  sums.d[0][0] += cross_columns(xi, f_omega);
  sums.d[0][1] = sums.d[0][1] - cross_columns(xi, r.f_u);
}

/// Adds one point or sphere on the ground. Returns false where no lane touches.
template <bool Derivatives, class N>
bool accumulate_ground(PairSums<N>& sums, const LawParameters<N>& law, const Vec3<N>& m,
                       const N& height, const Vec6<N>& V, const Vec3<N>& centre, const N& radius) {
  PointContact<N> p;
  if (!ground_contact(law, m, height, V, centre, radius, p)) return false;
  sums.wrench.a += cross(p.x2, p.force);
  sums.wrench.l += p.force;
  if constexpr (Derivatives)
    add_ground_derivative(sums, p, differentiate_ground(law, V, centre, radius, p));
  return true;
}

}  // namespace tangere::kernels
