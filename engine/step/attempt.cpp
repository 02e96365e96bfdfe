// SPDX-License-Identifier: Apache-2.0
// Solves the stages of an attempt and computes the state at its end.
#include "engine/step/attempt.hpp"

#include <algorithm>
#include <cmath>

#include "engine/model/compile_followers.hpp"
#include "engine/step/detection.hpp"
#include "engine/step/factors.hpp"
#include "engine/step/scheme_stage.hpp"
#include "engine/step/shear_anchors.hpp"
#include "engine/step/shear_update.hpp"
#include "engine/step/softened.hpp"

namespace tangere {

using kernels::JointKind;
using kernels::Quat;
using kernels::Row;
using kernels::Vec3;

namespace {

// Inside a split the search may be long: a tight limit loses runs that a patient search finishes.
constexpr int kHalvings = 10, kSplitHalvings = 20, kSplitIterations = 40;
constexpr int kPatience = 4, kSplitPatience = 40;
/// The estimate of the parts taken stays below 1/kSafety of the accuracy.
constexpr double kSafety = 1.5;

/// Solves the stages, each for the lanes that found the one before. Returns the lanes that found
/// all of them. `softened`: receives the lanes whose root was found by softening.
template <int L>
LaneBits solve_stages(const CompiledModel& model, const StepSettings& settings, const Attempt<L>& a,
                      const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                      StageFactors<L>& factors, LaneBits& softened, NewtonReport& report) {
  const int n = model.nv, inner = a.scheme->inner_stages();
  const bool split = a.depth > 0;
  const NewtonLimits limits = {
      settings.tolerance, split ? kSplitIterations : settings.max_iterations,
      split ? kSplitHalvings : kHalvings, split ? kSplitPatience : kPatience, settings.spare};
  // With an accuracy, shorter parts are tried before softening.
  const bool softens = split || settings.accuracy == 0;
  start_solve(model, table, w, lanes);
  begin_shear(model, table, w);
  for (int k = 0; k <= inner; ++k) {
    set_stage(model, *a.scheme, k, a.h, w);
    guess_stage(model, *a.scheme, k, a.h, w);
    expand_followers(model, w.stage.x);
    std::copy_n(w.stage.x, n, w.x_guess);
    const LaneBits found = solve_stage(model, table, w, lanes, limits, factors, report);
    const LaneBits lost = softens ? lanes & ~found : kNoLane;
    lanes = found;
    if (lost != 0) {
      const LaneBits from_softer =
          solve_from_softer(model, table, w, lost, limits, factors, report);
      lanes |= from_softer, softened |= from_softer;
    }
    if (k == inner) break;
    // With an explicit tolerance, each stage starts from a fresh factorisation.
    if (!settings.spare) factors.begin_anew();
    std::copy_n(w.stage.x, n, w.x_inner + k * n);
    std::copy_n(w.stage.v, n, w.v_inner + k * n);
  }
  return lanes;
}

/// Computes q1 = centre ⊕ x, v1 = v. Returns the lanes in which every joint turned by less than π:
/// its chart ends there.
template <int L>
LaneBits finish(const CompiledModel& model, const Row<L>& h, BasicWorkspace<L>& w, LaneBits lanes,
                NewtonReport& report) {
  LaneBits resolved = lanes;
  for (int i = 0; i < model.nv; ++i) put_lanes<L>(w.stage.v[i].lane, lanes, w.v1[i].lane);
  for (const kernels::Link& link : model.links) {
    const Row<L>* x = w.stage.x + link.v;
    if (link.kind != JointKind::spherical) {
      for (int k = 0; k < kernels::dofs(link.kind); ++k) {
        Row<L> q;
        for (int l = 0; l < L; ++l) q[l] = w.stage.centre[link.q + k][l] + x[k][l];
        put_lanes<L>(q.lane, lanes, w.q1[link.q + k].lane);
      }
      continue;
    }
    for (int l = 0; l < L; ++l) {
      if (!has(lanes, l)) continue;
      const Vec3<double> turn = {x[0][l], x[1][l], x[2][l]};
      const Row<L>* v = w.stage.v + link.v;
      const Vec3<double> rate = {v[0][l], v[1][l], v[2][l]};
      if (!(dot(turn, turn) < M_PI * M_PI) || !(dot(rate, rate) * h[l] * h[l] < M_PI * M_PI)) {
        resolved &= ~(1U << l);
        report.status[l] = StepStatus::rotation;
      }
      const Quat<double> q = rotate_by(quat_at(w.stage.centre + link.q, l), turn);
      w.q1[link.q][l] = q.w, w.q1[link.q + 1][l] = q.x, w.q1[link.q + 2][l] = q.y,
      w.q1[link.q + 3][l] = q.z;
    }
  }
  for (int l = 0; l < L && model.has_followers(); ++l)  // exactly: rounding does not add up
    if (has(lanes, l))
      place_followers(
          model, [&](int i) -> double& { return w.q1[i][l]; },
          [&](int i) -> double& { return w.v1[i][l]; });
  return resolved;
}

}  // namespace

template <int L>
Outcome<L> AttemptSolver::solve(const Attempt<L>& a, const kernels::KernelTable& table,
                                BasicWorkspace<L>& w, LaneBits lanes, NewtonReport& report) const {
  StageFactors<L> factors;
  LaneBits softened = 0;
  LaneBits found = solve_stages(model_, settings_, a, table, w, lanes, factors, softened, report);
  found = finish(model_, a.h, w, found, report);
  update_shear_state(model_, table, w, found);
  if (a.depth > 0) softened = 0;  // the check of softened roots is for whole steps
  Outcome<L> outcome{checks_.failures(*a.scheme, table, w, found, softened, a.h)};
  if (settings_.accuracy == 0 || a.depth > 0) return outcome;
  if (found != 0) outcome.error = estimate_.error(table, w, found, a.h, factors, report);
  for (int l = 0; l < L; ++l) {
    unsigned& failures = outcome.failures[l];
    double& error = outcome.error[l];
    // Tunnelling is rejected at any estimate; rotations too large for the scheme have an error that
    // the estimate of displacements does not include.
    error = failures == 0 ? kSafety * error / settings_.accuracy : HUGE_VAL;
    if (failures != kNoRoot && !(error <= 1)) failures |= kInaccurate;
  }
  return outcome;
}

template Outcome<kernels::kGroup> AttemptSolver::solve(const Attempt<kernels::kGroup>&,
                                                       const kernels::KernelTable&, Workspace&,
                                                       LaneBits, NewtonReport&) const;
template Outcome<1> AttemptSolver::solve(const Attempt<1>&, const kernels::KernelTable&,
                                         SingleWorkspace&, LaneBits, NewtonReport&) const;

}  // namespace tangere
