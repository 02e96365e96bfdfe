// SPDX-License-Identifier: Apache-2.0
// The ladder of attempts of a step. Every lane begins with the whole step by its scheme. An attempt
// that is rejected is followed by that of the first rung that applies.
#include "engine/step/group_step.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/step/detection.hpp"
#include "engine/step/step_parts.hpp"

namespace tangere {

using kernels::Row;

namespace {

constexpr int kDeepest = 8;  // h / 2^8

enum class Next { shorter_part, take, fallback, halves };

/// What follows an attempt.
struct Rung {
  unsigned after;  ///< it failed in one of these ways
  Next next;
  int min_order = 1, max_order = kMostStages;  ///< of its scheme
  int min_depth = 0;
};

/// Only steps that keep an accuracy have shorter parts, and attempts that are kInaccurate. Where a
/// scheme finds no root of a shortest part, the equations of another may have one. A part has one
/// fallback. Where halves find no root, a root that failed a check is better than none.
constexpr Rung kRungs[] = {
    {.after = kAnyFailure, .next = Next::shorter_part},
    {.after = kInaccurate, .next = Next::take},
    {.after = kEnergyCreated, .next = Next::fallback, .min_order = 2},
    {.after = kOverRotated, .next = Next::fallback, .max_order = 1},
    {.after = kNoRoot, .next = Next::fallback, .min_depth = kDeepest},
    {.after = kAnyFailure, .next = Next::halves},
};

/// How far a lane has come in a step, or in a half of one.
struct LaneProgress {
  const Scheme* scheme = nullptr;             ///< of its next attempt
  std::vector<TapedSolve>* solves = nullptr;  ///< where its attempts are logged; null: nowhere
  double* inner = nullptr;                    ///< as SolveLog::inner, of this lane
  StepParts part{};                           ///< of its next attempt
  bool fell_back = false, in_halves = false;
  const Scheme* root = nullptr;  ///< of a root that failed checks; null: there is none
  unsigned rejected = 0;         ///< failures of such roots
  unsigned taken = 0;            ///< failures of the attempts that were taken

  [[nodiscard]] bool can(const Rung& rung, unsigned failures, int depth) const {
    return (failures & rung.after) != 0 && depth >= rung.min_depth &&
           scheme->order >= rung.min_order && scheme->order <= rung.max_order &&
           !(rung.next == Next::shorter_part && part.finest()) &&
           !(rung.next == Next::fallback && fell_back);
  }

  /// Chooses what follows an attempt with these failures.
  Next choose_next(unsigned failures, int depth) {
    if (failures == 0) return Next::take;
    const Next next =
        std::ranges::find_if(kRungs, [&](const Rung& r) { return can(r, failures, depth); })->next;
    if (next == Next::take) taken |= failures;
    if (next >= Next::fallback && (failures & kNoRoot) == 0) {
      // Halves keep the last root that was found, whole steps that of their own scheme.
      if (depth > 0 || root == nullptr) root = scheme;
      rejected = depth > 0 ? failures : rejected | failures;
    }
    if (next == Next::fallback) {
      scheme = &scheme->fallback();
      fell_back = true;
    }
    return next;
  }

  [[nodiscard]] StepStatus status() const {
    if ((taken & kTunnelled) != 0) return StepStatus::tunnelled;
    if (taken != 0) return StepStatus::accuracy_not_met;
    if ((rejected & kEnergyCreated) != 0) return StepStatus::damped;
    return in_halves || rejected != 0 ? StepStatus::split : StepStatus::converged;
  }
};

/// Numbers of lane l of some rows.
template <int L>
std::vector<double> column(const Row<L>* rows, int count, int l) {
  std::vector<double> x(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) x[std::size_t(i)] = rows[i][l];
  return x;
}

/// Copies lane l of some rows to lane k of others.
template <int L, int K>
void copy_lane(const Row<L>* from, int l, Row<K>* to, int k, int count) {
  for (int i = 0; i < count; ++i) to[i][k] = from[i][l];
}

template <int L>
struct Ladder {
  const CompiledModel& model;
  const StepSettings& settings;
  const AttemptSolver& solver;
  const kernels::KernelTable& table;
  BasicWorkspace<L>& w;
  SingleWorkspace& alone;
  NewtonReport& report;

