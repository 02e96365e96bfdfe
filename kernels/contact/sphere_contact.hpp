// SPDX-License-Identifier: Apache-2.0
// Points of body 1 against a sphere of body 2. Sums are taken about the sphere's centre c, where
// most of a point's derivative vanishes.
//
// D = ξ - c = (r + d) n, and forces act at c + r n. With q = -(v + ω × c) and o = -r ω, which are
// the same for all points,
//   u = q + o × n,  ḋ = n·q,  v_t = u - ḋ n,  f = N n - s v_t,  moment about c: r n × f
//   κ = 1/|D|,  γ = μ ∂B/∂ḋ,  t = v_t/|v_t| when slipping, else 0,  b = n × t,
//       α = (∂N/∂ḋ + s) n - γ t,  e = t × o - ḋ t
//   ∂f/∂q = α nᵀ + s t tᵀ - s I                        ∂(n×f)/∂q = b (s t - γ n)ᵀ - s [n]
//   ∂f/∂o = s t bᵀ + s [n]                             ∂(n×f)/∂o = s n nᵀ + s b bᵀ - s I
//   ∂f/∂D = g nᵀ + κ(α qᵀ + s t eᵀ + (N + ḋ s) I - s [o])
//           g = (∂N/∂d - κ(N + ḋ(∂N/∂ḋ + 2 s))) n - (μ ∂B/∂d + κ(s o·b - ḋ γ)) t + κ s o × n
//   ∂(n×f)/∂D = k nᵀ + κ(s b eᵀ - γ b qᵀ + s [u] - s o nᵀ + s (n·o) I),  k = n × g - κ n × f
// What does not depend on the point is taken out of the sums. Derivation: docs/contact.md.
#pragma once

#include "kernels/contact/pair_contact.hpp"
#include "kernels/contact/point_chunk.hpp"
#include "kernels/numbers/inverse_sqrt.hpp"

namespace tangere::kernels {

template <class N>
struct SpherePoint;
template <class N>
struct SpherePass;
template <class N>
struct SphereSums;

/// Motion of the sphere relative to body 1, in body 1's axes.
template <class N>
struct SphereMotion {
  using Place = Vec3<N>;
  using Point = SpherePoint<N>;
  using Pass = SpherePass<N>;
  using Sums = SphereSums<N>;
  template <class M>
  using Of = SphereMotion<M>;
  Vec3<N> centre, q, o;
  N radius;
};

template <class N>
SphereMotion<N> sphere_motion(const Vec3<N>& centre, const Vec6<N>& W, const N& radius) {
  return {centre, -(W.l + cross(W.a, centre)), (-radius) * W.a, radius};
}

template <class N>
const SphereMotion<N>& with_law(const SphereMotion<N>& z, const LawParameters<N>&) {
  return z;
}

/// What one point adds to the sums. All are exact zeros if it does not touch. The struct consists
/// of numbers only: first those that every touching point sets, then those that fewer points set.
template <class N>
struct SpherePoint {
  using Number = N;
  Vec3<N> f, m;  ///< force, n × f
  // Set only with derivatives.
  Vec3<N> n, alpha, g, k, sn;  ///< normal, α, g, k, s n
  N s, curvature, spread;      ///< s, κ, N + ḋ s
  // Set only where the point slips.
  Vec3<N> t, b, st, sb, ke, turn;  ///< t, b, s t, s b, κ e, s t - γ n
  N k_gamma;                       ///< κ γ

