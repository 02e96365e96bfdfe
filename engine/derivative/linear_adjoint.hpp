// SPDX-License-Identifier: Apache-2.0
// The linearly implicit step in reverse. x = x_p - s, s = A(x_p)⁻¹ g(x_p). A itself depends on what
// the step begins with, so every derivative G_z of g enters as Ĝ_z = G_z - (dG_z/dx) s. That is the
// value minus the tangent at x_p + ε s:
//   x̄ = Jᵀ(x) q̄ + v̄/h,  Aᵀ λ = x̄,  x̄_p = x̄ - Ĝ_xᵀ λ
//   v̄₀ += h x̄_p - Ĝ_v₀ᵀ λ,  q̄₀ += exp(x) q̄ - Ĝ_q₀ᵀ λ,  ū -= Ĝ_uᵀ λ,  p̄ -= Ĝ_pᵀ λ
//       (x_p = h v₀, v = x/h)
#pragma once

#include "engine/derivative/group_adjoint.hpp"

namespace tangere {

/// Writes x̄ of one loss to a.rhs. x is in a.difference.
template <int L>
void linear_rhs(const CompiledModel& m, const LossRows<L>& o, double h, AdjointWorkspace<L>& a);

/// Adds the cotangents of the starting state, motors and numbers in one lane. λ is in a.lambda, x̄
/// in a.rhs.
template <int L>
void hand_on_linear(const CompiledModel& m, const LossRows<L>& o, double h, int lane,
                    const BasicWorkspace<L>& w, AdjointWorkspace<L>& a);

}  // namespace tangere
