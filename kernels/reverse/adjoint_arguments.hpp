// SPDX-License-Identifier: Apache-2.0
// Arguments and scratch of the reverse sweep (adjoint.hpp).
#pragma once

#include "kernels/step/arguments.hpp"
#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// Intermediate results of the sweeps per link, in the link's axes.
template <class N>
struct LinkAdjoint {
  Vec6<N> twist;  ///< Λ
  Vec6<N> rate;   ///< S q̇
  Vec6<N> V_bar;  ///< V̄
  Vec6<N> A_bar;  ///< Ā
};

template <class N>
struct AdjointArgs {
  const N *q_bar, *v_bar;  ///< (nv) cotangents of the stage's result, q by its right tangent
  N* rhs;                  ///< (nv) out: Jᵀ q̄ + V_xᵀ v̄
  N* lambda;               ///< (nv) the solution; adjoint_products() sets those of transmissions
  N *nu, *mass_lambda;     ///< (nv) out: ν and M λ
  N* target;      ///< (nv) out: cotangents of position motors' targets; zero where there are none
  N* dry_anchor;  ///< (nv) out: of Stage::dry_anchor; zero where there is no dry friction
  N *q_centre, *v_centre;  ///< (nv) added to
  StageHistory<N> history;
  LinkAdjoint<N>* links;  ///< (n_links) scratch
};

}  // namespace tangere::kernels
