// SPDX-License-Identifier: Apache-2.0
// Cuts a step into parts whose errors keep the accuracy that was asked for.
//
// The estimate e of a part's error (engine/model/scheme.hpp) is a displacement. What it means for
// forces is the residual of the last stage at x - e, in the scale of the solver's tolerance: the
// share of the acting forces that would have no counterpart. A part is taken when
//   kSafety ‖residual(x - e)‖ ≤ accuracy
// A step begins with a part of its whole length whatever was before it, so it depends on its state
// alone. Lanes have parts of their own lengths and are solved side by side, until the last has
// arrived.
#include "engine/step/step_parts.hpp"

#include <utility>

#include "engine/step/group_step.hpp"

namespace tangere {

using kernels::Row;

namespace {

/// The estimate of the parts taken stays below 1/kSafety of the accuracy.
constexpr double kSafety = 2;

}  // namespace

/// Returns kSafety times the scaled residual at x - e, of parts that were just solved.
template <int L>
Row<L> GroupStep::estimated_error(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                                  LaneBits lanes, const Row<L>& h, NewtonReport& report) const {
  const Scheme& scheme = settings_.integrator.scheme();
  const int n = model_.nv, inner = scheme.inner_stages();
  for (int i = 0; i < n; ++i)
    for (int l = 0; l < L; ++l) {
      double e = scheme.estimate[0] * h[l] * w.v0[i][l];
      for (int k = 0; k < inner; ++k)
        e += scheme.estimate[std::size_t(1 + k)] * w.x_inner[k * n + i][l];
      e += scheme.estimate[std::size_t(1 + inner)] * w.stage.x[i][l];
      w.stage.x[i][l] -= e;
    }
  Row<L> error{};
  residual_elsewhere(model_, table, w, lanes, report, error);
  for (int l = 0; l < L; ++l) error[l] *= kSafety;
  return error;
}

template <int L>
void GroupStep::advance_in_parts(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                                 SingleWorkspace& alone, LaneBits lanes, NewtonReport& report,
                                 SolveLog* log) const {
  const Scheme& scheme = settings_.integrator.scheme();
  std::array<StepParts, L> at{};
  LaneBits coarse = 0, split = 0, passed = 0;
  for (LaneBits open = lanes; open != 0;) {
    Row<L> h = Row<L>::all(settings_.timestep);
    for (int l = 0; l < L; ++l) h[l] *= at[l].length();
    const LaneBits solved = run(scheme, table, w, open, h, false, report);
    const LaneBits through = std::exchange(report.passed, kNoLane);
    LaneBits turned = 0;
    for (int l = 0; l < L; ++l)
      if (has(solved, l)) turned |= turning(scheme, w, 1U << l, h[l]);
    Row<L> error{};
    if (solved != 0) error = estimated_error(table, w, solved, h, report);
    for (int l = 0; l < L; ++l) {
      if (!has(open, l)) continue;
      const LaneBits bit = 1U << l;
      // A body that came through another is the worst error that there is. One that turned too far
      // is off by more than the displacement shows.
      const bool sound = has(solved & ~(through | turned), l);
      const double ratio = sound ? error[l] / settings_.accuracy : HUGE_VAL;
      std::vector<TapedSolve>* solves = log == nullptr ? nullptr : &log->special[std::size_t(l)];
      if (!(ratio <= 1) && !at[l].finest()) {
        at[l].shorten(ratio);
        continue;
      }
      if (has(solved, l)) {
        if (!(ratio <= 1)) coarse |= bit;
        passed |= bit & through;
        commit(w, bit);
        if (!at[l].whole()) {
          note(w, l, scheme, h[l], solves);
        } else if (log != nullptr) {  // a plain step
          log_inner(w, l, scheme, *log);
        }
      } else if (split_lane(table, w, l, h[l], alone, report, solves)) {
        split |= bit;
        passed |= std::exchange(report.passed, kNoLane);
      } else {
        open &= ~bit;  // its status says why
        continue;
      }
      at[l].take(ratio);
      if (!at[l].finished()) continue;
      open &= ~bit;
      report.status[l] = has(passed, l)   ? StepStatus::passed
                         : has(split, l)  ? StepStatus::split
                         : has(coarse, l) ? StepStatus::coarse
                                          : StepStatus::converged;
    }
  }
}

template void GroupStep::advance_in_parts(const kernels::KernelTable&, Workspace&, SingleWorkspace&,
                                          LaneBits, NewtonReport&, SolveLog*) const;
template void GroupStep::advance_in_parts(const kernels::KernelTable&, SingleWorkspace&,
                                          SingleWorkspace&, LaneBits, NewtonReport&,
                                          SolveLog*) const;

}  // namespace tangere
