// SPDX-License-Identifier: Apache-2.0
// Points of body 1 against a sphere of body 2, about the sphere's centre c, where most of a point's derivative vanishes.
//
// D = ξ - c = (r + d) n, forces act at c + r n, and with q = -(v + ω × c), o = -r ω, the same for all points,
//   u = q + o × n,  ḋ = n·q,  v_t = u - ḋ n,  f = N n - s v_t,  moment about c: r n × f
//   κ = 1/|D|,  γ = μ ∂B/∂ḋ,  t = v_t/|v_t| when slipping, else 0,  b = n × t,  α = (∂N/∂ḋ + s) n - γ t,  e = t × o - ḋ t
//   ∂f/∂q = α nᵀ + s t tᵀ - s I                        ∂(n×f)/∂q = b (s t - γ n)ᵀ - s [n]
//   ∂f/∂o = s t bᵀ + s [n]                             ∂(n×f)/∂o = s n nᵀ + s b bᵀ - s I
//   ∂f/∂D = g nᵀ + κ(α qᵀ + s t eᵀ + (N + ḋ s) I - s [o])
//           g = (∂N/∂d - κ(N + ḋ(∂N/∂ḋ + 2 s))) n - (μ ∂B/∂d + κ(s o·b - ḋ γ)) t + κ s o × n
//   ∂(n×f)/∂D = k nᵀ + κ(s b eᵀ - γ b qᵀ + s [u] - s o nᵀ + s (n·o) I),  k = n × g - κ n × f
// What does not depend on the point comes out of the sums. Derivation: docs/contact.md.
#pragma once

#include "kernels/inverse_sqrt.hpp"
#include "kernels/pair_contact.hpp"

namespace tangere::kernels {

/// Motion of the sphere relative to body 1, in body 1's axes.
template <class N>
struct SphereMotion {
  Vec3<N> centre, q, o;
  N radius;
};

template <class N>
SphereMotion<N> sphere_motion(const Vec3<N>& centre, const Vec6<N>& W, const N& radius) {
  return {centre, -(W.l + cross(W.a, centre)), (-radius) * W.a, radius};
}

/// What one point adds to the sums: exact zeros if it does not touch.
template <class N>
struct SpherePoint {
  Vec3<N> n, f, m;              ///< normal, force, n × f
  // With derivatives only.
  Vec3<N> alpha, g, k, sn;      ///< α, g, k, s n
  N s, curvature, spread;       ///< s, κ, N + ḋ s
  // Where it slips only.
  Vec3<N> t, b, e, turn;        ///< t, b, e, s t - γ n
  N gamma;                      ///< γ
};

template <class N>
struct SphereSums {
  Vec3<N> f, m;                 ///< Σ f, Σ n × f
  Mat3<N> f_q, f_o, f_D, m_q, m_D;  ///< the outer products
  N m_o[6];                     ///< upper triangle of Σ s (n nᵀ + b bᵀ)
  Vec3<N> sn, ksn, k_alpha, k_gamma_b;  ///< Σ s n, Σ κ s n, Σ κ α, Σ κ γ b
  N s, ks, k_spread;            ///< Σ s, Σ κ s, Σ κ (N + ḋ s)
};

template <class N>
void clear(SphereSums<N>& sums) {
  N* x = reinterpret_cast<N*>(&sums);
  for (std::size_t i = 0; i < sizeof(sums) / sizeof(N); ++i) x[i] = N(0.0);
}

/// Fills `out`; `touching` and `slipping` say which parts of it are not zero (the rest is not set).
template <bool Derivatives, class N, class Mask>
void sphere_point(const SphereMotion<N>& z, const LawParameters<N>& law, const Vec3<N>& xi, SpherePoint<N>& out,
                  Mask& touching, Mask& slipping) {
  const N zero(0.0);
  const Vec3<N> D = xi - z.centre;
  N kappa;
  const Distance<N> at = SphereDistance<N>{z.radius}.evaluate(D, kappa);
  touching = at.d < zero;
  slipping = touching;
  if (!any(touching)) return;
  const Vec3<N>& n = at.n;
  const N rate = dot(n, z.q);
  const Vec3<N> turned = cross(z.o, n);
  const Vec3<N> vt = z.q + turned - rate * n;
  const NormalForce<N> normal = normal_force(law, at.d, rate);
  const Friction<N> friction_at = friction(law, normal, vt);
  const N s = select(touching, friction_at.scale, zero);
  out.n = n;
  out.f = normal.force * n - s * vt;
  out.m = cross(n, out.f);
  if constexpr (!Derivatives) return;
  slipping = touching & (friction_at.slip > zero);
  const N two_s = s + s;
  const N slope = normal.rate_slope + s;
  const N ks = kappa * s;
  out.s = s;
  out.curvature = kappa;
  out.spread = mul_add(rate, s, normal.force);
  out.sn = s * n;
  const N g_n = mul_sub_from(kappa, mul_add(rate, normal.rate_slope + two_s, normal.force), normal.d_slope);
  const N along = dot(z.o, n);
  out.alpha = slope * n;
  out.g = mul_add(g_n, n, ks * turned);
  out.k = mul_add(ks, z.o - along * n, (-kappa) * out.m);
  if (!any(slipping)) return;
  const N gate = select(slipping, N(1.0), zero);
  const Vec3<N> t = gate * friction_at.direction;
  out.t = t;
  out.b = cross(n, t);
  out.gamma = gate * (law.mu * normal.bound_rate);
  const N g_t = -(law.mu * normal.bound_d) - kappa * mul_sub_from(rate, out.gamma, s * dot(z.o, out.b));
  out.alpha -= out.gamma * t;
  out.g += g_t * t;
  out.k += g_t * out.b;
  out.e = cross(t, z.o) - rate * t;
  out.turn = s * t - out.gamma * n;
}

template <class N>
void add_outer(Mat3<N>& sum, const Vec3<N>& a, const Vec3<N>& b) {
  const N x[3] = {a.x, a.y, a.z}, y[3] = {b.x, b.y, b.z};
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) sum.m[i][j] = mul_add(x[i], y[j], sum.m[i][j]);
}
template <class N>
void add_upper(N (&sum)[6], const Vec3<N>& a, const Vec3<N>& b) {
  sum[0] = mul_add(a.x, b.x, sum[0]);
  sum[1] = mul_add(a.x, b.y, sum[1]);
  sum[2] = mul_add(a.x, b.z, sum[2]);
  sum[3] = mul_add(a.y, b.y, sum[3]);
  sum[4] = mul_add(a.y, b.z, sum[4]);
  sum[5] = mul_add(a.z, b.z, sum[5]);
}

