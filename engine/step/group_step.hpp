// SPDX-License-Identifier: Apache-2.0
// The time-stepping schemes on one group of eight environments, and the splitting of steps that do
// not converge.
//
// Every solve is one stage (centre c, c₀, r, s): ẋ = (c₀x + r)/h, v = J(x)ẋ, a = (c₀v + s)/h, g(x)
// = 0, q = c ⊕ x:
//   BDF1            c = q₀   c₀ = 1     r = 0            s = -v₀
//   BDF2            c = q₁   c₀ = 3/2   r = (q₀⊖q₁)/2    s = -2v₁ + v₀/2      (q₁, v₁ newest)
//   SDIRK2 stage γ  c = q₀   c₀ = 1/γ   r = 0            s = -v₀/γ
//   SDIRK2 stage 1  c = q₀   c₀ = 1/γ   r = -κ x_γ       s = -(v₀ + η(v_γ - v₀))/γ
//   γ = 1 - 1/√2, η = (1 - γ)/γ, κ = η/γ
#pragma once

#include <cmath>

#include "engine/step/newton.hpp"
#include "engine/step/tape.hpp"

namespace tangere {

inline const double kGamma = 1 - std::sqrt(0.5);
inline const double kEta = (1 - kGamma) / kGamma;
inline const double kKappa = kEta / kGamma;

struct StepSettings {
  Integrator integrator;
  double timestep;
  double tolerance;
  int max_iterations;
};

/// What a tape wants to know of a step beside its result.
struct SolveLog {
  std::array<std::vector<TapedSolve>, kernels::kGroup>
      special;  ///< of lanes whose step is not one plain step of the scheme
  double* x_gamma =
      nullptr;  ///< inner stages of plain SDIRK2 steps: dof i of lane l at [i * kBlock + l]
};

/// States of a group come in and go out through the workspace's rows q0, v0, q_before, v_before.
class GroupStep {
 public:
  GroupStep(const CompiledModel& model, const StepSettings& settings)
      : model_(model), settings_(settings) {}

  /// Advances `lanes` by one step; `history`: those with a valid state one step before (BDF2).
  /// Afterwards q0, v0 hold the new state of every lane whose status did not fail; rows of other
  /// lanes are untouched. Steps that are split run in `alone`, which may be `w` itself: the same
  /// bits as in the group, for less. With `log`, BDF2's starts and the parts of split steps are
  /// added to it.
  template <int L>
  void advance(const kernels::KernelTable& table, BasicWorkspace<L>& w, SingleWorkspace& alone,
               LaneBits lanes, LaneBits history, NewtonReport& report,
               SolveLog* log = nullptr) const;

 private:
  template <int L>
  LaneBits run(Integrator scheme, const kernels::KernelTable& table, BasicWorkspace<L>& w,
               LaneBits lanes, double h, bool inside_split, NewtonReport& report) const;
  template <int L>
  LaneBits solve_one_stage(const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                           double c0, double h, bool inside_split, NewtonReport& report) const;
  bool split(const kernels::KernelTable& table, SingleWorkspace& w, double h, int depth,
             NewtonReport& report, std::vector<TapedSolve>* solves) const;
  template <int L>
  bool split_lane(const kernels::KernelTable& table, BasicWorkspace<L>& w, int lane,
                  SingleWorkspace& alone, NewtonReport& report,
                  std::vector<TapedSolve>* solves) const;
  template <int L>
  void note(const BasicWorkspace<L>& w, int lane, Integrator scheme, double h,
            std::vector<TapedSolve>* to) const;
  template <int L>
  void finish(BasicWorkspace<L>& w, LaneBits lanes, double h, LaneBits& resolved,
              NewtonReport& report) const;

  const CompiledModel& model_;
  StepSettings settings_;
};

}  // namespace tangere
