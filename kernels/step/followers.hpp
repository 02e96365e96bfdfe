// SPDX-License-Identifier: Apache-2.0
// Systems of scenes in which dofs follow others, by ratios (model_view.hpp, Follower) and by
// polynomials (polynomial_followers.hpp).
#pragma once

#include <cmath>

#include "kernels/step/polynomial_followers.hpp"

namespace tangere::kernels {

/// g_r = Gᵀ g, and the same of the magnitudes of forces.
template <class N>
void fold_residual(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_ties; ++i) {
    const FollowerTie& t = model.ties[i];
    a.g[t.leader_v] = mul_add(N(t.ratio), a.g[t.v], a.g[t.leader_v]);
    a.force_scale[t.leader_v] =
        mul_add(N(std::abs(t.ratio)), a.force_scale[t.v], a.force_scale[t.leader_v]);
  }
  for (int i = 0; i < model.n_followers; ++i)
    a.g[model.followers[i].v] = a.force_scale[model.followers[i].v] = N(0.0);
  fold_polynomial_residual(model, a);
}

/// A_r = Gᵀ A G, and the diagonal of the mass matrix, without the masses between dofs.
template <class N>
void fold_jacobian(const ModelView& model, const StageArgs<N>& a) {
  for (int k = 0; k < model.n_folded; ++k) {
    const FoldedEntry& f = model.folded[k];
    a.A[f.target] = mul_add(N(f.factor), a.A[f.source], a.A[f.target]);
  }
  for (int i = 0; i < model.n_ties; ++i) {
    const FollowerTie& t = model.ties[i];
    N& mass = a.mass_diagonal[t.leader_v];
    mass = mul_add(N(t.ratio * t.ratio), a.mass_diagonal[t.v], mass);
  }
  for (int i = 0; i < model.n_followers; ++i) {
    const int v = model.followers[i].v;
    a.mass_diagonal[v] = N(kFollowerMass);
    a.A[model.pattern.diagonal_entry[v]] = a.c0_over_h * a.c0_over_h * N(kFollowerMass);
  }
  fold_polynomial_jacobian(model, a);
}

}  // namespace tangere::kernels
