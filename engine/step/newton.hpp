// SPDX-License-Identifier: Apache-2.0
// Masked Newton on one stage of a group of eight environments (docs/solver.md).
#pragma once

#include <array>

#include "engine/step/batch.hpp"
#include "engine/step/workspace.hpp"

namespace tangere {

struct NewtonLimits {
  double tolerance;    ///< on the scaled residual
  int max_iterations;  ///< largest number of Newton directions
  int max_halvings;    ///< per direction
  int patience;        ///< directions in a row that may bring no new lowest residual
};

/// How the solve went, per lane. Lanes that were not requested keep their values.
struct NewtonReport {
  std::array<StepStatus, kernels::kGroup> status{};
  std::array<int, kernels::kGroup> iterations{};   ///< evaluations of the residual, accumulated
  std::array<double, kernels::kGroup> residual{};  ///< scaled residual at the last accepted point
  LaneBits passed = 0;   ///< lanes in which a body came through another that it touches
  LaneBits created = 0;  ///< lanes in which a part created energy, however short it was
};

/// Solves g(x) = 0 for the lanes in `lanes`, from the x in the stage. On return the stage's x and v
/// hold the solution of converged lanes. Returns the lanes that converged; the others have a
/// failure in `report.status`.
template <int L>
LaneBits solve_stage(const CompiledModel& model, const kernels::KernelTable& table,
                     BasicWorkspace<L>& w, LaneBits lanes, const NewtonLimits& limits,
                     NewtonReport& report);

/// Computes the scaled residual at another x of a solved stage. The stage keeps that x.
template <int L>
void residual_elsewhere(const CompiledModel& model, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, LaneBits lanes, NewtonReport& report,
                        kernels::Row<L>& out);

}  // namespace tangere
