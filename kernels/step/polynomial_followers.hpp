// SPDX-License-Identifier: Apache-2.0
// Dofs that follow another by a polynomial p. With q_l = c_l + x_l and ẋ_l of the leader,
//   q = p(q_l),  v = p' ẋ_l,  a by the scheme from v
// as a spherical joint's velocity goes by its chart, with J = p' and V_x = p'' ẋ_l + p' c₀/h. The
// sweeps see x and r that give q and v. Columns of A go by J and V_x already, so
//   g_r = g_l + p' g;   A_r: rows of the follower times p', its columns as they are, and
//       p'' g on the leader's diagonal
#pragma once

#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// Sets x and r of these dofs at the leader's x, and the charts of their links.
template <class N>
void polynomial_motions(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_polynomials; ++i) {
    const PolynomialFollower& f = model.polynomials[i];
    const N& x = a.x[f.leader_v];
    const N rate = mul_add(a.c0_over_h, x, a.inverse_h * a.r[f.leader_v]);
    const PolynomialValue<N> p = polynomial_at(f.coefficients, N(a.centre[f.leader_q] + x));
    const N own = p.value - a.centre[f.q];
    a.own_x[f.v] = own;
    a.own_r[f.v] = (p.slope * rate - a.c0_over_h * own) / a.inverse_h;
    LinkScratch<N>& o = a.links[f.link];
    o.chart.m[0][0] = p.slope;
    o.chart_rate.m[0][0] = mul_add(p.second, rate, a.c0_over_h * p.slope);
    a.polynomials[i] = {p.slope, p.second, N(0.0)};
  }
}

/// Adds their g to the leaders', and keeps it.
template <class N>
void fold_polynomial_residual(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_polynomials; ++i) {
    const PolynomialFollower& f = model.polynomials[i];
    PolynomialScratch<N>& p = a.polynomials[i];
    p.force = a.g[f.v];
    a.g[f.leader_v] = mul_add(p.slope, p.force, a.g[f.leader_v]);
    a.force_scale[f.leader_v] =
        mul_add(abs(p.slope), a.force_scale[f.v], a.force_scale[f.leader_v]);
    a.g[f.v] = a.force_scale[f.v] = N(0.0);
  }
}

/// The mass of a follower in norms: its own is that of its leaders.
inline constexpr double kFollowerMass = 1e-30;

/// Adds their rows of A, and the diagonal of their mass, to the leaders'.
template <class N>
void fold_polynomial_jacobian(const ModelView& model, const StageArgs<N>& a) {
  for (int k = 0; k < model.n_sloped; ++k) {
    const SlopedEntry& e = model.sloped[k];
    const N factor = N(e.factor) * a.polynomials[e.follower].slope;
    a.A[e.target] = mul_add(factor, a.A[e.source], a.A[e.target]);
  }
  for (int i = 0; i < model.n_polynomials; ++i) {
    const PolynomialFollower& f = model.polynomials[i];
    const PolynomialScratch<N>& p = a.polynomials[i];
    N& mass = a.mass_diagonal[f.leader_v];
    mass = mul_add(p.slope * p.slope, a.mass_diagonal[f.v], mass);
    N& diagonal = a.A[model.pattern.diagonal_entry[f.leader_v]];
    diagonal = mul_add(p.second, p.force, diagonal);
    a.mass_diagonal[f.v] = N(kFollowerMass);
    a.A[model.pattern.diagonal_entry[f.v]] = a.c0_over_h * a.c0_over_h * N(kFollowerMass);
  }
}

/// ν_l += p' ν; then ν = 0: v depends on the leader's history, not on its own.
template <class N>
void hand_on_polynomial_rates(const ModelView& model, const StageArgs<N>& a, N* nu) {
  for (int i = 0; i < model.n_polynomials; ++i) {
    const PolynomialFollower& f = model.polynomials[i];
    nu[f.leader_v] = mul_add(a.polynomials[i].slope, nu[f.v], nu[f.leader_v]);
    nu[f.v] = N(0.0);
  }
}

}  // namespace tangere::kernels
