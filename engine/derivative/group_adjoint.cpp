// SPDX-License-Identifier: Apache-2.0
// The stages of a scheme backwards (engine/scene/scheme.hpp). Lanes outside the mask compute with
// whatever is there and change nothing.
#include "engine/derivative/group_adjoint.hpp"

#include <algorithm>

#include "engine/derivative/layer_parameters.hpp"
#include "engine/step/detection.hpp"
#include "engine/step/factors.hpp"
#include "engine/step/layer_sums.hpp"
#include "engine/step/scheme_stage.hpp"
#include "engine/step/shear_anchors.hpp"

namespace tangere {

using kernels::Row;

template <int L>
AdjointWorkspace<L>::AdjointWorkspace(const CompiledModel& model, int loss_count, bool parameters,
                                      int inner_stages)
    : losses(std::size_t(loss_count)),
      shear_adjoint(model, loss_count),
      q_stage(std::size_t(model.nq)) {
  const std::size_t nv = std::size_t(model.nv), inner = std::size_t(inner_stages),
                    per_loss = 9 + 2 * inner, shared = 9 + 2 * (1 + inner);
  const std::size_t count = parameters ? std::size_t(model.view.rows.sensors) : 0,
                    all = parameters ? std::size_t(model.view.rows.count) : 0;
  shear.assign(nv * (per_loss * losses.size() + shared) + all * losses.size() + count, Row{});
  Row* at = shear.data();
  const auto take = [&](Row*& p, std::size_t rows) {
    p = at;
    at += rows;
  };
  for (LossRows<L>& l : losses) {
    for (Row** p : {&l.q, &l.v, &l.q_centre, &l.v_centre, &l.q_before, &l.v_before, &l.tau,
                    &l.target, &l.dry_anchor})
      take(*p, nv);
    for (Row** p : {&l.q_inner, &l.v_inner}) take(*p, inner * nv);
  }
  for (Row** p :
       {&rhs, &lambda, &nu, &mass_lambda, &target, &dry_anchor, &difference, &q_centre, &v_centre})
    take(*p, nv);
  for (Row** p : {&q_older, &v_older}) take(*p, (1 + inner) * nv);
  for (LossRows<L>& l : losses) l.parameters = nullptr;
  if (!parameters) return;
  take(numbers, count);
  for (LossRows<L>& l : losses) take(l.parameters, all);
}

namespace {

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

/// Computes A and its factor at the stage's x. Everything else of the stage must be set.
template <int L>
void GroupAdjoint::assemble(const StageContext<L>& s) const {
  BasicWorkspace<L>& w = s.w;
  const kernels::StageKernels<L>& kernel = s.table.template stage<L>();
  kernel.kinematics(model_.view, w.stage);
  clear_candidates(model_, w);
  find_candidates(model_, s.table, w, s.lanes);
  set_list_anchors(model_, s.table, w, s.lanes);
  if constexpr (L > 1)
    if (s.lone() < 0) lists_to_rows(model_, s.table, w, s.lanes);
  set_layer_sums(model_, s.table, w, s.lanes, true);
  kernel.evaluate(model_.view, w.stage, s.lone());
  factor(model_, s.table, w, s.lanes, kNoLane);
}

/// Computes λ from the right-hand side. Lanes whose factor is useless get a pivoted one.
template <int L>
void GroupAdjoint::solve(const StageContext<L>& s) const {
  BasicWorkspace<L>& w = s.w;
  AdjointWorkspace<L>& a = s.a;
  fold_followers(model_, a.rhs);
  solve_watched<true>(model_, s.table, w, s.lanes, a.rhs, a.lambda, a.sound);
  for (int l = 0; l < L; ++l) {
    if (!has(s.lanes, l) || a.sound[l] > 0) continue;
    factor_pivoted(model_, w, l, true);
    solve_pivoted(model_, w, l, a.rhs, a.lambda);
  }
  expand_polynomials(model_, w.stage, a.lambda);
}

/// Returns the states on which a stage depends besides its centre: the one before, then the earlier
/// stages.
template <int L>
kernels::StageHistory<Row<L>> GroupAdjoint::history_of(const StageContext<L>& s,
                                                       const Scheme& scheme, int stage) const {
  AdjointWorkspace<L>& a = s.a;
  const SchemeStage& row = scheme.stages[std::size_t(stage)];
  kernels::StageHistory<Row<L>> history{row.s_centre, 0, {}};
  static_assert(decltype(history)::kMost >= kMostStages);
  const auto add = [&](double r, double s_v, const Row<L>* difference) {
    const int at = history.count++ * model_.nv;
    history.older[at / model_.nv] = {r, s_v / row.s_divisor, difference, a.q_older + at,
                                     a.v_older + at};
  };
  if (row.r_before != 0) add(row.r_before, row.s_before, a.difference);
  for (int j = 0; j < stage; ++j) {
    const InnerWeight& inner = row.inner[std::size_t(j)];
    history.s_centre -= inner.s;
    add(inner.r, inner.s, s.w.x_inner + j * model_.nv);
  }
  history.s_centre /= row.s_divisor;
  return history;
}

/// Passes one loss back through the present stage.
template <int L>
void GroupAdjoint::hand_on(const StageContext<L>& s, const Scheme& scheme, int stage,
                           const LossRows<L>& loss) const {
  AdjointWorkspace<L>& a = s.a;
  const int n = model_.nv;
  const kernels::StageKernels<L>& kernel = s.table.template stage<L>();
  const bool last = stage == scheme.inner_stages();
  const kernels::StageAdjoint<L> d = {last ? loss.q : loss.q_inner + stage * n,
                                      last ? loss.v : loss.v_inner + stage * n,
                                      a.rhs,
                                      a.lambda,
                                      a.nu,
                                      a.mass_lambda,
                                      a.target,
                                      a.dry_anchor,
                                      a.q_centre,
                                      a.v_centre,
                                      history_of(s, scheme, stage)};
  kernel.adjoint_rhs(model_.view, s.w.stage, d);
  solve(s);
  clear(a.q_centre, n);
  clear(a.v_centre, n);
  clear(a.q_older, d.history.count * n);
  clear(a.v_older, d.history.count * n);
  kernel.adjoint_products(model_.view, s.w.stage, d);
  add_lanes(loss.q_centre, a.q_centre, n, s.lanes);
  add_lanes(loss.v_centre, a.v_centre, n, s.lanes);
  const int before = d.history.count - stage;  // 1 if the scheme has history, else 0
  add_lanes(loss.q_before, a.q_older, before * n, s.lanes);
  add_lanes(loss.v_before, a.v_older, before * n, s.lanes);
  add_lanes(loss.q_inner, a.q_older + before * n, stage * n, s.lanes);
  add_lanes(loss.v_inner, a.v_older + before * n, stage * n, s.lanes);
  add_lanes(loss.tau, a.lambda, n, s.lanes);
  add_lanes(loss.target, a.target, n, s.lanes);
  add_lanes(loss.dry_anchor, a.dry_anchor, n, s.lanes);
  if (loss.parameters == nullptr) return;
  const int count = model_.view.rows.sensors;
  clear(a.numbers, count);
  kernel.parameter_products(model_.view, s.w.stage, d, s.lone(), a.numbers);
  add_lanes(loss.parameters, a.numbers, count, s.lanes);
}

/// Computes v_inner from x_inner, by the stages' kinematics.
template <int L>
void GroupAdjoint::find_inner_velocities(const StageContext<L>& s, const Scheme& scheme,
                                         double h) const {
  BasicWorkspace<L>& w = s.w;
  for (int k = 0; k < scheme.inner_stages(); ++k) {
    set_stage(model_, scheme, k, Row<L>::all(h), w);
    // c₀/h is computed anew from the product a_kk h, because the last bits of gradients depend on
    // it.
    w.stage.c0_over_h = Row<L>::all(1 / (scheme.stages[std::size_t(k)].s_divisor * h));
    std::copy_n(w.x_inner + k * model_.nv, model_.nv, w.stage.x);
    s.table.template stage<L>().kinematics(model_.view, w.stage);
    std::copy_n(w.stage.v, model_.nv, w.v_inner + k * model_.nv);
  }
}

/// Computes the coordinates of the current stage.
template <int L>
void GroupAdjoint::find_stage(const StageContext<L>& s) const {
  const kernels::Stage<L>& stage = s.w.stage;
  for (const kernels::Link& link : model_.links) {
    const Row<L>*centre = stage.centre + link.q, *x = stage.x + link.v;
    Row<L>* q = s.a.q_stage.data() + link.q;
    for (int l = 0; l < L; ++l) {
      if (link.kind != kernels::JointKind::spherical) {
        for (int k = 0; k < kernels::dofs(link.kind); ++k) q[k][l] = centre[k][l] + x[k][l];
        continue;
      }
      const kernels::Quat<double> turned =
          rotate_by(quat_at(centre, l), kernels::Vec3<double>{x[0][l], x[1][l], x[2][l]});
      q[0][l] = turned.w, q[1][l] = turned.x, q[2][l] = turned.y, q[3][l] = turned.z;
    }
  }
}

template <int L>
void GroupAdjoint::reverse_stages(const StageContext<L>& s, const Scheme& scheme, double h) const {
  BasicWorkspace<L>& w = s.w;
  const int last = scheme.inner_stages();
  for (const LossRows<L>& o : s.a.losses)
    for (Row<L>* rows : {o.q_inner, o.v_inner}) clear(rows, last * model_.nv);
  for (const LossRows<L>& o : s.a.losses) clear(o.dry_anchor, model_.nv);
  start_solve(model_, s.table, w, s.lanes);
  begin_shear(model_, s.table, w);
  s.a.shear_adjoint.begin(model_);
  find_inner_velocities(s, scheme, h);
  for (int k = last; k >= 0; --k) {
    set_stage(model_, scheme, k, Row<L>::all(h), w);
    if (scheme.needs_history()) state_difference(model_, w.q_before, w.q0, s.a.difference);
    if (k == last) {
      state_difference(model_, w.q1, w.q0, w.stage.x);
    } else {
      std::copy_n(w.x_inner + k * model_.nv, model_.nv, w.stage.x);
    }
    assemble(s);
    if (!model_.shear_springs.empty() || !model_.layer_pads.empty()) find_stage(s);
    for (std::size_t n = 0; n < s.a.losses.size(); ++n) {
      LossRows<L>& o = s.a.losses[n];
      if (k == last)
        s.a.shear_adjoint.reverse_end(model_, s.table, w, s.lanes, o, static_cast<int>(n));
      hand_on(s, scheme, k, o);
      add_layer_parameters(model_, s.table, w, s.lanes, s.a.q_stage.data(), s.a.lambda, o);
      s.a.shear_adjoint.reverse_forces(model_, s.table, w, s.lanes, s.a.q_stage.data(), s.a.lambda,
                                       o, static_cast<int>(n));
    }
  }
  for (std::size_t n = 0; n < s.a.losses.size(); ++n)
    s.a.shear_adjoint.finish(model_, s.table, w, s.lanes, s.a.losses[n], static_cast<int>(n));
}

template <int L>
void GroupAdjoint::reverse(const Scheme& scheme, double h, const kernels::KernelTable& table,
                           BasicWorkspace<L>& w, AdjointWorkspace<L>& a, LaneBits lanes) const {
  const StageContext<L> s = {table, w, a, lanes};
  reverse_stages(s, scheme, h);
}

template struct AdjointWorkspace<kernels::kGroup>;
template struct AdjointWorkspace<1>;
template void GroupAdjoint::reverse(const Scheme&, double, const kernels::KernelTable&, Workspace&,
                                    AdjointWorkspace<kernels::kGroup>&, LaneBits) const;
template void GroupAdjoint::reverse(const Scheme&, double, const kernels::KernelTable&,
                                    SingleWorkspace&, AdjointWorkspace<1>&, LaneBits) const;

}  // namespace tangere
