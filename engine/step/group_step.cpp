// SPDX-License-Identifier: Apache-2.0
// Sets up the stages, commits their results, and splits the steps of lanes that found no root.
#include "engine/step/group_step.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/model/model_part.hpp"
#include "engine/step/detection.hpp"
#include "engine/step/scheme_stage.hpp"
#include "engine/step/shear_update.hpp"
#include "engine/step/softened.hpp"

namespace tangere {

using kernels::JointKind;
using kernels::Quat;
using kernels::Row;
using kernels::Vec3;

namespace {

constexpr int kDeepestSplit = 8;  // h / 2^8
// Inside a split the search may be long: a tight limit loses runs that a patient search finishes.
constexpr int kHalvings = 10, kSplitHalvings = 20, kSplitIterations = 40;
constexpr int kPatience = 4, kSplitPatience = 40;

/// Where a part begins in one lane, to go back to.
struct LaneState {
  std::vector<double> q, v;
  ShearState memory;
};

template <int L>
LaneState state_of(const BasicWorkspace<L>& w, const CompiledModel& m, int lane) {
  LaneState s{std::vector<double>(std::size_t(m.nq)), std::vector<double>(std::size_t(m.nv)),
              w.remembered.now[std::size_t(lane)]};
  for (int i = 0; i < m.nq; ++i) s.q[std::size_t(i)] = w.q0[i][lane];
  for (int i = 0; i < m.nv; ++i) s.v[std::size_t(i)] = w.v0[i][lane];
  return s;
}

template <int L>
void set_state(const LaneState& s, BasicWorkspace<L>& w, int lane) {
  for (std::size_t i = 0; i < s.q.size(); ++i) w.q0[i][lane] = s.q[i];
  for (std::size_t i = 0; i < s.v.size(); ++i) w.v0[i][lane] = s.v[i];
  w.remembered.now[std::size_t(lane)] = s.memory;
}

}  // namespace

GroupStep::GroupStep(const CompiledModel& model, const StepSettings& settings)
    : model_(model),
      settings_(settings),
      checks_(model, settings),
      contact_forces_(model),
      component_of_(std::size_t(model.nv)) {
  for (int c = 0; c < model.components(); ++c)
    for (int k = model.component_begin[std::size_t(c)];
         k < model.component_begin[std::size_t(c) + 1]; ++k)
      component_of_[std::size_t(model.component_dofs[std::size_t(k)])] = c;
}

/// Solves the stages of a step, each for the lanes that found the one before.
template <int L>
LaneBits GroupStep::run(const Scheme& scheme, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, LaneBits lanes, const Row<L>& h, bool inside_split,
                        NewtonReport& report, StageFactors<L>& factors) const {
  const int n = model_.nv;
  const NewtonLimits limits = {settings_.tolerance,
                               inside_split ? kSplitIterations : settings_.max_iterations,
                               inside_split ? kSplitHalvings : kHalvings,
                               inside_split ? kSplitPatience : kPatience, settings_.spare};
  // With an accuracy, shorter parts are tried before softening.
  const bool softens = inside_split || settings_.accuracy == 0;
  factors = {};
  choose_faces(model_, table, w);
  begin_shear(model_, table, w);
  for (int k = 0; k <= scheme.inner_stages(); ++k) {
    set_stage(model_, scheme, k, h, w);
    guess_stage(model_, scheme, k, h, w);
    std::copy_n(w.stage.x, n, w.x_guess);
    const LaneBits found = solve_stage(model_, table, w, lanes, limits, factors, report);
    const LaneBits lost = softens ? lanes & ~found : kNoLane;
    lanes = found;
    if (lost != 0) lanes |= solve_from_softer(model_, table, w, lost, limits, factors, report);
    if (k == scheme.inner_stages()) break;
    // With an explicit tolerance, each stage starts from a fresh factorisation.
    if (!settings_.spare) factors.begin_anew();
    std::copy_n(w.stage.x, n, w.x_inner + k * n);
    std::copy_n(w.stage.v, n, w.v_inner + k * n);
  }
  LaneBits resolved = lanes;
  finish(w, lanes, h, resolved, report);
  watch_faces(table, w, resolved, report);
  checks_.find_tunnelling(table, w, resolved, report);
  update_shear_state(model_, table, w, resolved);
  return resolved;
}

/// Marks lanes in which a body passed through a cuboid that it touches: its only face at the start
/// of the solve is opposite to its only face at the end.
template <int L>
void GroupStep::watch_faces(const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                            NewtonReport& report) const {
  if (!model_.view.faced) return;
  table.stage<L>().choose_faces(model_.view, w.stage, w.faces_after);
  for (std::size_t k = 0; k < model_.pairs.size(); ++k) {
    if (!can_exert_force(model_.pairs[k].parameters)) continue;
    for (int l = 0; l < L; ++l) {
      double along = 0, all = 0;
      for (std::size_t i = 3 * k; i < 3 * k + 3; ++i) {
        const double before = w.stage.faces[i][l], after = w.faces_after[i][l];
        along += before * after;
        all += std::abs(before) + std::abs(after);
      }
      if (along == -1 && all == 2) report.tunnelled |= lanes & (1U << l);
    }
  }
}

/// Computes q1 = centre ⊕ x, v1 = v. A joint that turned by π or more is not resolved: its chart
/// ends there.
template <int L>
void GroupStep::finish(BasicWorkspace<L>& w, LaneBits lanes, const Row<L>& h, LaneBits& resolved,
                       NewtonReport& report) const {
  for (int i = 0; i < model_.nv; ++i) put_lanes<L>(w.stage.v[i].lane, lanes, w.v1[i].lane);
  for (const kernels::Link& link : model_.links) {
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
}

/// Makes the result of the present solve the state.
template <int L>
void GroupStep::commit(BasicWorkspace<L>& w, LaneBits lanes) const {
  for (int i = 0; i < model_.nq; ++i) put_lanes<L>(w.q1[i].lane, lanes, w.q0[i].lane);
  for (int i = 0; i < model_.nv; ++i) put_lanes<L>(w.v1[i].lane, lanes, w.v0[i].lane);
  for (int l = 0; l < L; ++l)
    if (has(lanes, l)) w.remembered.now[std::size_t(l)].swap(w.remembered.after[std::size_t(l)]);
}

/// Adds the solve that ended in q0, v0 to the log.
template <int L>
void GroupStep::note(const BasicWorkspace<L>& w, int lane, const Scheme& scheme, double h,
                     std::vector<TapedSolve>* to) const {
  if (to == nullptr) return;
  const auto column = [&](const Row<L>* rows, int count) {
    std::vector<double> x(static_cast<std::size_t>(count));
    for (int i = 0; i < count; ++i) x[std::size_t(i)] = rows[i][lane];
    return x;
  };
  to->push_back({Integrator(scheme), h, column(w.q0, model_.nq), column(w.v0, model_.nv),
                 column(w.x_inner, scheme.inner_stages() * model_.nv),
                 w.remembered.now[std::size_t(lane)]});
}

/// Keeps the inner stages of a plain step.
template <int L>
void GroupStep::log_inner(const BasicWorkspace<L>& w, int lane, const Scheme& scheme,
                          SolveLog& log) const {
  for (int i = 0; i < scheme.inner_stages() * model_.nv; ++i)
    log.inner[i * kernels::kBlock + lane] = w.x_inner[i][lane];
}

/// Solves a step of length h and checks the result.
template <int L>
CheckedSolve GroupStep::solve_and_check(const Scheme& scheme, const kernels::KernelTable& table,
                                        BasicWorkspace<L>& w, LaneBits lanes, double h,
                                        bool inside_split, NewtonReport& report) const {
  CheckedSolve solved;
  const LaneBits of_other_parts = std::exchange(report.tunnelled, kNoLane);
  StageFactors<L> unused;
  report.softened = 0;
  solved.found = run(scheme, table, w, lanes, Row<L>::all(h), inside_split, report, unused);
  // Forces that no search could follow from the first guess and that throw bodies about are not
  // smooth, which a scheme of higher order relies on. Parts of the step resolve them.
  if (scheme.order > 1 && !inside_split && report.softened != 0)
    solved.found &= ~checks_.velocity_jumps(w, solved.found & report.softened, h);
  solved.tunnelled = std::exchange(report.tunnelled, of_other_parts) & solved.found;
  solved.energy_created = checks_.energy_gains(table, w, solved.found & ~solved.tunnelled, h);
  solved.over_rotated = checks_.over_rotations(
      scheme, table, w, solved.found & ~(solved.tunnelled | solved.energy_created), h);
  return solved;
}

/// Takes two half steps from q0, v0, split again where needed.
bool GroupStep::split(const kernels::KernelTable& table, SingleWorkspace& w, double h, int depth,
                      NewtonReport& report, std::vector<TapedSolve>* solves) const {
  return depth <= kDeepestSplit && take_part(table, w, 0.5 * h, depth, report, solves) &&
         take_part(table, w, 0.5 * h, depth, report, solves);
}

/// Takes a part of a split step: as one solve if that is sound, else split again. A root that is
/// not sound is better than none.
bool GroupStep::take_part(const kernels::KernelTable& table, SingleWorkspace& w, double h,
                          int depth, NewtonReport& report, std::vector<TapedSolve>* solves) const {
  const Scheme* scheme = &settings_.integrator.scheme().substep_scheme();
  const auto solve = [&] { return solve_and_check(*scheme, table, w, 1U, h, true, report); };
  const auto take = [&] {
    commit(w, 1U);
    note(w, 0, *scheme, h, solves);
    return true;
  };
  CheckedSolve one = solve();
  const auto try_by = [&](const Scheme& other) {
    if (scheme == &other) return;
    const Scheme* const own = std::exchange(scheme, &other);
    const CheckedSolve again = solve();
    if (again.found != 0) {
      one = again;
    } else {
      scheme = own;
    }
  };
  // Where one scheme finds no root of a shortest part, the equations of another may have one.
  const bool lost = one.found == 0 && depth == kDeepestSplit;
  if (const Scheme* const energy_fallback = scheme->energy_fallback();
      energy_fallback != nullptr && (one.energy_created != 0 || lost)) {
    try_by(*energy_fallback);
  } else if (one.over_rotated != 0 || lost) {
    try_by(scheme->rotation_fallback());
  }
  if (one.accepted() != 0) return take();
  if (one.found == 0) return split(table, w, h, depth + 1, report, solves);
  const LaneState start = state_of(w, model_, 0);
  const std::size_t noted = solves == nullptr ? 0 : solves->size();
  const LaneBits passed = report.tunnelled, created = report.energy_created,
                 turned = report.over_rotated;
  if (split(table, w, h, depth + 1, report, solves)) return true;
  set_state(start, w, 0);
  if (solves != nullptr) solves->erase(solves->begin() + std::ptrdiff_t(noted), solves->end());
  report.tunnelled = passed, report.energy_created = created, report.over_rotated = turned;
  solve();
  report.tunnelled |= one.tunnelled;
  report.energy_created |= one.energy_created;
  report.over_rotated |= one.over_rotated;
  return take();
}

/// Splits a step of length h of one lane of a group. The other lanes are masked.
template <int L>
bool GroupStep::split_lane(const kernels::KernelTable& table, BasicWorkspace<L>& w, int lane,
                           double h, SingleWorkspace& alone, NewtonReport& report,
                           std::vector<TapedSolve>* solves) const {
  if constexpr (L == 1) {
    if (&w == &alone) return split(table, w, h, 1, report, solves);
  }
  const auto to_one = [&](const Row<L>* from, Row<1>* to, int count) {
    for (int i = 0; i < count; ++i) to[i][0] = from[i][lane];
  };
  const auto from_one = [&](const Row<1>* from, Row<L>* to, int count) {
    for (int i = 0; i < count; ++i) to[i][lane] = from[i][0];
  };
  to_one(w.q0, alone.q0, model_.nq);
  to_one(w.v0, alone.v0, model_.nv);
  to_one(w.stage.tau, alone.stage.tau, model_.nv);
  to_one(w.stage.target, alone.stage.target, model_.nv);
  alone.stage.block =
      w.stage.block == nullptr ? nullptr : w.stage.block + w.stage.group * kernels::kGroup + lane;
  alone.stage.group = 0;
  alone.remembered.now[0] = w.remembered.now[std::size_t(lane)];
  NewtonReport one;
  one.status[0] = report.status[lane];
  one.iterations[0] = report.iterations[lane];
  one.residual[0] = report.residual[lane];
  const bool done = split(table, alone, h, 1, one, solves);
  from_one(alone.q0, w.q0, model_.nq);
  from_one(alone.v0, w.v0, model_.nv);
  w.remembered.now[std::size_t(lane)] = alone.remembered.now[0];
  report.status[lane] = one.status[0];
  report.iterations[lane] = one.iterations[0];
  report.residual[lane] = one.residual[0];
  report.tunnelled |= one.tunnelled << lane;
  report.energy_created |= one.energy_created << lane;
  report.over_rotated |= one.over_rotated << lane;
  return done;
}

template <int L>
void GroupStep::advance(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                        SingleWorkspace& alone, LaneBits lanes, LaneBits history,
                        NewtonReport& report, SolveLog* log) const {
  clear_candidates(w);
  if (settings_.accuracy > 0) {
    advance_in_parts(table, w, alone, lanes, report, log);
  } else {
    advance_plainly(table, w, alone, lanes, history, report, log);
  }
}

template <int L>
void GroupStep::advance_plainly(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                                SingleWorkspace& alone, LaneBits lanes, LaneBits history,
                                NewtonReport& report, SolveLog* log) const {
  const double h = settings_.timestep;
  const Scheme& scheme = settings_.integrator.scheme();
  const LaneBits starting = scheme.needs_history() ? lanes & ~history : kNoLane;
  const auto solves_of = [log](int l) {
    return log == nullptr ? nullptr : &log->special[std::size_t(l)];
  };
  LaneBits resolved = 0, passed = 0, created = 0, turned = 0;
  const auto solve_and_commit = [&](const Scheme& by, LaneBits which) {
    const CheckedSolve s = solve_and_check(by, table, w, which, h, false, report);
    commit(w, s.accepted());
    resolved |= s.accepted(), passed |= s.tunnelled, created |= s.energy_created,
        turned |= s.over_rotated;
    return s.accepted();
  };
  if ((lanes & ~starting) != 0) {
    const LaneBits done = solve_and_commit(scheme, lanes & ~starting);
    if (log != nullptr)  // before starts or splits of other lanes overwrite them
      for (int l = 0; l < L; ++l)
        if (has(done, l)) log_inner(w, l, scheme, *log);
  }
  const auto take_by = [&](const Scheme& by, LaneBits which) {
    const LaneBits done = solve_and_commit(by, which);
    for (int l = 0; l < L; ++l)
      if (has(done, l)) note(w, l, by, h, solves_of(l));
  };
  if (starting != 0) take_by(*scheme.start, starting);
  if (const Scheme* const energy_fallback = scheme.energy_fallback(); energy_fallback != nullptr) {
    if (created != 0) take_by(*energy_fallback, created);
  } else if (turned != 0) {
    take_by(scheme.rotation_fallback(), turned);
  }
  for (int l = 0; l < L; ++l) {
    if (!has(lanes & ~resolved, l)) continue;
    const bool has_root = has(passed | created | turned, l);
    const StepStatus first = report.status[l];
    const LaneState start = has_root ? state_of(w, model_, l) : LaneState{};
    if (split_lane(table, w, l, h, alone, report, solves_of(l))) {
      report.status[l] = StepStatus::split;
    } else if (has_root) {  // better than none
      set_state(start, w, l);
      if (log != nullptr) solves_of(l)->clear();
      const Scheme& by = has(starting, l) ? *scheme.start : scheme;
      StageFactors<L> unused;
      run(by, table, w, 1U << l, Row<L>::all(h), false, report, unused);
      commit(w, 1U << l);
      if (has(starting, l)) {
        note(w, l, by, h, solves_of(l));
      } else if (log != nullptr) {
        log_inner(w, l, by, *log);
      }
      (has(passed, l)    ? report.tunnelled
       : has(created, l) ? report.energy_created
                         : report.over_rotated) |= 1U << l;
    } else if (!failed(report.status[l])) {
      report.status[l] = first;
    }
  }
  // The next step's history is log(R₁ᵀR₀). If this step turned by π or more, it would be read as
  // its complement.
  for (int l = 0; l < L; ++l) {
    if (!has(lanes, l) || failed(report.status[l])) continue;
    for (const kernels::Link& link : model_.links) {
      if (link.kind != JointKind::spherical) continue;
      const Row<L>* v = w.v0 + link.v;
      const Vec3<double> rate = {v[0][l], v[1][l], v[2][l]};
      if (!(dot(rate, rate) * h * h < M_PI * M_PI)) report.status[l] = StepStatus::rotation;
    }
  }
  for (int l = 0; l < L; ++l) {
    const LaneBits coarse = report.energy_created | report.over_rotated;
    if (!has(lanes & (report.tunnelled | created | turned | coarse), l) || failed(report.status[l]))
      continue;
    report.status[l] = has(report.tunnelled, l) ? StepStatus::tunnelled
                       : has(coarse, l)         ? StepStatus::accuracy_not_met
                       : has(created, l)        ? StepStatus::damped
                                                : StepStatus::split;
  }
}

// step_parts.cpp uses these.
#define TANGERE_FOR_LANES(L)                                                                       \
  template LaneBits GroupStep::run(const Scheme&, const kernels::KernelTable&, BasicWorkspace<L>&, \
                                   LaneBits, const Row<L>&, bool, NewtonReport&, StageFactors<L>&) \
      const;                                                                                       \
  template void GroupStep::commit(BasicWorkspace<L>&, LaneBits) const;                             \
  template void GroupStep::note(const BasicWorkspace<L>&, int, const Scheme&, double,              \
                                std::vector<TapedSolve>*) const;                                   \
  template void GroupStep::log_inner(const BasicWorkspace<L>&, int, const Scheme&, SolveLog&)      \
      const;                                                                                       \
  template bool GroupStep::split_lane(const kernels::KernelTable&, BasicWorkspace<L>&, int,        \
                                      double, SingleWorkspace&, NewtonReport&,                     \
                                      std::vector<TapedSolve>*) const;
TANGERE_FOR_LANES(kernels::kGroup)
TANGERE_FOR_LANES(1)
#undef TANGERE_FOR_LANES
template void GroupStep::advance(const kernels::KernelTable&, Workspace&, SingleWorkspace&,
                                 LaneBits, LaneBits, NewtonReport&, SolveLog*) const;
template void GroupStep::advance(const kernels::KernelTable&, SingleWorkspace&, SingleWorkspace&,
                                 LaneBits, LaneBits, NewtonReport&, SolveLog*) const;

}  // namespace tangere
