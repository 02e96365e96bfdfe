// SPDX-License-Identifier: Apache-2.0
// Points with shear springs against faces: the sums of kernels/contact/face_contact.hpp with the
// additional terms of the spring.
//
// Symbols are those of that file and of kernels/contact/elastic_contact.hpp. The damper has s =
// λ k_t and t = w/|w|. With k = λ β k_s the spring adds to δf
//   k (I - n nᵀ - t tᵀ)(ρ + θ × A) + k η (δn - t (t·δn)) + k n (r·δn) + λ k_s σ (ñ·ε)
//   σ = β'_d (P r - t (t·P r))
// so that, with δn = θ × n - κ a h,
//   m gains k η,  p gains λ k_s σ - k n,  A e gains k n × (b - x),
//   s e_t - γ e gains k (x - A) × t - k η n × t,  r gains -κ k (r·a) n + κ k η (a·t) t
// and two sums are new: Σ k (x × (ρ + θ × A); ρ + θ × A) and -Σ k t̃ t̃ᵀ, both by ε alone.
#pragma once

#include "kernels/contact/elastic_contact.hpp"
#include "kernels/contact/face_contact.hpp"

namespace tangere::kernels {

template <class N, bool Bent>
struct ElasticFacePoint;
template <class N>
struct ElasticFacePass;
template <class N>
struct ElasticFaceSums;

template <template <class> class Shape, class N>
struct ElasticFaceMotion : FaceMotion<Shape, N> {
  using Place = ElasticPlace<N>;
  using Point = ElasticFacePoint<N, FaceMotion<Shape, N>::kBent>;
  using Pass = ElasticFacePass<N>;
  using Sums = ElasticFaceSums<N>;
  template <class M>
  using Of = ElasticFaceMotion<Shape, M>;
  N kt, ks;
};

template <template <class> class Shape, class N>
ElasticFaceMotion<Shape, N> with_law(const ElasticFaceMotion<Shape, N>& z,
                                     const LawParameters<N>& law) {
  return {static_cast<const FaceMotion<Shape, N>&>(z), law.kt, law.ks};
}

/// The numbers of the spring follow those of FacePoint: those of the derivative, then those that
/// only slipping points set.
template <class N, bool Bent>
struct ElasticFacePoint : FacePoint<N, Bent> {
  Vec3<N> k_anchor, k_place;  ///< k A, k x
  N k;
  Vec3<N> k_t, k_xt;  ///< k t̃