/// Adds a point that touches in some lane.
template <bool Derivatives, class N>
void add_point(SphereSums<N>& sums, const SpherePoint<N>& p, bool slips) {
  sums.f += p.f;
  sums.m += p.m;
  if constexpr (Derivatives) {
    const N ks = p.curvature * p.s;
    add_outer(sums.f_q, p.alpha, p.n);
    add_outer(sums.f_D, p.g, p.n);
    add_outer(sums.m_D, p.k, p.n);
    add_upper(sums.m_o, p.sn, p.n);
    sums.sn += p.sn;
    sums.ksn = mul_add(p.curvature, p.sn, sums.ksn);
    sums.k_alpha = mul_add(p.curvature, p.alpha, sums.k_alpha);
    sums.s += p.s;
    sums.ks += ks;
    sums.k_spread = mul_add(p.curvature, p.spread, sums.k_spread);
    if (!slips) return;
    const Vec3<N> ke = p.curvature * p.e;
    const Vec3<N> st = p.s * p.t, sb = p.s * p.b;
    add_outer(sums.f_q, st, p.t);
    add_outer(sums.f_o, st, p.b);
    add_outer(sums.f_D, st, ke);
    add_outer(sums.m_q, p.b, p.turn);
    add_upper(sums.m_o, sb, p.b);
    add_outer(sums.m_D, sb, ke);
    sums.k_gamma_b = mul_add(p.curvature * p.gamma, p.b, sums.k_gamma_b);
  }
}

/// Wrench, stiffness and damping of the pair about body 1's origin from the sums about the centre: with
/// δc = ρ + θ × c,  δD = -δc,  δq = -(δv + δω × c) - ω × δc,  δo = -r δω.
template <bool Derivatives, class N>
void finish_sphere(const SphereMotion<N>& z, const Vec3<N>& omega, const SphereSums<N>& s, PairSums<N>& out) {
  const N r = z.radius;
  out.wrench.l = s.f;
  out.wrench.a = cross(z.centre, s.f) + r * s.m;
  if constexpr (Derivatives) {
    Mat3<N> f_q = s.f_q, m_q = s.m_q - skew(s.sn);
    for (int i = 0; i < 3; ++i) f_q.m[i][i] -= s.s;
    const Mat3<N> f_o = s.f_o + skew(s.sn);
    Mat3<N> m_o = {{{s.m_o[0] - s.s, s.m_o[1], s.m_o[2]},
                    {s.m_o[1], s.m_o[3] - s.s, s.m_o[4]},
                    {s.m_o[2], s.m_o[4], s.m_o[5] - s.s}}};
    Mat3<N> f_D = s.f_D + outer(s.k_alpha, z.q) - skew(s.ks * z.o);
    for (int i = 0; i < 3; ++i) f_D.m[i][i] += s.k_spread;
    // Σ κ s u = q Σ κ s + o × Σ κ s n
    Mat3<N> m_D = s.m_D - outer(s.k_gamma_b, z.q) + skew(mul_add(s.ks, z.q, cross(z.o, s.ksn))) - outer(z.o, s.ksn);
    const N along = dot(z.o, s.ksn);
    for (int i = 0; i < 3; ++i) m_D.m[i][i] += along;
    const Mat3<N> f_c = -(f_D + times_skew(f_q, omega)), m_c = (-r) * (m_D + times_skew(m_q, omega));
    out.k[1][1] = f_c;
    out.k[1][0] = -times_skew(f_c, z.centre);
    out.k[0][1] = cross_columns(z.centre, f_c) - skew(s.f) + m_c;
    out.k[0][0] = -times_skew(out.k[0][1], z.centre);
    out.d[1][1] = -f_q;
    out.d[1][0] = times_skew(f_q, z.centre) - r * f_o;
    const Mat3<N> m_v = (-r) * m_q;
    out.d[0][1] = m_v - cross_columns(z.centre, f_q);
    out.d[0][0] = cross_columns(z.centre, out.d[1][0]) - times_skew(m_v, z.centre) - (r * r) * m_o;
  }
}

}  // namespace tangere::kernels
