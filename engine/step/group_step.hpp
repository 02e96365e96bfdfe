// SPDX-License-Identifier: Apache-2.0
// Takes one step of a group of eight environments by the stages of its scheme
// (engine/scene/scheme.hpp), splits steps that do not converge, and cuts steps into parts that keep
// an accuracy.
#pragma once

#include "engine/step/contact_forces.hpp"
#include "engine/step/newton.hpp"
#include "engine/step/step_checks.hpp"
#include "engine/step/step_settings.hpp"
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
  GroupStep(const CompiledModel& model, const StepSettings& settings);

  /// Advances `lanes` by one step. `history`: lanes with a valid state one step before. Afterwards
  /// q0, v0 hold the new state of every lane whose status is not a failure. Rows of other lanes are
  /// unchanged. Split steps run in `alone`, which may be `w` itself: the same bits as in the group,
  /// for less time. Starts, the parts of split steps and inner stages are added to `log`, unless it
  /// is null.
  template <int L>
  void advance(const kernels::KernelTable& table, BasicWorkspace<L>& w, SingleWorkspace& alone,
               LaneBits lanes, LaneBits history, NewtonReport& report,
               SolveLog* log = nullptr) const;

 private:
  template <int L>
  void advance_plainly(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                       SingleWorkspace& alone, LaneBits lanes, LaneBits history,
                       NewtonReport& report, SolveLog* log) const;
  template <int L>
  void advance_in_parts(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                        SingleWorkspace& alone, LaneBits lanes, NewtonReport& report,
                        SolveLog* log) const;
  template <int L>
  void weigh_displacement(const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                          const kernels::Row<L>& h, NewtonReport& report) const;
  template <int L>
  void weigh_velocity(const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                      const kernels::Row<L>& h, NewtonReport& report) const;
  template <int L>
  LaneBits left_limits(const BasicWorkspace<L>& w, LaneBits lanes, int component) const;
  template <int L>
  kernels::Row<L> share_of_velocity(const BasicWorkspace<L>& w, int component,
                                    const kernels::Row<L>& h, const kernels::Row<L>* way,
                                    const kernels::Row<L>& factor) const;
  template <int L>
  kernels::Row<L> estimated_error(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                                  LaneBits lanes, const kernels::Row<L>& h,
                                  const StageFactors<L>& factors, NewtonReport& report) const;
  template <int L>
  LaneBits run(const Scheme& scheme, const kernels::KernelTable& table, BasicWorkspace<L>& w,
               LaneBits lanes, const kernels::Row<L>& h, bool inside_split, NewtonReport& report,
               StageFactors<L>& factors) const;
  bool split(const kernels::KernelTable& table, SingleWorkspace& w, double h, int depth,
             NewtonReport& report, std::vector<TapedSolve>* solves) const;
  bool take_part(const kernels::KernelTable& table, SingleWorkspace& w, double h, int depth,
                 NewtonReport& report, std::vector<TapedSolve>* solves) const;
  template <int L>
  bool split_lane(const kernels::KernelTable& table, BasicWorkspace<L>& w, int lane, double h,
                  SingleWorkspace& alone, NewtonReport& report,
                  std::vector<TapedSolve>* solves) const;
  template <int L>
  void log_inner(const BasicWorkspace<L>& w, int lane, const Scheme& scheme, SolveLog& log) const;
  template <int L>
  void note(const BasicWorkspace<L>& w, int lane, const Scheme& scheme, double h,
            std::vector<TapedSolve>* to) const;
  template <int L>
  void watch_faces(const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                   NewtonReport& report) const;
  template <int L>
  CheckedSolve solve_and_check(const Scheme& scheme, const kernels::KernelTable& table,
                               BasicWorkspace<L>& w, LaneBits lanes, double h, bool inside_split,
                               NewtonReport& report) const;
  template <int L>
  void finish(BasicWorkspace<L>& w, LaneBits lanes, const kernels::Row<L>& h, LaneBits& resolved,
              NewtonReport& report) const;
  template <int L>
  void commit(BasicWorkspace<L>& w, LaneBits lanes) const;

  const CompiledModel& model_;
  StepSettings settings_;
  StepChecks checks_;
  ContactForces contact_forces_;
  std::vector<int> component_of_;  ///< (nv)
};

}  // namespace tangere
