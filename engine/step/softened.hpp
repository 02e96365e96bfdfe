// SPDX-License-Identifier: Apache-2.0
// Continuation in contact stiffness, for stages whose root Newton's method does not find from the
// first guess (docs/solver.md).
#pragma once

#include "engine/step/newton.hpp"

namespace tangere {

/// Solves g(x) = 0 for lanes in which solve_stage() found no root from the x in `w.x_guess`: with
/// softer contacts first, and from each root with stiffer ones. Returns the lanes that found a root
/// of their own contacts. The stage's x and v hold it.
template <int L>
LaneBits solve_from_softer(const CompiledModel& model, const kernels::KernelTable& table,
                           BasicWorkspace<L>& w, LaneBits lanes, const NewtonLimits& limits,
                           StageFactors<L>& factors, NewtonReport& report);

}  // namespace tangere