  static constexpr bool kElastic = false;
  static constexpr int kValues = 6, kDerivatives = kValues + 18, kSlipping = kDerivatives + 19;
  static constexpr int kBent = kSlipping, kNumbers = kSlipping;
};

/// Σ s n, Σ κ s n, Σ κ α, Σ s, Σ κ s, Σ κ (N + ḋ s)
template <class N>
struct ScaledSums {
  Vec3<N> sn, ksn, k_alpha;
  N s, ks, k_spread;
};

/// Every sum runs over the points in order, so chunks may be cut anywhere. What all touching points
/// add and what slipping points add are kept apart until the end.
template <class N>
struct SphereSums {
  Vec3<N> f, m;               ///< Σ f, Σ n × f
  Mat3<N> alpha_n, g_n, k_n;  ///< Σ α nᵀ, Σ g nᵀ, Σ k nᵀ
  UpperTriangle<N> s_nn;      ///< Σ s n nᵀ
  ScaledSums<N> scaled;
  Mat3<N> s_tt, s_tb, s_t_ke, b_turn,
      s_b_ke;  ///< Σ s t tᵀ, Σ s t bᵀ, Σ κ s t eᵀ, Σ b (s t - γ n)ᵀ, Σ κ s b eᵀ
  UpperTriangle<N> s_bb;  ///< Σ s b bᵀ
  Vec3<N> k_gamma_b;      ///< Σ κ γ b
};

template <bool Derivatives, class N>
void clear(SphereSums<N>& s) {
  s.f = s.m = zero3<N>();
  if constexpr (Derivatives) {
    s.alpha_n = s.g_n = s.k_n = s.s_tt = s.s_tb = s.s_t_ke = s.b_turn = s.s_b_ke = zero33<N>();
    for (int i = 0; i < 6; ++i) s.s_nn.m[i] = s.s_bb.m[i] = N(0.0);
    s.scaled.sn = s.scaled.ksn = s.scaled.k_alpha = s.k_gamma_b = zero3<N>();
    s.scaled.s = s.scaled.ks = s.scaled.k_spread = N(0.0);
  }
}

/// Intermediate results of the three passes of a chunk.
template <class N>
struct SpherePass {
  Vec3<N> vt, turned;
  N d, kappa, rate, square, inverse_speed;
};

/// Computes n, d and κ. Returns where the point touches.
template <class N>
auto find_distance(const SphereMotion<N>& z, const Vec3<N>& xi, SpherePoint<N>& out,
                   SpherePass<N>& pass) {
  const Distance<N> at = SphereDistance<N>{z.radius}.evaluate(xi - z.centre, pass.kappa);
  out.n = at.n;
  pass.d = at.d;
  return at.d < N(0.0);
}

/// Computes ḋ and v_t.
template <class N>
void find_velocity(const SphereMotion<N>& z, const SpherePoint<N>& out, SpherePass<N>& pass) {
  pass.rate = dot(out.n, z.q);
  pass.turned = cross(z.o, out.n);
  pass.vt = z.q + pass.turned - pass.rate * out.n;
}

/// Computes ḋ, v_t and 1/|v_t|.
template <class N>
void find_slide(const SphereMotion<N>& z, const SpherePoint<N>& out, SpherePass<N>& pass) {
  find_velocity(z, out, pass);
  pass.square = dot(pass.vt, pass.vt);
  pass.inverse_speed = inverse_sqrt(pass.square);
}

/// Sets what the derivative needs. `out` already has n and m.
template <class N, class Mask>
void differentiate_sphere(const SphereMotion<N>& z, const LawParameters<N>& law,
                          const NormalForce<N>& normal, const Friction<N>& friction_at,
                          const Mask& slipping, const SpherePass<N>& pass, const N& s,
                          SpherePoint<N>& out) {
  const Vec3<N>& n = out.n;
  const N slope = normal.rate_slope + s;
  const N ks = pass.kappa * s;
  out.s = s;
  out.curvature = pass.kappa;
  out.spread = mul_add(pass.rate, s, normal.force);
  out.sn = s * n;
  const N g_n = mul_sub_from(
      pass.kappa, mul_add(pass.rate, normal.rate_slope + (s + s), normal.force), normal.d_slope);
  out.alpha = slope * n;
  out.g = mul_add(g_n, n, ks * pass.turned);
  out.k = mul_add(ks, z.o - dot(z.o, n) * n, (-pass.kappa) * out.m);
  if (!any(slipping)) return;
  const N gate = select(slipping, N(1.0), N(0.0));
  const Vec3<N> t = gate * friction_at.direction;
  out.t = t;
  out.b = cross(n, t);
  const N gamma = gate * (law.mu * normal.bound_rate);
  const N g_t =
      -(law.mu * normal.bound_d) - pass.kappa * mul_sub_from(pass.rate, gamma, s * dot(z.o, out.b));
  out.alpha -= gamma * t;
  out.g += g_t * t;
  out.k += g_t * out.b;
  out.st = s * t;
  out.sb = s * out.b;
  out.ke = pass.kappa * (cross(t, z.o) - pass.rate * t);
  out.turn = out.st - gamma * n;
  out.k_gamma = pass.kappa * gamma;
}

/// Computes the force and what its derivative needs. Returns where the point slips.
template <bool Derivatives, class N>
auto find_force(const SphereMotion<N>& z, const LawParameters<N>& law, const SpherePass<N>& pass,
                SpherePoint<N>& out) {
  const N zero(0.0);
  const auto touching = pass.d < zero;
  const NormalForce<N> normal = normal_force(law, pass.d, pass.rate);
  const Friction<N> friction_at = friction(law, normal, pass.vt, pass.square, pass.inverse_speed);
  const N s = select(touching, friction_at.scale, zero);
  out.f = normal.force * out.n - s * pass.vt;
  out.m = cross(out.n, out.f);
  const auto slipping = touching & (friction_at.slip > zero);
  if constexpr (Derivatives)
    differentiate_sphere(z, law, normal, friction_at, slipping, pass, s, out);
  return slipping;
}

/// Adds the points of a chunk in order.
template <bool Derivatives, class Point, class N>
[[gnu::noinline]] void add_chunk(SphereSums<N>& sums, const PointChunk<Point>& chunk) {
  const auto each = [&](auto& sum, const auto& f) {
    add_each(sum, chunk.point, chunk.touching, chunk.count, f);
  };
  const auto slipping = [&](auto& sum, const auto& f) {
    add_each(sum, chunk.point, chunk.slipping, chunk.slips, f);
  };
  each(sums.f, [](Vec3<N>& f, const Point& p) { f += p.f; });
  each(sums.m, [](Vec3<N>& m, const Point& p) { m += p.m; });
  if constexpr (Derivatives) {
    each(sums.alpha_n, [](Mat3<N>& m, const Point& p) { add_outer(m, p.alpha, p.n); });
    each(sums.g_n, [](Mat3<N>& m, const Point& p) { add_outer(m, p.g, p.n); });
    each(sums.k_n, [](Mat3<N>& m, const Point& p) { add_outer(m, p.k, p.n); });
    each(sums.s_nn, [](UpperTriangle<N>& m, const Point& p) { add_upper(m, p.sn, p.n); });
    each(sums.scaled, [](ScaledSums<N>& q, const Point& p) {
      q.sn += p.sn;
      q.ksn = mul_add(p.curvature, p.sn, q.ksn);
      q.k_alpha = mul_add(p.curvature, p.alpha, q.k_alpha);
      q.s += p.s;
      q.ks = mul_add(p.curvature, p.s, q.ks);
      q.k_spread = mul_add(p.curvature, p.spread, q.k_spread);
    });
    if (chunk.slips > 0) {
      slipping(sums.s_tt, [](Mat3<N>& m, const Point& p) { add_outer(m, p.st, p.t); });
      slipping(sums.s_tb, [](Mat3<N>& m, const Point& p) { add_outer(m, p.st, p.b); });
      slipping(sums.s_t_ke, [](Mat3<N>& m, const Point& p) {
        if constexpr (Point::kElastic)
          add_outer(m, p.t, p.s_ke);
        else
          add_outer(m, p.st, p.ke);
      });
      slipping(sums.b_turn, [](Mat3<N>& m, const Point& p) { add_outer(m, p.b, p.turn); });
      slipping(sums.s_bb, [](UpperTriangle<N>& m, const Point& p) { add_upper(m, p.sb, p.b); });
      slipping(sums.s_b_ke, [](Mat3<N>& m, const Point& p) {
        if constexpr (Point::kElastic)
          add_outer(m, p.b, p.s_ke);
        else
          add_outer(m, p.sb, p.ke);
      });
      slipping(sums.k_gamma_b, [](Vec3<N>& v, const Point& p) { v = mul_add(p.k_gamma, p.b, v); });
    }
  }
}

/// Adds wrench, stiffness and damping of the pair about body 1's origin, from the sums about the
/// centre. With δc = ρ + θ × c:  δD = -δc,  δq = -(δv + δω × c) - ω × δc,  δo = -r δω.
template <bool Derivatives, class N>
void add_finished(const SphereMotion<N>& z, const Vec6<N>& W, const SphereSums<N>& s,
                  PairSums<N>& out) {
  const N r = z.radius;
  out.wrench.l += s.f;
  out.wrench.a += cross(z.centre, s.f) + r * s.m;
  if constexpr (Derivatives) {
    const ScaledSums<N>& c = s.scaled;
    Mat3<N> f_q = s.alpha_n + s.s_tt,
            f_D = s.g_n + s.s_t_ke + outer(c.k_alpha, z.q) - skew(c.ks * z.o);
    const Mat3<N> m_q = s.b_turn - skew(c.sn), f_o = s.s_tb + skew(c.sn);
    // Σ κ s u = q Σ κ s + o × Σ κ s n
    Mat3<N> m_D = s.k_n + s.s_b_ke - outer(s.k_gamma_b, z.q) +
                  skew(mul_add(c.ks, z.q, cross(z.o, c.ksn))) - outer(z.o, c.ksn);
    const Mat3<N> m_o = full(s.s_nn) + full(s.s_bb) - diagonal(c.s);
    const N along = dot(z.o, c.ksn);
    for (int i = 0; i < 3; ++i) {
      f_q.m[i][i] -= c.s;
      f_D.m[i][i] += c.k_spread;
      m_D.m[i][i] += along;
    }
    const Mat3<N> f_c = -(f_D + times_skew(f_q, W.a)), m_c = (-r) * (m_D + times_skew(m_q, W.a));
    const Mat3<N> k_al = cross_columns(z.centre, f_c) - skew(s.f) + m_c;
    const Mat3<N> d_la = times_skew(f_q, z.centre) - r * f_o, m_v = (-r) * m_q;
    out.k[1][1] += f_c;
    out.k[1][0] = out.k[1][0] - times_skew(f_c, z.centre);
    out.k[0][1] += k_al;
    out.k[0][0] = out.k[0][0] - times_skew(k_al, z.centre);
    out.d[1][1] = out.d[1][1] - f_q;
    out.d[1][0] += d_la;
    out.d[0][1] += m_v - cross_columns(z.centre, f_q);
    out.d[0][0] += cross_columns(z.centre, d_la) - times_skew(m_v, z.centre) - (r * r) * m_o;
  }
}

}  // namespace tangere::kernels
