// SPDX-License-Identifier: Apache-2.0
// Points of body 1 against faces: planes, cuboids and cylinders. Their surface bends in at most one
// direction.
//
// Inside, H = κ a aᵀ, where a is the unit vector around a cylinder's side (κ = 0 on flat faces).
// Everything is in body 1's axes. ε = (θ; ρ), δW and the other symbols are as in
// kernels/contact/pair_contact.hpp. A vector b at a place x is written as the wrench
// b̃ = (x × b; b), so that b·(ρ + θ × x) = b̃·ε. At the surface point x = ξ - d n, with
// h = a·(ρ + θ × ξ):
//   δd = -ñ·ε,  δn = θ × n - κ a h,  δx = n (ñ·ε) - d δn,  δu = -Γ δW - ω × δx
//   ∂f/∂u = α nᵀ + s t tᵀ - s I,  α = A n - γ t,  A = ∂N/∂ḋ + s,  γ = μ ∂B/∂ḋ,  m = N + ḋ s
//   M v = m v - d s ω × v + α (v_t + d n × ω)·v + s t (-ḋ t + d t × ω)·v
//     where M v is what δn = v ⊥ n does to f
// so that δf = p (ñ·ε) + M(θ × n) + r h - ∂f/∂u Γ δW, with
//   p = -∂N/∂d n + μ ∂B/∂d t + s (ω × n) - s t (t·(ω × n)),  r = -κ M a
//   M(θ × n) = m θ × n + d s (n ωᵀ - (n·ω) I) θ + α e·θ + s t e_t·θ
//   e = n × v_t + d (n (n·ω) - ω),  e_t = d (n·ω) t - ḋ n × t
// and moments gain δx × f = (n × f)(ñ·ε) - d (θ × n) × f + d κ (a × f) h. Derivation:
// docs/contact.md.
#pragma once

#include "kernels/contact/pair_contact.hpp"
#include "kernels/contact/point_chunk.hpp"

namespace tangere::kernels {

template <class N, bool Bent>
struct FacePoint;
template <class N>
struct FacePass;
template <class N>
struct FaceSums;

/// A shape's frame and twist W relative to body 1, in body 1's axes.
template <template <class> class Shape, class N>
struct FaceMotion {
  static constexpr bool kBent = Shape<N>::kBending == Bending::rod;
  using Place = Vec3<N>;
  using Point = FacePoint<N, kBent>;
  using Pass = FacePass<N>;
  using Sums = FaceSums<N>;
  template <class M>
  using Of = FaceMotion<Shape, M>;
  Frame<N> frame;
  Vec6<N> W;
  [[no_unique_address]] Shape<N> shape;
};

template <template <class> class Shape, class N>
const FaceMotion<Shape, N>& with_law(const FaceMotion<Shape, N>& z, const LawParameters<N>&) {
  return z;
}

/// What one point adds to the sums. All are exact zeros if it does not touch. The struct consists
/// of numbers only, in this order: those of the value, those of the derivative, those that only
/// slipping points set, those that only bent faces set.
template <class N, bool Bent>
struct FacePoint {
  using Number = N;
  static constexpr bool kBends = Bent, kElastic = false;
  Vec3<N> f, xf;            ///< force, x × f
  Vec3<N> n, xn, an, axn;   ///< ñ and A ñ
  Vec3<N> p, xp, e;         ///< p and x × p + n × f; e
  Vec3<N> x, sx, mn, turn;  ///< x, s x, m n, m x + d f
  Vec3<N> dn, dxn, dwx;     ///< d s ñ; d s (n·ω) x
  N s;
  Vec3<N> t, xt, st, sxt, gt, gxt, e_slip;  ///< t̃, s t̃, γ t̃, s e_t - γ e
  Vec3<N> a, xa, r, xr;                     ///< a and ξ × a; r and x × r + d κ a × f

