// SPDX-License-Identifier: Apache-2.0
// Points with shear springs against a sphere: the sums of kernels/contact/sphere_contact.hpp with
// the additional terms of the spring.
//
// Symbols are those of that file and of kernels/contact/elastic_contact.hpp. The damper has s =
// λ k_t and t = w/|w|. The anchor is A = c + a with a in body 1's axes, so δr = δD - θ × a. With
// k = λ β k_s, y = k (κ η - 1), r_t = P r and σ = β'_d (r_t - t (t·r_t)) the spring adds
//   ∂f/∂D:      y (I - n nᵀ - t tᵀ) + κ k n r_tᵀ - λ k_s σ nᵀ
//   ∂(n×f)/∂D:  y ([n] - b tᵀ) + λ κ k_s [s] - λ k_s (n × σ) nᵀ
//   ∂f/∂θ:      -k [a] - k n (a × n)ᵀ - k t (a × t)ᵀ
//   ∂(n×f)/∂θ:  k (n·a) I - k a nᵀ - k b (a × t)ᵀ
#pragma once

#include "kernels/contact/elastic_contact.hpp"
#include "kernels/contact/face_contact.hpp"
#include "kernels/contact/sphere_contact.hpp"

namespace tangere::kernels {

template <class N>
struct ElasticSpherePoint;
template <class N>
struct ElasticSpherePass;
template <class N>
struct ElasticSphereSums;

/// Q: the sphere's axes in body 1.
template <class N>
struct ElasticSphereMotion : SphereMotion<N> {
  using Place = ElasticPlace<N>;
  using Point = ElasticSpherePoint<N>;
  using Pass = ElasticSpherePass<N>;
  using Sums = ElasticSphereSums<N>;
  template <class M>
  using Of = ElasticSphereMotion<M>;
  Mat3<N> Q;
  N kt, ks;
};

template <class N>
ElasticSphereMotion<N> with_law(const ElasticSphereMotion<N>& z, const LawParameters<N>& law) {
  return {static_cast<const SphereMotion<N>&>(z), z.Q, law.kt, law.ks};
}

/// The numbers of the spring follow those of SpherePoint: those of the derivative, then those that
/// only slipping points set.
template <class N>
struct ElasticSpherePoint : SpherePoint<N> {
  Vec3<N> k_a, k_an, k_r, k_turn;  ///< k a, k a × n, κ k r_t, y n + λ κ k_s s
  N y;
  Vec3<N> k_at, s_ke;  ///< k a × t, κ s e - y t

