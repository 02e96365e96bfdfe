// SPDX-License-Identifier: Apache-2.0
// Systems of scenes in which dofs follow others (model_view.hpp, Follower).
#pragma once

#include <cmath>

#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// g_r = Gᵀ g, and the same of the magnitudes of forces.
template <class N>
void fold_residual(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_followers; ++i) {
    const Follower& f = model.followers[i];
    a.g[f.leader_v] = mul_add(N(f.ratio), a.g[f.v], a.g[f.leader_v]);
    a.force_scale[f.leader_v] =
        mul_add(N(std::abs(f.ratio)), a.force_scale[f.v], a.force_scale[f.leader_v]);
    a.g[f.v] = a.force_scale[f.v] = N(0.0);
  }
}

/// A_r = Gᵀ A G. The diagonal entry of a follower has the units of the others.
template <class N>
void fold_jacobian(const ModelView& model, const StageArgs<N>& a) {
  for (int k = 0; k < model.n_folded; ++k) {
    const FoldedEntry& f = model.folded[k];
    a.A[f.target] = mul_add(N(f.factor), a.A[f.source], a.A[f.target]);
  }
  for (int i = 0; i < model.n_followers; ++i) {
    const Follower& f = model.followers[i];
    const N& mass = a.mass_diagonal[f.v];
    a.mass_diagonal[f.leader_v] = mul_add(N(f.ratio * f.ratio), mass, a.mass_diagonal[f.leader_v]);
    a.A[model.pattern.diagonal_entry[f.v]] = a.c0_over_h * a.c0_over_h * mass;
  }
}

}  // namespace tangere::kernels