  /// Makes the states at the end of the last attempt the states q0, v0.
  void commit(LaneBits lanes) const {
    for (int i = 0; i < model.nq; ++i) put_lanes<L>(w.q1[i].lane, lanes, w.q0[i].lane);
    for (int i = 0; i < model.nv; ++i) put_lanes<L>(w.v1[i].lane, lanes, w.v0[i].lane);
    for (int l = 0; l < L; ++l)
      if (has(lanes, l)) w.shear.now[std::size_t(l)].swap(w.shear.after[std::size_t(l)]);
  }

  /// Logs the attempt of length h [s] that ended in q0, v0.
  void log(int l, const LaneProgress& lane, double h, int depth) const {
    if (lane.solves == nullptr) return;
    const int inner = lane.scheme->inner_stages() * model.nv;
    if (depth == 0 && lane.part.whole() && lane.scheme == &settings.integrator.scheme()) {
      for (int i = 0; i < inner; ++i) lane.inner[i * kernels::kBlock] = w.x_inner[i][l];
    } else {
      lane.solves->push_back({Integrator(*lane.scheme), h, column(w.q0, model.nq, l),
                              column(w.v0, model.nv, l), column(w.x_inner, inner, l),
                              w.shear.now[std::size_t(l)]});
    }
  }

  /// Advances `lanes` by h [s]: a step, or what is left of one after `depth` halvings. Returns the
  /// lanes that arrived; the others have a failure in `report.status`.
  LaneBits climb(LaneBits lanes, double h, int depth, std::array<LaneProgress, L>& at) const {
    LaneBits arrived = 0;
    for (LaneBits open = lanes; open != 0;) {
      Attempt<L> attempt{at[std::size_t(std::countr_zero(open))].scheme, Row<L>::all(h), depth};
      LaneBits tried = 0, taken = 0, halved = 0;
      for (int l = 0; l < L; ++l) {
        attempt.h[l] *= at[l].part.length();
        if (has(open, l) && at[l].scheme == attempt.scheme) tried |= 1U << l;
      }
      const Outcome<L> outcome = solver.solve(attempt, table, w, tried, report);
      for (int l = 0; l < L; ++l) {
        if (!has(tried, l)) continue;
        const Next next = at[l].choose_next(outcome.failures[l], depth);
        if (next == Next::shorter_part) at[l].part.shorten(outcome.error[l]);
        if (next == Next::take) taken |= 1U << l;
        if (next == Next::halves) halved |= 1U << l;
      }
      commit(taken);
      for (int l = 0; l < L; ++l) {
        if (!has(taken | halved, l)) continue;
        if (has(taken, l)) log(l, at[l], attempt.h[l], depth);
        const bool found = has(taken, l) || take_alone(l, attempt.h[l], depth, at[l]);
        if (found) at[l].part.take(outcome.error[l]);
        if (found && !at[l].part.finished()) continue;
        open &= ~(1U << l);
        if (found) arrived |= 1U << l;
      }
    }
    return arrived;
  }

  /// Takes an attempt of one lane in halves. The other lanes are masked.
  bool take_alone(int l, double h, int depth, LaneProgress& lane) const {
    if constexpr (L == 1) {
      if (&w == &alone) return take_halves(h, depth, lane);
    }
    copy_lane(w.q0, l, alone.q0, 0, model.nq);
    copy_lane(w.v0, l, alone.v0, 0, model.nv);
    copy_lane(w.q_before, l, alone.q_before, 0, model.nq);
    copy_lane(w.v_before, l, alone.v_before, 0, model.nv);
    copy_lane(w.stage.tau, l, alone.stage.tau, 0, model.nv);
    copy_lane(w.stage.target, l, alone.stage.target, 0, model.nv);
    alone.stage.block =
        w.stage.block == nullptr ? nullptr : w.stage.block + w.stage.group * kernels::kGroup + l;
    alone.stage.group = 0;
    alone.shear.now[0] = w.shear.now[std::size_t(l)];
    NewtonReport one;
    one.status[0] = report.status[l];
    one.iterations[0] = report.iterations[l];
    one.residual[0] = report.residual[l];
    const bool found =
        Ladder<1>{model, settings, solver, table, alone, alone, one}.take_halves(h, depth, lane);
    copy_lane(alone.q0, 0, w.q0, l, model.nq);
    copy_lane(alone.v0, 0, w.v0, l, model.nv);
    w.shear.now[std::size_t(l)] = alone.shear.now[0];
    report.status[l] = one.status[0];
    report.iterations[l] = one.iterations[0];
    report.residual[l] = one.residual[0];
    return found;
  }