  static constexpr bool kElastic = true;
  static constexpr int kSpring = SpherePoint<N>::kNumbers, kSpringSlipping = kSpring + 13,
                       kNumbers = kSpringSlipping + 6;
};

/// Σ k a, Σ y n + λ κ k_s s, Σ y, Σ k a nᵀ, Σ k n (a × n)ᵀ, Σ κ k n r_tᵀ, Σ k t (a × t)ᵀ,
/// Σ k b (a × t)ᵀ.
template <class N>
struct SphereSpringSums {
  Vec3<N> k_a, k_turn;
  N y;
  Mat3<N> a_n, n_an, n_r, t_at, b_at;
};
template <class N>
struct ElasticSphereSums : SphereSums<N> {
  SphereSpringSums<N> spring;
};

template <bool Derivatives, class N>
void clear(ElasticSphereSums<N>& s) {
  clear<Derivatives>(static_cast<SphereSums<N>&>(s));
  if constexpr (Derivatives) {
    SphereSpringSums<N>& c = s.spring;
    c.k_a = c.k_turn = zero3<N>();
    c.y = N(0.0);
    c.a_n = c.n_an = c.n_r = c.t_at = c.b_at = zero33<N>();
  }
}

template <class N>
struct ElasticSpherePass : SpherePass<N> {
  const ElasticPlace<N>* place;
  Vec3<N> a;
  Spring<N> spring;
};

template <class N>
auto find_distance(const ElasticSphereMotion<N>& z, const ElasticPlace<N>& place,
                   ElasticSpherePoint<N>& out, ElasticSpherePass<N>& pass) {
  pass.place = &place;
  return find_distance(static_cast<const SphereMotion<N>&>(z), place.xi,
                       static_cast<SpherePoint<N>&>(out), static_cast<SpherePass<N>&>(pass));
}

template <class N>
void find_slide(const ElasticSphereMotion<N>& z, const ElasticSpherePoint<N>& out,
                ElasticSpherePass<N>& pass) {
  find_velocity(static_cast<const SphereMotion<N>&>(z), out, pass);
  const Anchor<N> anchor = pass.place->anchor();
  pass.a = z.Q * anchor.a;
  pass.spring =
      stretched(z.ks, z.kt, pass.d, out.n, pass.vt, anchor.b - z.centre - pass.a, anchor.gap);
}

/// Adds the spring to what differentiate_sphere() has set. `k`: λ β k_s, `stiffness`: λ k_s, both
/// zero where nothing touches.
template <class N, class Mask>
void add_spring(const ElasticSpherePass<N>& pass, const N& k, const N& stiffness,
                const Mask& slipping, ElasticSpherePoint<N>& out) {
  const Vec3<N>& n = out.n;
  const Spring<N>& spring = pass.spring;
  const N k_kappa = k * pass.kappa, first = stiffness * spring.beta_d;
  const N y = mul_add(k_kappa, spring.eta, -k);
  out.y = y;
  out.k_a = k * pass.a;
  out.k_an = cross(out.k_a, n);
  out.k_r = k_kappa * spring.along;
  out.k_turn = mul_add(y, n, (pass.kappa * stiffness) * spring.s);
  out.g -= mul_add(first, spring.along, y * n);
  out.k -= first * cross(n, spring.along);
  if (!any(slipping)) return;
  const N along_t = first * dot(out.t, spring.along);
  out.g += along_t * out.t;
  out.k += along_t * out.b;
  out.k_at = cross(out.k_a, out.t);
  out.s_ke = out.s * out.ke - y * out.t;
}

/// Computes the force and what its derivative needs. Returns where the point slips.
template <bool Derivatives, class N>
auto find_force(const ElasticSphereMotion<N>& z, const LawParameters<N>& law,
                const ElasticSpherePass<N>& pass, ElasticSpherePoint<N>& out) {
  const N zero(0.0);
  const auto touching = pass.d < zero;
  const NormalForce<N> normal = normal_force(law, pass.d, pass.rate);
  const Grip<N> grip = gripped(law, normal, pass.spring);
  const N hold = select(touching, grip.hold, zero);
  out.f = normal.force * out.n - hold * pass.spring.w;
  out.m = cross(out.n, out.f);
  const auto slipping = touching & (grip.damper.slip > zero);
  if constexpr (!Derivatives) return slipping;
  differentiate_sphere(static_cast<const SphereMotion<N>&>(z), law, normal, grip.damper, slipping,
                       pass, hold * law.kt, out);
  const N stiffness = hold * law.ks;
  add_spring(pass, stiffness * pass.spring.beta, stiffness, slipping, out);
  return slipping;
}

/// Adds the points of a chunk in order.
template <bool Derivatives, class N>
[[gnu::noinline]] void add_chunk(ElasticSphereSums<N>& sums,
                                 const PointChunk<ElasticSpherePoint<N>>& chunk) {
  using Point = ElasticSpherePoint<N>;
  add_chunk<Derivatives>(static_cast<SphereSums<N>&>(sums), chunk);
  if constexpr (Derivatives) {
    SphereSpringSums<N>& c = sums.spring;
    const auto each = [&](auto& sum, const auto& f) {
      add_each(sum, chunk.point, chunk.touching, chunk.count, f);
    };
    const auto slipping = [&](auto& sum, const auto& f) {
      add_each(sum, chunk.point, chunk.slipping, chunk.slips, f);
    };
    each(c.k_a, [](Vec3<N>& v, const Point& p) { v += p.k_a; });
    each(c.k_turn, [](Vec3<N>& v, const Point& p) { v += p.k_turn; });
    each(c.y, [](N& y, const Point& p) { y += p.y; });
    each(c.a_n, [](Mat3<N>& m, const Point& p) { add_outer(m, p.k_a, p.n); });
    each(c.n_an, [](Mat3<N>& m, const Point& p) { add_outer(m, p.n, p.k_an); });
    each(c.n_r, [](Mat3<N>& m, const Point& p) { add_outer(m, p.n, p.k_r); });
    slipping(c.t_at, [](Mat3<N>& m, const Point& p) { add_outer(m, p.t, p.k_at); });
    slipping(c.b_at, [](Mat3<N>& m, const Point& p) { add_outer(m, p.b, p.k_at); });
  }
}

/// Adds wrench, stiffness and damping of the pair about body 1's origin.
template <bool Derivatives, class N>
void add_finished(const ElasticSphereMotion<N>& z, const Vec6<N>& W, const ElasticSphereSums<N>& s,
                  PairSums<N>& out) {
  add_finished<Derivatives>(static_cast<const SphereMotion<N>&>(z), W,
                            static_cast<const SphereSums<N>&>(s), out);
  if constexpr (Derivatives) {
    const SphereSpringSums<N>& k = s.spring;
    const Mat3<N> f_c = -(diagonal(k.y) + k.n_r), f_theta = -(skew(k.k_a) + k.n_an + k.t_at);
    const Mat3<N> m_c = (-z.radius) * skew(k.k_turn),
                  m_theta = z.radius * (trace_less(k.a_n) - k.b_at);
    const Mat3<N> moment_c = cross_columns(z.centre, f_c) + m_c;
    out.k[1][1] += f_c;
    out.k[1][0] += f_theta - times_skew(f_c, z.centre);
    out.k[0][1] += moment_c;
    out.k[0][0] += cross_columns(z.centre, f_theta) + m_theta - times_skew(moment_c, z.centre);
  }
}

}  // namespace tangere::kernels