  static constexpr int kValues = 6, kDerivatives = kValues + 43, kSlipping = kDerivatives + 21;
  static constexpr int kBent = kSlipping + (Bent ? 12 : 0), kNumbers = kSlipping + 12;
};

/// Sum of products of two wrenches, in blocks {torque, force} × {angular, linear}.
template <class N>
struct ProductSums {
  Mat3<N> m[2][2];
};
template <class N>
struct SymmetricSums {
  UpperTriangle<N> aa, ll;
  Mat3<N> al;
};
/// Σ s, Σ s x, Σ s x xᵀ, Σ m n.
template <class N>
struct MomentSums {
  N s;
  Vec3<N> sx, mn;
  UpperTriangle<N> sxx;
};
/// Σ n (m x + d f)ᵀ, Σ d s n, Σ d s x × n, Σ d s (n·ω) x.
template <class N>
struct TurnSums {
  Mat3<N> n_turn;
  Vec3<N> dn, dxn, dwx;
};

/// Every sum runs over the points in order, so chunks may be cut anywhere. What all touching points
/// add and what slipping points add are kept apart until the end.
template <class N>
struct FaceSums {
  Vec3<N> f, xf;
  SymmetricSums<N> nn, tt;  ///< Σ A ñ ñᵀ, Σ s t̃ t̃ᵀ
  ProductSums<N> pn, tn;    ///< Σ p̃ ñᵀ + r̃ ãᵀ, Σ γ t̃ ñᵀ
  Mat3<N> ne[2], te[2];     ///< Σ A ñ eᵀ, Σ t̃ (s e_t - γ e)ᵀ: torque, force
  MomentSums<N> moments;
  TurnSums<N> turns;
};

template <class N>
void clear(SymmetricSums<N>& s) {
  for (int i = 0; i < 6; ++i) s.aa.m[i] = s.ll.m[i] = N(0.0);
  s.al = zero33<N>();
}
template <bool Derivatives, class N>
void clear(FaceSums<N>& s) {
  s.f = s.xf = zero3<N>();
  if constexpr (Derivatives) {
    clear(s.nn);
    clear(s.tt);
    for (int i = 0; i < 2; ++i) {
      for (int j = 0; j < 2; ++j) s.pn.m[i][j] = s.tn.m[i][j] = zero33<N>();
      s.ne[i] = s.te[i] = zero33<N>();
    }
    s.moments.s = N(0.0);
    for (N& x : s.moments.sxx.m) x = N(0.0);
    s.moments.sx = s.moments.mn = s.turns.dn = s.turns.dxn = s.turns.dwx = zero3<N>();
    s.turns.n_turn = zero33<N>();
  }
}

/// Intermediate results of the three passes of a chunk.
template <class N>
struct FacePass {
  Vec3<N> xi, n, x, vt, a;
  N d, kappa, rate, square, inverse_speed;
};

template <template <class> class Shape, class N>
auto find_distance(const FaceMotion<Shape, N>& z, const Vec3<N>& xi,
                   typename FaceMotion<Shape, N>::Point&, FacePass<N>& pass)
    -> decltype(xi.x < xi.y) {
  const Mat3<N>& Q = z.frame.R;
  const Vec3<N> y = transposed_times(Q, xi - z.frame.p);
  if constexpr (FaceMotion<Shape, N>::kBent) {
    const auto inside = z.shape.may_hold(y);
    if (!any(inside)) return inside;
  }
  const Distance<N> at = z.shape.inside(y, pass.kappa);
  pass.xi = xi;
  pass.d = at.d;
  pass.n = Q * at.n;
  if constexpr (FaceMotion<Shape, N>::kBent)
    pass.a = cross(Vec3<N>{Q.m[0][2], Q.m[1][2], Q.m[2][2]}, pass.n);
  return at.d < N(0.0);
}

template <template <class> class Shape, class N>
void find_velocity(const FaceMotion<Shape, N>& z, FacePass<N>& pass) {
  pass.x = pass.xi - pass.d * pass.n;
  const Vec3<N> u = -(z.W.l + cross(z.W.a, pass.x));
  pass.rate = dot(pass.n, u);
  pass.vt = u - pass.rate * pass.n;
}

template <template <class> class Shape, class N>
void find_slide(const FaceMotion<Shape, N>& z, const typename FaceMotion<Shape, N>::Point&,
                FacePass<N>& pass) {
  find_velocity(z, pass);
  pass.square = dot(pass.vt, pass.vt);
  pass.inverse_speed = inverse_sqrt(pass.square);
}

/// Sets r̃ and ã of a bent face where nothing slips. `out` already has f, x and s.
template <class N>
void bend(const Vec3<N>& omega, const FacePass<N>& pass, const N& m, const N& slope,
          FacePoint<N, true>& out) {
  const Vec3<N>& a = pass.a;
  const N q = dot(a, pass.vt) + pass.d * dot(a, cross(pass.n, omega));
  const Vec3<N> Ma = m * a - (pass.d * out.s) * cross(omega, a) + (slope * q) * pass.n;
  out.r = (-pass.kappa) * Ma;
  out.a = a;
  out.xa = cross(pass.xi, a);
}

/// Adds what slipping contributes to p and sets the numbers of slipping points in `out`. `gamma`
/// and `gamma_d` are μ ∂B/∂ḋ and μ ∂B/∂d. All are zero where nothing slips.
template <bool Bent, class N>
void slip(const Vec3<N>& omega, const FacePass<N>& pass, const Vec3<N>& t, const N& gamma,
          const N& gamma_d, FacePoint<N, Bent>& out) {
  const N& d = pass.d;
  out.t = t;
  out.xt = cross(pass.x, t);
  out.st = out.s * t;
  out.sxt = out.s * out.xt;
  out.gt = gamma * t;
  out.gxt = gamma * out.xt;
  const Vec3<N> e_t = (d * dot(pass.n, omega)) * t - pass.rate * cross(pass.n, t);
  out.e_slip = out.s * e_t - gamma * out.e;
  out.p += (gamma_d - out.s * dot(t, cross(omega, pass.n))) * t;
  if constexpr (Bent) {
    const Vec3<N>& a = pass.a;
    const N q = dot(a, pass.vt) + d * dot(a, cross(pass.n, omega));
    const N q_t = d * dot(a, cross(t, omega)) - pass.rate * dot(a, t);
    out.r -= (pass.kappa * mul_sub_from(gamma, q, out.s * q_t)) * t;
  }
}

/// Sets what the derivative needs but the moments of p and r. `out` already has f. `m` as above.
template <template <class> class Shape, class N, class Mask>
void differentiate_face(const FaceMotion<Shape, N>& z, const LawParameters<N>& law,
                        const NormalForce<N>& normal, const Friction<N>& friction_at,
                        const Mask& slipping, const FacePass<N>& pass, const N& s, const N& m,
                        typename FaceMotion<Shape, N>::Point& out) {
  const Vec3<N>&n = pass.n, &x = pass.x, &omega = z.W.a;
  const N& d = pass.d;
  const N slope = normal.rate_slope + s, ds = d * s;
  const N spin = dot(n, omega);
  out.s = s;
  out.n = n;
  out.xn = cross(x, n);
  out.an = slope * n;
  out.axn = slope * out.xn;
  out.e = cross(n, pass.vt) + d * (spin * n - omega);
  out.x = x;
  out.sx = s * x;
  out.mn = m * n;
  out.turn = mul_add(m, x, d * out.f);
  out.dn = ds * n;
  out.dxn = ds * out.xn;
  out.dwx = (ds * spin) * x;
  out.p = s * cross(omega, n) - normal.d_slope * n;
  if constexpr (FaceMotion<Shape, N>::kBent) bend(omega, pass, m, slope, out);
  if (any(slipping)) {
    const N gate = select(slipping, N(1.0), N(0.0));
    slip(omega, pass, gate * friction_at.direction, gate * (law.mu * normal.bound_rate),
         gate * (law.mu * normal.bound_d), out);
  }
}

/// Sets the moments of p and r.
template <bool Bent, class N>
void finish_moments(const FacePass<N>& pass, FacePoint<N, Bent>& out) {
  out.xp = cross(pass.x, out.p) + cross(pass.n, out.f);
  if constexpr (Bent) out.xr = cross(pass.x, out.r) + (pass.d * pass.kappa) * cross(pass.a, out.f);
}

/// Computes the force and what its derivative needs. Returns where the point slips.
template <bool Derivatives, template <class> class Shape, class N>
auto find_force(const FaceMotion<Shape, N>& z, const LawParameters<N>& law, const FacePass<N>& pass,
                typename FaceMotion<Shape, N>::Point& out) {
  const N zero(0.0);
  const auto touching = pass.d < zero;
  const NormalForce<N> normal = normal_force(law, pass.d, pass.rate);
  const Friction<N> friction_at = friction(law, normal, pass.vt, pass.square, pass.inverse_speed);
  const N s = select(touching, friction_at.scale, zero);
  out.f = normal.force * pass.n - s * pass.vt;
  out.xf = cross(pass.x, out.f);
  const auto slipping = touching & (friction_at.slip > zero);
  if constexpr (!Derivatives) return slipping;
  differentiate_face(z, law, normal, friction_at, slipping, pass, s,
                     mul_add(pass.rate, s, normal.force), out);
  finish_moments(pass, out);
  return slipping;
}

/// Adds the points of a chunk in order.
template <bool Derivatives, class Point, class N>
[[gnu::noinline]] void add_chunk(FaceSums<N>& sums, const PointChunk<Point>& chunk) {
  constexpr bool Bent = Point::kBends;
  const auto each = [&](auto& sum, const auto& f) {
    add_each(sum, chunk.point, chunk.touching, chunk.count, f);
  };
  const auto slipping = [&](auto& sum, const auto& f) {
    add_each(sum, chunk.point, chunk.slipping, chunk.slips, f);
  };
  each(sums.f, [](Vec3<N>& f, const Point& p) { f += p.f; });
  each(sums.xf, [](Vec3<N>& m, const Point& p) { m += p.xf; });
  if constexpr (Derivatives) {
    each(sums.nn, [](SymmetricSums<N>& m, const Point& p) {
      add_upper(m.aa, p.axn, p.xn);
      add_upper(m.ll, p.an, p.n);
      add_outer(m.al, p.axn, p.n);
    });
    const auto add_p = [&](Vec3<N> Point::*left, Vec3<N> Point::*right, Vec3<N> Point::*bent_left,
                           Vec3<N> Point::*bent_right, Mat3<N>& sum) {
      each(sum, [=](Mat3<N>& m, const Point& p) {
        add_outer(m, p.*left, p.*right);
        if constexpr (Bent) add_outer(m, p.*bent_left, p.*bent_right);
      });
    };
    add_p(&Point::xp, &Point::xn, &Point::xr, &Point::xa, sums.pn.m[0][0]);
    add_p(&Point::xp, &Point::n, &Point::xr, &Point::a, sums.pn.m[0][1]);
    add_p(&Point::p, &Point::xn, &Point::r, &Point::xa, sums.pn.m[1][0]);
    add_p(&Point::p, &Point::n, &Point::r, &Point::a, sums.pn.m[1][1]);
    each(sums.ne[0],
         [](Mat3<N>& m, const Point& p) { add_outer(m, Point::kElastic ? p.xn : p.axn, p.e); });
    each(sums.ne[1],
         [](Mat3<N>& m, const Point& p) { add_outer(m, Point::kElastic ? p.n : p.an, p.e); });
    each(sums.moments, [](MomentSums<N>& m, const Point& p) {
      m.s += p.s;
      m.sx += p.sx;
      m.mn += p.mn;
      add_upper(m.sxx, p.sx, p.x);
    });
    each(sums.turns, [](TurnSums<N>& m, const Point& p) {
      add_outer(m.n_turn, p.n, p.turn);
      m.dn += p.dn;
      m.dxn += p.dxn;
      m.dwx += p.dwx;
    });
    if (chunk.slips > 0) {
      slipping(sums.tt, [](SymmetricSums<N>& m, const Point& p) {
        add_upper(m.aa, p.sxt, p.xt);
        add_upper(m.ll, p.st, p.t);
        add_outer(m.al, p.sxt, p.t);
      });
      slipping(sums.tn.m[0][0], [](Mat3<N>& m, const Point& p) { add_outer(m, p.gxt, p.xn); });
      slipping(sums.tn.m[0][1], [](Mat3<N>& m, const Point& p) { add_outer(m, p.gxt, p.n); });
      slipping(sums.tn.m[1][0], [](Mat3<N>& m, const Point& p) { add_outer(m, p.gt, p.xn); });
      slipping(sums.tn.m[1][1], [](Mat3<N>& m, const Point& p) { add_outer(m, p.gt, p.n); });
      slipping(sums.te[0], [](Mat3<N>& m, const Point& p) { add_outer(m, p.xt, p.e_slip); });
      slipping(sums.te[1], [](Mat3<N>& m, const Point& p) { add_outer(m, p.t, p.e_slip); });
    }
  }
}

/// Returns the trace of M times the unit matrix, minus M.
template <class N>
Mat3<N> trace_less(const Mat3<N>& m) {
  return diagonal(m.m[0][0] + m.m[1][1] + m.m[2][2]) - m;
}

/// Adds wrench, stiffness and damping of all faces with the same motion. Without the attribute GCC
/// makes it a call in some callers: 1 to 3 % of the time of a step of eight environments.
template <bool Derivatives, class N>
[[gnu::always_inline]] inline void add_finished(const Vec6<N>& W, const FaceSums<N>& s,
                                                PairSums<N>& out) {
  out.wrench.l += s.f;
  out.wrench.a += s.xf;
  if constexpr (Derivatives) {
    const MomentSums<N>& c = s.moments;
    const TurnSums<N>& t = s.turns;
    out.k[1][1] += s.pn.m[1][1];
    out.k[0][1] += s.pn.m[0][1];
    out.k[1][0] +=
        s.pn.m[1][0] + s.ne[1] + s.te[1] - skew(c.mn) + outer(t.dn, W.a) - diagonal(dot(W.a, t.dn));
    out.k[0][0] +=
        s.pn.m[0][0] + s.ne[0] + s.te[0] + trace_less(t.n_turn) + outer(t.dxn, W.a) - skew(t.dwx);
    // -(A ñ ñᵀ - γ t̃ ñᵀ + s t̃ t̃ᵀ - s ΓᵀΓ), ΓᵀΓ = {|x|² I - x xᵀ, [x]; -[x], I}
    const Mat3<N> al = s.nn.al + s.tt.al, sx = skew(c.sx);
    out.d[0][0] += s.tn.m[0][0] - full(s.nn.aa) - full(s.tt.aa) + trace_less(full(c.sxx));
    out.d[0][1] += s.tn.m[0][1] - al + sx;
    out.d[1][0] += s.tn.m[1][0] - transpose(al) - sx;
    out.d[1][1] += s.tn.m[1][1] - full(s.nn.ll) - full(s.tt.ll) + diagonal(c.s);
  }
}

}  // namespace tangere::kernels
