// SPDX-License-Identifier: Apache-2.0
// Takes one step of a group of eight environments. A lane whose attempt is rejected makes others:
// by another scheme, in shorter parts, in halves (docs/solver.md).
#pragma once

#include "engine/step/attempt.hpp"
#include "engine/step/tape.hpp"

namespace tangere {

/// Solves of a step that a tape stores besides its result.
struct SolveLog {
  /// Steps of lanes that are not one plain step of the scheme.
  std::array<std::vector<TapedSolve>, kernels::kGroup> special;
  /// Inner stages of plain steps. Dof i of stage k of lane l is at [(k * nv + i) * kBlock + l].
  double* inner = nullptr;
};

/// States of a group enter and leave through the workspace's rows q0, v0, q_before, v_before.
class GroupStep {
 public:
  GroupStep(const CompiledModel& model, const StepSettings& settings)
      : model_(model), settings_(settings), solver_(model, settings) {}

  /// Advances `lanes` by one step. `history`: lanes with a valid state one step before. Afterwards
  /// q0, v0 hold the new state of every lane whose status is not a failure. Rows of other lanes are
  /// unchanged. Halves of steps are solved in `alone`, which may be `w` itself: the same bits as in
  /// the group, for less time. Starts, parts, halves and inner stages are added to `log`, unless it
  /// is null.
  template <int L>
  void advance(const kernels::KernelTable& table, BasicWorkspace<L>& w, SingleWorkspace& alone,
               LaneBits lanes, LaneBits history, NewtonReport& report,
               SolveLog* log = nullptr) const;

 private:
  const CompiledModel& model_;
  StepSettings settings_;
  AttemptSolver solver_;
};

}  // namespace tangere
