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
  int patience;        ///< consecutive directions without a new lowest residual before giving up
  /// Skip the last evaluation if the measured contraction predicts that it meets the tolerance.
  bool skip_final_evaluation;
};

/// Factors and contraction rates that later stages of a step reuse.
template <int L>
struct StageFactors {
  bool weighted = false;          ///< the norm's weights are those of this step
  bool floored = false;           ///< and its floor
  LaneBits lanes = kNoLane;       ///< lanes with a factor at hand
  LaneBits any = kNoLane;         ///< lanes that were factored in this step
  LaneBits pivoted = kNoLane;     ///< lanes in which that is the pivoted one
  std::array<double, L> share{};  ///< of the residual that a step by that factor left
  std::array<double, L> start{};  ///< residual at the first point of the stage before

  /// The next stage begins as if it were the first. Factors that were made stay known.
  void begin_anew() {
    weighted = floored = false;
    lanes = kNoLane;
  }
};

/// How the solve went, per lane. Lanes that were not requested keep their values.
struct NewtonReport {
  std::array<StepStatus, kernels::kGroup> status{};
  std::array<int, kernels::kGroup> iterations{};  ///< evaluations of the residual, accumulated
  /// Scaled residual at the last accepted point; the expected one where its evaluation was spared.
  std::array<double, kernels::kGroup> residual{};
};

/// Solves g(x) = 0 for the lanes in `lanes`, from the x in the stage. On return the stage's x and v
/// hold the solution of converged lanes. Returns the lanes that converged; the others have a
/// failure in `report.status`. `factors`: of the stages before, which must have the same c₀.
template <int L>
LaneBits solve_stage(const CompiledModel& model, const kernels::KernelTable& table,
                     BasicWorkspace<L>& w, LaneBits lanes, const NewtonLimits& limits,
                     StageFactors<L>& factors, NewtonReport& report);

/// Evaluates g at the stage's present x, r and s, which may be others than those of the last solve.
template <int L>
void evaluate_elsewhere(const CompiledModel& model, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, LaneBits lanes, NewtonReport& report);
/// Computes the scaled norm of g as it is.
template <int L>
void scaled_residual(const CompiledModel& model, const kernels::KernelTable& table,
                     const BasicWorkspace<L>& w, kernels::Row<L>& out);
/// Computes out = A⁻¹ g by the last factor of the lanes `factors.any`; others have no meaning.
template <int L>
void solve_by_factor(const CompiledModel& model, const kernels::KernelTable& table,
                     BasicWorkspace<L>& w, const StageFactors<L>& factors, kernels::Row<L>* out);

}  // namespace tangere