  static constexpr bool kElastic = true;
  static constexpr int kSpring = FacePoint<N, Bent>::kNumbers, kSpringSlipping = kSpring + 7,
                       kNumbers = kSpringSlipping + 6;
};

/// Σ k A, Σ k x, Σ k, Σ k A xᵀ, Σ k t̃ t̃ᵀ.
template <class N>
struct FaceSpringSums {
  Vec3<N> anchor, place;
  N k;
  Mat3<N> anchor_place;
  SymmetricSums<N> tt;
};
template <class N>
struct ElasticFaceSums : FaceSums<N> {
  FaceSpringSums<N> spring;
};

template <bool Derivatives, class N>
void clear(ElasticFaceSums<N>& s) {
  clear<Derivatives>(static_cast<FaceSums<N>&>(s));
  if constexpr (Derivatives) {
    s.spring.anchor = s.spring.place = zero3<N>();
    s.spring.k = N(0.0);
    s.spring.anchor_place = zero33<N>();
    clear(s.spring.tt);
  }
}

template <class N>
struct ElasticFacePass : FacePass<N> {
  const ElasticPlace<N>* place;
  Vec3<N> A;
  Spring<N> spring;
};

template <template <class> class Shape, class N>
auto find_distance(const ElasticFaceMotion<Shape, N>& z, const ElasticPlace<N>& place,
                   typename ElasticFaceMotion<Shape, N>::Point& out, ElasticFacePass<N>& pass) {
  const FaceMotion<Shape, N>& plain = z;
  pass.place = &place;
  return find_distance(plain, place.xi, out, static_cast<FacePass<N>&>(pass));
}

template <template <class> class Shape, class N>
void find_slide(const ElasticFaceMotion<Shape, N>& z,
                const typename ElasticFaceMotion<Shape, N>::Point&, ElasticFacePass<N>& pass) {
  const FaceMotion<Shape, N>& plain = z;
  find_velocity(plain, pass);
  const Anchor<N> anchor = pass.place->anchor();
  pass.A = z.frame.p + z.frame.R * anchor.a;
  pass.spring = stretched(z.ks, z.kt, pass.d, pass.n, pass.vt, anchor.b - pass.A, anchor.gap);
}

/// Adds the spring to what differentiate_face() has set. `k`: λ β k_s, `first`: λ k_s β'_d, both
/// zero where nothing touches.
template <bool Bent, class N, class Mask>
void add_spring(const ElasticFacePass<N>& pass, const N& slope, const N& k, const N& first,
                const Mask& slipping, ElasticFacePoint<N, Bent>& out) {
  const Vec3<N>& n = pass.n;
  const Spring<N>& spring = pass.spring;
  const Vec3<N> arm = pass.x - pass.A;
  const N k_eta = k * spring.eta;
  out.k = k;
  out.k_anchor = k * pass.A;
  out.k_place = k * pass.x;
  out.p += first * spring.along - k * n;
  out.e = mul_add(slope, out.e, k * cross(n, spring.r - arm));
  if constexpr (Bent) out.r -= (pass.kappa * k * dot(spring.r, pass.a)) * n;
  if (!any(slipping)) return;
  const Vec3<N>& t = out.t;
  out.p -= (first * dot(t, spring.along)) * t;
  out.e_slip += k * cross(arm, t) - k_eta * cross(n, t);
  out.k_t = k * t;
  out.k_xt = k * out.xt;
  if constexpr (Bent) out.r += (pass.kappa * k_eta * dot(pass.a, t)) * t;
}

/// Computes the force and what its derivative needs. Returns where the point slips.
template <bool Derivatives, template <class> class Shape, class N>
auto find_force(const ElasticFaceMotion<Shape, N>& z, const LawParameters<N>& law,
                const ElasticFacePass<N>& pass, typename ElasticFaceMotion<Shape, N>::Point& out) {
  const N zero(0.0);
  const auto touching = pass.d < zero;
  const NormalForce<N> normal = normal_force(law, pass.d, pass.rate);
  const Grip<N> grip = gripped(law, normal, pass.spring);
  const N hold = select(touching, grip.hold, zero), s = hold * law.kt;
  out.f = normal.force * pass.n - hold * pass.spring.w;
  out.xf = cross(pass.x, out.f);
  const auto slipping = touching & (grip.damper.slip > zero);
  if constexpr (!Derivatives) return slipping;
  const FaceMotion<Shape, N>& plain = z;
  const N stiffness = hold * law.ks, k = stiffness * pass.spring.beta;
  const N m = mul_add(k, pass.spring.eta, mul_add(pass.rate, s, normal.force));
  differentiate_face(plain, law, normal, grip.damper, slipping, pass, s, m, out);
  add_spring(pass, normal.rate_slope + s, k, stiffness * pass.spring.beta_d, slipping, out);
  finish_moments(pass, out);
  return slipping;
}

/// Adds the points of a chunk in order.
template <bool Derivatives, class Point, class N>
[[gnu::noinline]] void add_chunk(ElasticFaceSums<N>& sums, const PointChunk<Point>& chunk) {
  add_chunk<Derivatives>(static_cast<FaceSums<N>&>(sums), chunk);
  if constexpr (Derivatives) {
    FaceSpringSums<N>& spring = sums.spring;
    add_each(spring, chunk.point, chunk.touching, chunk.count,
             [](FaceSpringSums<N>& m, const Point& p) {
               m.anchor += p.k_anchor;
               m.place += p.k_place;
               m.k += p.k;
               add_outer(m.anchor_place, p.k_anchor, p.x);
             });
    add_each(spring.tt, chunk.point, chunk.slipping, chunk.slips,
             [](SymmetricSums<N>& m, const Point& p) {
               add_upper(m.aa, p.k_xt, p.xt);
               add_upper(m.ll, p.k_t, p.t);
               add_outer(m.al, p.k_xt, p.t);
             });
  }
}

/// Adds wrench, stiffness and damping of all faces with the same motion.
template <bool Derivatives, class N>
void add_finished(const Vec6<N>& W, const ElasticFaceSums<N>& s, PairSums<N>& out) {
  add_finished<Derivatives>(W, static_cast<const FaceSums<N>&>(s), out);
  if constexpr (Derivatives) {
    const FaceSpringSums<N>& c = s.spring;
    out.k[1][1] += diagonal(c.k) - full(c.tt.ll);
    out.k[0][1] += skew(c.place) - c.tt.al;
    out.k[1][0] = out.k[1][0] - skew(c.anchor) - transpose(c.tt.al);
    out.k[0][0] += trace_less(c.anchor_place) - full(c.tt.aa);
  }
}

}  // namespace tangere::kernels
