// SPDX-License-Identifier: Apache-2.0
// Cuts a step into parts whose estimated errors keep the requested accuracy.
//
// The estimates e and e_v of the errors of displacement and velocity (engine/scene/scheme.hpp) say
// how far the start and the stages are from one smooth motion. Stiff contacts pull most of either
// back, so they are taken through the Jacobian A of the last stage:
//   δ = A⁻¹ M (c₀/h)² e,   δ_v = A⁻¹ M (c₀/h) e_v
// M (c₀/h)² e is the residual at the end with accelerations (c₀/h)² e more. M e_v follows from the
// residual at the start with the accelerations that the stages, extrapolated, have there. A part is
// taken when both of these are at most the accuracy:
//   the share of the contact forces that moving the end by δ and by δ_v changes
//       (contact_forces.hpp)
//   M (c₀/h)² e, in the scale of the solver's tolerance: the share of all acting forces that would
//       displace by e in a stage
// A contact or a limit that acts at the start and not at the end changes none of these forces. For
// it the error of its impulse counts: (c₀/h) δ_v relative to the largest of the velocity at the
// start, at the end, and the change by gravity in the part. A step begins with a part of its whole
// length, so it depends on its state alone. Lanes have parts of different lengths and are solved
// together until the last has arrived.
#include "engine/step/step_parts.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/step/group_step.hpp"
#include "engine/step/scheme_stage.hpp"

