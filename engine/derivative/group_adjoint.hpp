// SPDX-License-Identifier: Apache-2.0
// Adjoint of one step of a group. Stages are reversed last to first: each is assembled and factored
// at its accepted state, then the transposed system is solved for every loss (docs/gradients.md).
#pragma once

#include <memory>

#include "engine/derivative/shear_adjoint.hpp"
#include "engine/step/group_step.hpp"

namespace tangere {

/// Scratch of one thread, besides a workspace.
template <int L>
struct AdjointWorkspace {
  using Row = kernels::Row<L>;
  AdjointWorkspace(const CompiledModel& model, int losses, bool parameters, int inner_stages);

  AlignedVector<Row> shear;
  std::vector<LossRows<L>> losses;
  // One stage: the linear system and its results in all lanes, before the mask is applied.
  Row *rhs, *lambda, *nu, *mass_lambda, *target, *dry_anchor, *difference, *q_centre, *v_centre;
  Row *q_older, *v_older;  ///< (nv) for each state that a stage may depend on, one after another
  Row* numbers = nullptr;  ///< (parameter_numbers), or null
  Row sound;
  ShearAdjoint<L> shear_adjoint;
  AlignedVector<Row> q_stage;  ///< (nq) coordinates of the current stage
};

/// Reverses solves whose states are in the workspace: q0, v0 where the solve began, q_before,
/// v_before one step earlier, q1 its result, x_inner its inner stages; the shear states before and
/// after the solve in shear.now and shear.after. tau, target and the block of parameters
/// are as in the step.
class GroupAdjoint {
 public:
  explicit GroupAdjoint(const CompiledModel& model) : model_(model) {}

  /// Adds to q_centre … target of every loss, in `lanes`.
  template <int L>
  void reverse(const Scheme& scheme, double h, const kernels::KernelTable& table,
               BasicWorkspace<L>& w, AdjointWorkspace<L>& a, LaneBits lanes) const;

 private:
  template <int L>
  struct StageContext {
    const kernels::KernelTable& table;
    BasicWorkspace<L>& w;
    AdjointWorkspace<L>& a;
    LaneBits lanes;
    [[nodiscard]] int lone() const {
      return (lanes & (lanes - 1)) == 0 ? __builtin_ctz(lanes) : -1;
    }
  };
  template <int L>
  void assemble(const StageContext<L>& s) const;
  template <int L>
  void solve(const StageContext<L>& s) const;
  template <int L>
  kernels::StageHistory<kernels::Row<L>> history_of(const StageContext<L>& s, const Scheme& scheme,
                                                    int stage) const;
  template <int L>
  void hand_on(const StageContext<L>& s, const Scheme& scheme, int stage,
               const LossRows<L>& loss) const;
  template <int L>
  void find_inner_velocities(const StageContext<L>& s, const Scheme& scheme, double h) const;
  template <int L>
  void find_stage(const StageContext<L>& s) const;
  template <int L>
  void reverse_stages(const StageContext<L>& s, const Scheme& scheme, double h) const;

  const CompiledModel& model_;
};

}  // namespace tangere