  /// Takes an attempt in two halves from q0, v0, or by its root that failed checks. Returns whether
  /// either has a root.
  bool take_halves(double h, int depth, LaneProgress& lane) const requires(L == 1) {
    const bool has_root = lane.root != nullptr;
    const std::vector<double> q = column(w.q0, has_root ? model.nq : 0, 0),
                              v = column(w.v0, has_root ? model.nv : 0, 0);
    const ShearState shear = has_root ? w.shear.now[0] : ShearState{};
    const std::size_t logged = lane.solves == nullptr ? 0 : lane.solves->size();
    unsigned taken = 0;
    bool found = depth < kDeepest;
    for (int k = 0; k < 2 && found; ++k) {
      std::array<LaneProgress, 1> half;
      half[0].scheme = &settings.integrator.scheme().substep_scheme();
      half[0].solves = lane.solves;
      found = climb(1U, 0.5 * h, depth + 1, half) != 0;
      taken |= half[0].taken;
    }
    if (found) {
      lane.in_halves = true;
      lane.taken |= taken;
      return true;
    }
    if (!has_root) return false;
    for (std::size_t i = 0; i < q.size(); ++i) w.q0[i][0] = q[i];
    for (std::size_t i = 0; i < v.size(); ++i) w.v0[i][0] = v[i];
    w.shear.now[0] = shear;
    if (lane.solves != nullptr)
      lane.solves->erase(lane.solves->begin() + std::ptrdiff_t(logged), lane.solves->end());
    lane.scheme = lane.root;
    lane.taken |= lane.rejected;
    solver.solve({lane.root, Row<1>::all(h), depth}, table, w, 1U, report);
    commit(1U);
    log(0, lane, h, depth);
    return true;
  }
};

/// Whether a joint of lane l turns by π or more in a step at its end. The next step's history is
/// log(R₁ᵀR₀) and would read it as its complement.
template <int L>
bool turns_by_half(const CompiledModel& model, const BasicWorkspace<L>& w, int l, double h) {
  return std::ranges::any_of(model.links, [&](const kernels::Link& link) {
    const Row<L>* v = w.v0 + link.v;
    if (link.kind != kernels::JointKind::spherical) return false;
    const kernels::Vec3<double> rate = {v[0][l], v[1][l], v[2][l]};
    return !(dot(rate, rate) * h * h < M_PI * M_PI);
  });
}

}  // namespace

template <int L>
void GroupStep::advance(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                        SingleWorkspace& alone, LaneBits lanes, LaneBits history,
                        NewtonReport& report, SolveLog* log) const {
  if (keeps_lists(model_)) {
    w.candidates->clear(~lanes);
  } else {
    clear_candidates(model_, w);
  }
  const double h = settings_.timestep;
  const Scheme& scheme = settings_.integrator.scheme();
  const bool cut = settings_.accuracy > 0;
  std::array<LaneProgress, L> at;
  for (int l = 0; l < L; ++l) {
    at[l].scheme = scheme.needs_history() && !has(history, l) ? scheme.start : &scheme;
    if (cut) at[l].part = StepParts(StepParts::kFinest);
    if (log == nullptr) continue;
    at[l].solves = &log->special[std::size_t(l)];
    at[l].inner = log->inner == nullptr ? nullptr : log->inner + l;
  }
  const Ladder<L> ladder{model_, settings_, solver_, table, w, alone, report};
  const LaneBits arrived = ladder.climb(lanes, h, 0, at);
  for (int l = 0; l < L; ++l)
    if (has(arrived, l))
      report.status[l] =
          !cut && turns_by_half(model_, w, l, h) ? StepStatus::rotation : at[l].status();
}

template void GroupStep::advance(const kernels::KernelTable&, Workspace&, SingleWorkspace&,
                                 LaneBits, LaneBits, NewtonReport&, SolveLog*) const;
template void GroupStep::advance(const kernels::KernelTable&, SingleWorkspace&, SingleWorkspace&,
                                 LaneBits, LaneBits, NewtonReport&, SolveLog*) const;

}  // namespace tangere