namespace tangere {

using kernels::Row;

namespace {

/// The estimate of the parts taken stays below 1/kSafety of the accuracy.
constexpr double kSafety = 1.5;

}  // namespace

/// Sets the residual to M (c₀/h)² e at the end of the parts just solved.
template <int L>
void GroupStep::weigh_displacement(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                                   LaneBits lanes, const Row<L>& h, NewtonReport& report) const {
  const std::vector<double>& estimate = settings_.integrator.scheme().estimate;
  const int n = model_.nv, inner = settings_.integrator.scheme().inner_stages();
  kernels::Stage<L>& s = w.stage;
  for (int i = 0; i < n; ++i)
    for (int l = 0; l < L; ++l) {
      double e = estimate.front() * h[l] * w.v0[i][l] + estimate.back() * s.x[i][l];
      for (int k = 0; k < inner; ++k) e += estimate[std::size_t(1 + k)] * w.x_inner[k * n + i][l];
      s.s[i][l] += s.c0_over_h[l] * s.c0_over_h[l] / s.inverse_h[l] * e;
    }
  evaluate_elsewhere(model_, table, w, lanes, report);
}

/// Sets the residual to -M e_v/(h estimate[0]), at the start.
template <int L>
void GroupStep::weigh_velocity(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                               LaneBits lanes, const Row<L>& h, NewtonReport& report) const {
  const std::vector<double>& estimate = settings_.integrator.scheme().estimate;
  const int n = model_.nv, inner = settings_.integrator.scheme().inner_stages();
  kernels::Stage<L>& s = w.stage;
  for (int i = 0; i < n; ++i)
    for (int l = 0; l < L; ++l) {
      const double v0 = w.v0[i][l];
      double change = estimate.back() * (w.v1[i][l] - v0);
      for (int k = 0; k < inner; ++k)
        change += estimate[std::size_t(1 + k)] * (w.v_inner[k * n + i][l] - v0);
      // v = r/h and a = (c₀ v + s)/h
      s.x[i][l] = 0;
      s.r[i][l] = v0 / s.inverse_h[l];
      s.s[i][l] = -change / (estimate.front() * h[l] * s.inverse_h[l]) -
                  s.c0_over_h[l] / s.inverse_h[l] * v0;
    }
  evaluate_elsewhere(model_, table, w, lanes, report);
}

/// Returns the lanes in which a limit of a component acts at the start and not at the end. Limits
/// of ball joints are ignored. `base`: the end, as displacements. component < 0: any of them.
template <int L>
LaneBits GroupStep::left_limits(const BasicWorkspace<L>& w, LaneBits lanes, int component) const {
  LaneBits left = 0;
  for (const kernels::Link& link : model_.links) {
    if ((link.effects & kernels::kLimit) == 0 || link.kind == kernels::JointKind::spherical)
      continue;
    if (component >= 0 && component_of_[std::size_t(link.v)] != component) continue;
    for (int k = 0; k < kernels::dofs(link.kind); ++k) {
      const int i = link.v + k;
      const kernels::DofEffects& e = model_.dof_effects[std::size_t(i)];
      for (int l = 0; l < L; ++l) {
        const double start = w.q0[link.q + k][l];
        const auto beyond = [&](double x) { return start + x < e.low || start + x > e.high; };
        if (beyond(0) && !beyond(w.base[i][l])) left |= 1U << l;
      }
    }
  }
  return left & lanes;
}

/// Returns ‖D^½ δ‖ of a component over the largest of ‖D^½ v‖ at the start, the same at the end,
/// and h |gravity| ‖D^½‖. D is the diagonal of the mass matrix, and δ = `factor` `way`.
template <int L>
Row<L> GroupStep::share_of_velocity(const BasicWorkspace<L>& w, int component, const Row<L>& h,
                                    const Row<L>* way, const Row<L>& factor) const {
  const double gravity = std::sqrt(dot(model_.view.gravity, model_.view.gravity));
  Row<L> off{}, before{}, after{}, mass{}, share{};
  for (int k = model_.component_begin[std::size_t(component)];
       k < model_.component_begin[std::size_t(component) + 1]; ++k) {
    const int i = model_.component_dofs[std::size_t(k)];
    for (int l = 0; l < L; ++l) {
      const double d = w.stage.weight[i][l] * w.stage.weight[i][l];
      off[l] += d * way[i][l] * way[i][l];
      before[l] += d * w.v0[i][l] * w.v0[i][l];
      after[l] += d * w.v1[i][l] * w.v1[i][l];
      mass[l] += d;
    }
  }
  for (int l = 0; l < L; ++l) {
    const double fall = h[l] * gravity;
    const double scale = std::max({before[l], after[l], fall * fall * mass[l]});
    if (off[l] != 0) share[l] = std::abs(factor[l]) * std::sqrt(off[l] / scale);
  }
  return share;
}

/// Returns the largest of the shares at the head of this file, of parts that were just solved.
template <int L>
Row<L> GroupStep::estimated_error(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                                  LaneBits lanes, const Row<L>& h, const StageFactors<L>& factors,
                                  NewtonReport& report) const {
  const Scheme& scheme = settings_.integrator.scheme();
  const int n = model_.nv;
  kernels::Stage<L>& s = w.stage;
  const auto& kernel = table.stage<L>();
  const auto [start, end, by_displacement, by_velocity] = w.wrenches;
  std::copy_n(s.x, n, w.base);
  weigh_displacement(table, w, lanes, h, report);
  kernel.contact_wrenches(model_.view, s, end);
  Row<L> error{};
  scaled_residual(model_, table, w, error);
  // If the first guess of every stage was a root, there is no factor: forces were constant over the
  // stages, and their change since the start is the error.
  const LaneBits guessed = lanes & ~factors.any, left = left_limits(w, lanes & factors.any, -1);
  if (contact_forces_.none() && (guessed | left) == 0) return error;
  solve_by_factor(model_, table, w, factors, w.delta);
  weigh_velocity(table, w, lanes, h, report);
  kernel.contact_wrenches(model_.view, s, start);
  const LaneBits touched =
      lanes & (contact_forces_.touching<L>(start) | contact_forces_.touching<L>(end));
  const auto raise = [&](int l, double share) {
    if (!(share <= error[l])) error[l] = share;
  };
  if (guessed != 0) {
    Row<L> missed{};
    scaled_residual(model_, table, w, missed);
    for (int l = 0; l < L; ++l)
      if (has(guessed, l))
        raise(l,
              has(touched, l) ? contact_forces_.change<L>(start, end, end, start, l) : missed[l]);
  }
  solve_by_factor(model_, table, w, factors, w.test);
  const double c0 = scheme.stages.back().c0, by_test = -c0 * scheme.estimate.front();
  Row<L> factor;
  for (int l = 0; l < L; ++l) factor[l] = c0 / h[l] * by_test;
  for (int c = 0; c < model_.components(); ++c) {
    LaneBits gone = contact_forces_.parted<L>(start, end, c);
    if (left != 0) gone |= left_limits(w, left, c);
    if ((gone & lanes & factors.any) == 0) continue;
    const Row<L> share = share_of_velocity(w, c, h, w.test, factor);
    for (int l = 0; l < L; ++l)
      if (has(gone & lanes & factors.any, l)) raise(l, share[l]);
  }
  const LaneBits touching = touched & factors.any;
  if (touching == 0) return error;
  set_stage(model_, scheme, scheme.inner_stages(), h, w);
  const auto move = [&](const Row<L>* way, double share, Row<L>* wrenches) {
    for (int i = 0; i < n; ++i)
      for (int l = 0; l < L; ++l) s.x[i][l] = w.base[i][l] - share * way[i][l];
    evaluate_elsewhere(model_, table, w, touching, report);
    kernel.contact_wrenches(model_.view, s, wrenches);
  };
  move(w.delta, 1, by_displacement);
  move(w.test, by_test, by_velocity);
  for (int l = 0; l < L; ++l)
    if (has(touching, l))
      raise(l, contact_forces_.change<L>(start, end, by_displacement, by_velocity, l));
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
    StageFactors<L> factors;
    const LaneBits solved = run(scheme, table, w, open, h, false, report, factors);
    const LaneBits through = std::exchange(report.tunnelled, kNoLane);
    LaneBits turned = 0;
    for (int l = 0; l < L; ++l)
      if (has(solved, l)) turned |= checks_.over_rotations(scheme, table, w, 1U << l, h[l]);
    Row<L> error{};
    if (solved != 0) error = estimated_error(table, w, solved, h, factors, report);
    for (int l = 0; l < L; ++l) {
      if (!has(open, l)) continue;
      const LaneBits bit = 1U << l;
      // Tunnelling is rejected at any estimate; rotations too large for the scheme have an error
      // that the estimate of displacements does not include.
      const bool sound = has(solved & ~(through | turned), l);
      const double ratio = sound ? kSafety * error[l] / settings_.accuracy : HUGE_VAL;
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
        passed |= std::exchange(report.tunnelled, kNoLane);
        if ((std::exchange(report.over_rotated, kNoLane) |
             std::exchange(report.energy_created, kNoLane)) != 0)
          coarse |= bit;
      } else {
        open &= ~bit;  // its status has the reason
        continue;
      }
      at[l].take(ratio);
      if (!at[l].finished()) continue;
      open &= ~bit;
      report.status[l] = has(passed, l)   ? StepStatus::tunnelled
                         : has(coarse, l) ? StepStatus::accuracy_not_met
                         : has(split, l)  ? StepStatus::split
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
