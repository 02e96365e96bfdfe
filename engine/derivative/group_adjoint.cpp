// SPDX-License-Identifier: Apache-2.0
// The schemes of engine/step/group_step.hpp backwards. Lanes outside the mask compute with what stands
// there and change nothing.
#include "engine/derivative/group_adjoint.hpp"

#include <algorithm>

#include "engine/step/detection.hpp"
#include "engine/step/state_difference.hpp"

namespace tangere {

using kernels::Row;
using kernels::StageHistory;

template <int L>
AdjointWorkspace<L>::AdjointWorkspace(const CompiledModel& model, int loss_count, bool parameters)
    : losses(std::size_t(loss_count)) {
  const std::size_t nv = std::size_t(model.nv), per_loss = 10, shared = 10;
  const std::size_t count = parameters ? std::size_t(kernels::parameter_numbers(model.view)) : 0;
  memory.assign(nv * (per_loss * losses.size() + shared) + count * (losses.size() + 1), Row{});
  Row* at = memory.data();
  const auto take = [&](Row*& p, std::size_t rows) {
    p = at;
    at += rows;
  };
  for (LossRows<L>& l : losses)
    for (Row** p :
         {&l.q, &l.v, &l.q_centre, &l.v_centre, &l.q_other, &l.v_other, &l.tau, &l.target})
      take(*p, nv);
  take(q_gamma, nv * losses.size());
  take(v_gamma, nv * losses.size());
  for (Row** p : {&rhs, &lambda, &nu, &mass_lambda, &target, &other, &q_centre, &v_centre, &q_other,
                  &v_other})
    take(*p, nv);
  numbers = nullptr;
  for (LossRows<L>& l : losses) l.parameters = nullptr;
  if (!parameters) return;
  take(numbers, count);
  for (LossRows<L>& l : losses) take(l.parameters, count);
}

namespace {

template <int L>
void fill(Row<L>& row, double value) {
  for (double& x : row.lane) x = value;
}
template <int L>
void clear(Row<L>* rows, int count) {
  for (int i = 0; i < count; ++i) rows[i] = Row<L>{};
}
template <int L>
void add_lanes(Row<L>* to, const Row<L>* from, int count, LaneBits lanes) {
  for (int i = 0; i < count; ++i)
    for (int l = 0; l < L; ++l)
      if (has(lanes, l)) to[i][l] += from[i][l];
}

}  // namespace

/// A and its factor at the stage's x; centre, x, r, s are set.
template <int L>
void GroupAdjoint::assemble(const StageInHand<L>& s, double c0, double h) const {
  BasicWorkspace<L>& w = s.w;
  const kernels::StageKernels<L>& kernel = s.table.template stage<L>();
  fill(w.stage.c0_over_h, c0 / h);
  fill(w.stage.inverse_h, 1 / h);
  for (int i = 0; i < model_.nq; ++i) w.stage.centre[i] = w.q0[i];
  kernel.kinematics(model_.view, w.stage);
  clear_candidates(w);
  find_candidates(model_, s.table, w, s.lanes);
  if constexpr (L > 1)
    if (s.lone() < 0) lists_to_rows(s.table, w, s.lanes);
  kernel.evaluate(model_.view, w.stage, s.lone());
  kernel.factor(model_.view, w.stage, nullptr);
}

/// λ from the right-hand side; lanes whose factor is useless get a pivoted one.
template <int L>
void GroupAdjoint::solve(const StageInHand<L>& s) const {
  BasicWorkspace<L>& w = s.w;
  AdjointWorkspace<L>& a = s.a;
  s.table.template stage<L>().solve_transposed(model_.view, w.stage, a.rhs, a.lambda, &a.sound);
  for (int l = 0; l < L; ++l) {
    if (!has(s.lanes, l) || a.sound[l] > 0) continue;
    w.pivoted.factor(model_.view.pattern, w.stage.A, l, true);
    w.pivoted.solve(l, a.rhs, a.lambda);
  }
}

/// One loss through the stage in hand.
template <int L>
void GroupAdjoint::hand_on(const StageInHand<L>& s, const StageHistory& history,
                           const Route<L>& route, const LossRows<L>& loss) const {
  AdjointWorkspace<L>& a = s.a;
  const int n = model_.nv;
  const kernels::StageKernels<L>& kernel = s.table.template stage<L>();
  const kernels::StageAdjoint<L> d = {route.q,       route.v,   a.rhs,   a.lambda,   a.nu,
                                      a.mass_lambda, a.target,  a.other, a.q_centre, a.v_centre,
                                      a.q_other,     a.v_other, history};
  kernel.adjoint_rhs(model_.view, s.w.stage, d);
  solve(s);
  for (Row<L>* rows : {a.q_centre, a.v_centre, a.q_other, a.v_other}) clear(rows, n);
  kernel.adjoint_products(model_.view, s.w.stage, d);
  add_lanes(route.q_centre, a.q_centre, n, s.lanes);
  add_lanes(route.v_centre, a.v_centre, n, s.lanes);
  add_lanes(route.q_other, a.q_other, n, s.lanes);
  add_lanes(route.v_other, a.v_other, n, s.lanes);
  add_lanes(loss.tau, a.lambda, n, s.lanes);
  add_lanes(loss.target, a.target, n, s.lanes);
  if (loss.parameters == nullptr) return;
  const int count = kernels::parameter_numbers(model_.view);
  clear(a.numbers, count);
  kernel.parameter_products(model_.view, s.w.stage, d, s.lone(), a.numbers);
  add_lanes(loss.parameters, a.numbers, count, s.lanes);
}

/// Stage 1 hangs on stage γ and on the start, stage γ on the start alone.
template <int L>
void GroupAdjoint::reverse_sdirk2(const StageInHand<L>& s, double h) const {
  BasicWorkspace<L>& w = s.w;
  AdjointWorkspace<L>& a = s.a;
  const int n = model_.nv;
  clear(a.q_gamma, n * static_cast<int>(a.losses.size()));
  clear(a.v_gamma, n * static_cast<int>(a.losses.size()));
  // v_γ = J(x_γ) x_γ/(γ h) and stage γ's own s = -v₀/γ: by its kinematics.
  for (int i = 0; i < n; ++i) {
    w.stage.x[i] = w.x_gamma[i];
    w.stage.r[i] = Row<L>{};
    for (int l = 0; l < L; ++l) w.stage.s[i][l] = -w.v0[i][l] / kGamma;
  }
  fill(w.stage.c0_over_h, 1 / (kGamma * h));
  fill(w.stage.inverse_h, 1 / h);
  for (int i = 0; i < model_.nq; ++i) w.stage.centre[i] = w.q0[i];
  s.table.template stage<L>().kinematics(model_.view, w.stage);
  for (int i = 0; i < n; ++i) w.v_gamma[i] = w.stage.v[i];

  state_difference(model_, w.q1, w.q0, w.stage.x);
  for (int i = 0; i < n; ++i) {
    a.other[i] = w.x_gamma[i];
    for (int l = 0; l < L; ++l) {
      w.stage.r[i][l] = -kKappa * w.x_gamma[i][l];
      w.stage.s[i][l] = -(w.v0[i][l] + kEta * (w.v_gamma[i][l] - w.v0[i][l])) / kGamma;
    }
  }
  assemble(s, 1 / kGamma, h);
  const StageHistory last = {-kKappa, -(1 - kEta) / kGamma, -kEta / kGamma};
  for (std::size_t k = 0; k < a.losses.size(); ++k) {
    const LossRows<L>& o = a.losses[k];
    Row<L>*q_gamma = a.q_gamma + k * std::size_t(n), *v_gamma = a.v_gamma + k * std::size_t(n);
    hand_on(s, last, {o.q, o.v, o.q_centre, o.v_centre, q_gamma, v_gamma}, o);
  }
  for (int i = 0; i < n; ++i) {
    w.stage.x[i] = w.x_gamma[i];
    w.stage.r[i] = Row<L>{};
    for (int l = 0; l < L; ++l) w.stage.s[i][l] = -w.v0[i][l] / kGamma;
  }
  assemble(s, 1 / kGamma, h);
  const StageHistory first = {0, -1 / kGamma, 0};
  for (std::size_t k = 0; k < a.losses.size(); ++k) {
    const LossRows<L>& o = a.losses[k];
    const Row<L>*q_gamma = a.q_gamma + k * std::size_t(n),
          *v_gamma = a.v_gamma + k * std::size_t(n);
    hand_on(s, first, {q_gamma, v_gamma, o.q_centre, o.v_centre, o.q_other, o.v_other}, o);
  }
}

template <int L>
void GroupAdjoint::reverse(Integrator scheme, double h, const kernels::KernelTable& table,
                           BasicWorkspace<L>& w, AdjointWorkspace<L>& a, LaneBits lanes) const {
  const StageInHand<L> s = {table, w, a, lanes};
  if (scheme == Integrator::sdirk2) return reverse_sdirk2(s, h);
  if (scheme == Integrator::linear_implicit) return reverse_linear(s, h);
  const int n = model_.nv;
  StageHistory history = {0, -1, 0};
  state_difference(model_, w.q1, w.q0, w.stage.x);
  if (scheme == Integrator::bdf2) {
    history = {0.5, -2, 0.5};
    state_difference(model_, w.q_before, w.q0, a.other);
  }
  for (int i = 0; i < n; ++i)
    for (int l = 0; l < L; ++l) {
      w.stage.r[i][l] = history.rho == 0 ? 0 : history.rho * a.other[i][l];
      w.stage.s[i][l] = history.s_centre * w.v0[i][l];
      if (history.s_other != 0) w.stage.s[i][l] += history.s_other * w.v_before[i][l];
    }
  assemble(s, scheme == Integrator::bdf2 ? 1.5 : 1, h);
  for (const LossRows<L>& o : a.losses)
    hand_on(s, history, {o.q, o.v, o.q_centre, o.v_centre, o.q_other, o.v_other}, o);
}

template struct AdjointWorkspace<kernels::kGroup>;
template struct AdjointWorkspace<1>;
template void GroupAdjoint::reverse(Integrator, double, const kernels::KernelTable&, Workspace&,
                                    AdjointWorkspace<kernels::kGroup>&, LaneBits) const;
template void GroupAdjoint::reverse(Integrator, double, const kernels::KernelTable&,
                                    SingleWorkspace&, AdjointWorkspace<1>&, LaneBits) const;

// linear_adjoint.cpp calls it.
template void GroupAdjoint::solve(const StageInHand<kernels::kGroup>&) const;
template void GroupAdjoint::solve(const StageInHand<1>&) const;

}  // namespace tangere
