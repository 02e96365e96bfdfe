// SPDX-License-Identifier: Apache-2.0
// Estimates the error of a part of a step whose stages are solved.
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
// start, at the end, and the change by gravity in the part.
#include "engine/step/error_estimate.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "engine/step/scheme_stage.hpp"

namespace tangere {

using kernels::Row;

namespace {

/// Sets up the stage so that its residual is M (c₀/h)² e at the end of the parts just solved.
template <int L>
void weigh_displacement(const Scheme& scheme, int n, const Row<L>& h, BasicWorkspace<L>& w) {
  const std::vector<double>& estimate = scheme.estimate;
  const int inner = scheme.inner_stages();
  kernels::Stage<L>& s = w.stage;
  for (int i = 0; i < n; ++i)
    for (int l = 0; l < L; ++l) {
      double e = estimate.front() * h[l] * w.v0[i][l] + estimate.back() * s.x[i][l];
      for (int k = 0; k < inner; ++k) e += estimate[std::size_t(1 + k)] * w.x_inner[k * n + i][l];
      s.s[i][l] += s.c0_over_h[l] * s.c0_over_h[l] / s.inverse_h[l] * e;
    }
}

/// Sets up the stage so that its residual is -M e_v/(h estimate[0]), at the start.
template <int L>
void weigh_velocity(const Scheme& scheme, int n, const Row<L>& h, BasicWorkspace<L>& w) {
  const std::vector<double>& estimate = scheme.estimate;
  const int inner = scheme.inner_stages();
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
}

/// Returns the lanes in which a limit of some dofs acts at the start and not at the end. Limits of
/// ball joints are ignored. `base`: the end, as displacements.
template <int L>
LaneBits left_limits(const CompiledModel& model, const BasicWorkspace<L>& w, LaneBits lanes,
                     std::span<const int> dofs) {
  LaneBits left = 0;
  for (const kernels::Link& link : model.links) {
    if ((link.effects & kernels::kLimit) == 0 || link.kind == kernels::JointKind::spherical)
      continue;
    if (std::ranges::find(dofs, link.v) == dofs.end()) continue;
    for (int k = 0; k < kernels::dofs(link.kind); ++k) {
      const int i = link.v + k;
      const kernels::DofEffects& e = model.dof_effects[std::size_t(i)];
      for (int l = 0; l < L; ++l) {
        const double start = w.q0[link.q + k][l];
        const auto beyond = [&](double x) { return start + x < e.low || start + x > e.high; };
        if (beyond(0) && !beyond(w.base[i][l])) left |= 1U << l;
      }
    }
  }
  return left & lanes;
}

/// Returns ‖D^½ δ‖ of some dofs over the largest of ‖D^½ v‖ at the start, the same at the end,
/// and h |gravity| ‖D^½‖. D is the diagonal of the mass matrix, and δ = `factor` `way`.
template <int L>
Row<L> share_of_velocity(const CompiledModel& model, const BasicWorkspace<L>& w,
                         std::span<const int> dofs, const Row<L>& h, const Row<L>* way,
                         const Row<L>& factor) {
  const double gravity = std::sqrt(dot(model.view.gravity, model.view.gravity));
  Row<L> off{}, before{}, after{}, mass{}, share{};
  for (const int i : dofs)
    for (int l = 0; l < L; ++l) {
      const double d = w.stage.weight[i][l] * w.stage.weight[i][l];
      off[l] += d * way[i][l] * way[i][l];
      before[l] += d * w.v0[i][l] * w.v0[i][l];
      after[l] += d * w.v1[i][l] * w.v1[i][l];
      mass[l] += d;
    }
  for (int l = 0; l < L; ++l) {
    const double fall = h[l] * gravity;
    const double scale = std::max({before[l], after[l], fall * fall * mass[l]});
    if (off[l] != 0) share[l] = std::abs(factor[l]) * std::sqrt(off[l] / scale);
  }
  return share;
}

}  // namespace

/// Returns the largest of the shares at the head of this file, of parts that were just solved.
template <int L>
Row<L> ErrorEstimate::error(const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                            const Row<L>& h, const StageFactors<L>& factors,
                            NewtonReport& report) const {
  const int n = model_.nv;
  kernels::Stage<L>& s = w.stage;
  const auto& kernel = table.stage<L>();
  const auto [start, end, displacement_wrenches, velocity_wrenches] = w.wrenches;
  std::copy_n(s.x, n, w.base);
  weigh_displacement(scheme_, n, h, w);
  evaluate_elsewhere(model_, table, w, lanes, report);
  kernel.contact_wrenches(model_.view, s, end);
  Row<L> error{};
  scaled_residual(model_, table, w, error);
  // If the first guess of every stage was a root, there is no factor: forces were constant over the
  // stages, and their change since the start is the error.
  const LaneBits guessed = lanes & ~factors.any,
                 left = left_limits(model_, w, lanes & factors.any, model_.component_dofs);
  if (contact_forces_.none() && (guessed | left) == 0) return error;
  solve_by_factor(model_, table, w, factors, w.delta);
  weigh_velocity(scheme_, n, h, w);
  evaluate_elsewhere(model_, table, w, lanes, report);
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
  const double c0 = scheme_.stages.back().c0, test_share = -c0 * scheme_.estimate.front();
  Row<L> factor;
  for (int l = 0; l < L; ++l) factor[l] = c0 / h[l] * test_share;
  for (int c = 0; c < model_.components(); ++c) {
    const std::span<const int> dofs = dofs_of_component(model_, c);
    LaneBits gone = contact_forces_.parted<L>(start, end, c);
    if (left != 0) gone |= left_limits(model_, w, left, dofs);
    if ((gone & lanes & factors.any) == 0) continue;
    const Row<L> share = share_of_velocity(model_, w, dofs, h, w.test, factor);
    for (int l = 0; l < L; ++l)
      if (has(gone & lanes & factors.any, l)) raise(l, share[l]);
  }
  const LaneBits touching = touched & factors.any;
  if (touching == 0) return error;
  set_stage(model_, scheme_, scheme_.inner_stages(), h, w);
  const auto move = [&](const Row<L>* way, double share, Row<L>* wrenches) {
    for (int i = 0; i < n; ++i)
      for (int l = 0; l < L; ++l) s.x[i][l] = w.base[i][l] - share * way[i][l];
    evaluate_elsewhere(model_, table, w, touching, report);
    kernel.contact_wrenches(model_.view, s, wrenches);
  };
  move(w.delta, 1, displacement_wrenches);
  move(w.test, test_share, velocity_wrenches);
  for (int l = 0; l < L; ++l)
    if (has(touching, l))
      raise(l, contact_forces_.change<L>(start, end, displacement_wrenches, velocity_wrenches, l));
  return error;
}

template Row<kernels::kGroup> ErrorEstimate::error(const kernels::KernelTable&, Workspace&,
                                                   LaneBits, const Row<kernels::kGroup>&,
                                                   const StageFactors<kernels::kGroup>&,
                                                   NewtonReport&) const;
template Row<1> ErrorEstimate::error(const kernels::KernelTable&, SingleWorkspace&, LaneBits,
                                     const Row<1>&, const StageFactors<1>&, NewtonReport&) const;

}  // namespace tangere
