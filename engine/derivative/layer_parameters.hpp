// SPDX-License-Identifier: Apache-2.0
// Derivatives of the wrenches of layers by the coefficients of their contacts, by the sizes of the
// bodies that press them and by their own material. With the slip Y along λ
// (kernels/reverse/adjoint.hpp) each is -Yᵀ ∂w/∂p.
#pragma once

#include "engine/derivative/shear_adjoint.hpp"

namespace tangere {

/// Adds them to the parameters of a loss, for the assembled stage at q with its λ.
template <int L>
void add_layer_parameters(const CompiledModel& model, const kernels::KernelTable& table,
                          BasicWorkspace<L>& w, LaneBits lanes, const kernels::Row<L>* q,
                          const kernels::Row<L>* lambda, LossRows<L>& loss);

}  // namespace tangere
