// SPDX-License-Identifier: Apache-2.0
// A stretch is one action, with a tape of its own.
// An action begins at x and finds the memory m. It leaves m⁺, with K steps and looks in between:
//   r = judge(moments, m⁺, a);  o = observe(moments, m⁺, a)
//   x_(k+1) = step(x_k, controls(x_0, m⁺, a));  x_0 = place(x, m⁺, a);  m⁺ = begin_action(x, m, a)
#include "tasks/gradients/action_block.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/as_size.hpp"

namespace tangere {

using kernels::kBlock;

namespace {

double tape_bytes(const ActionTapes& t) {
  const Integrator scheme = integrator_in_force(t.task.model(), t.stepper);
  return double(BlockTape::bytes(t.task.model(), scheme, t.task.spec().steps_per_action));
}

/// Bytes of a block's tapes of `segment` actions and of the checkpoints between them.
double bytes_with(const ActionTapes& t, std::int64_t segment) {
  const double records = double(t.actions) * ActionRecord::bytes(t.task);
  const double checkpoints = segment == t.actions ? 0
                                                  : std::ceil(double(t.actions) / double(segment)) *
                                                        checkpoint_bytes(t.task.model());
  return records + double(segment) * tape_bytes(t) + checkpoints;
}

}  // namespace

TapePlan plan_of(const ActionTapes& t) {
  return {t.actions, t.task.spec().steps_per_action,
          units_on_tape(
              t.task.model(), t.actions, tape_bytes(t), t.bytes,
              [&](std::int64_t segment) { return double(t.blocks) * bytes_with(t, segment); },
              "actions")};
}

double bytes_of(const ActionTapes& t) {
  return std::min(double(t.blocks) * bytes_with(t, t.actions), t.bytes);
}

ActionBlock::ActionBlock(const ActionTapes& tapes, Precision precision, bool parameters)
    : GradientBlock(tapes.task.model(), tapes.stepper, {1, parameters}, plan_of(tapes)),
      task_(tapes.task),
      rollout_(tapes.task, tapes.stepper, precision),
      records_(as_size(tapes.actions), ActionRecord(tapes.task)),
      by_action_(kBlock * tapes.task.spec().action.size()),
      by_memory_(kBlock * as_size(tapes.task.spec().task_state)),
      moments_(tapes.task.spec().snapshots.size()),
      to_moments_(moments_.size()),
      start_q_(kBlock * as_size(tapes.task.model().nv())),
      start_v_(start_q_.size()),
      by_u_(kBlock * as_size(tapes.task.model().nu())) {
  if (task_.spec().reads_tactile) check_has_no_lag(task_.model());
  for (MomentRows& m : moments_) {
    m.q = m.v = start_q_;
    m.end_effectors.resize(kBlock * task_.end_effectors_size());
    m.tactile.resize(kBlock * task_.tactile_size());
  }
}

double ActionBlock::workspace_bytes(const Task& task) {
  return BlockWorker::bytes(task) + 2 * double(Stepper::workspace_bytes(task.model()));
}

void ActionBlock::start(std::uint64_t seed, std::span<const std::int64_t> episodes) {
  rollout_.start(seed, episodes);
  std::fill(by_memory_.begin(), by_memory_.end(), 0.0);
}

void ActionBlock::take_steps(std::int64_t, BlockTape* tape) {
  rollout_.take_steps(tape);
  rollout_.conclude();
}

void ActionBlock::retake_steps(std::int64_t action, bool from_checkpoint, BlockTape& tape) {
  if (!from_checkpoint) rollout_.recompute_restart(records_[as_size(action)], action);
  rollout_.retake_steps(records_[as_size(action)], action, tape);
}

/// Moves the adjoint's cotangents from the state after an action to the state in which the action
/// was chosen.
void ActionBlock::reverse_action(std::int64_t action, const BlockTape& tape,
                                 const AfterAction& after) {
  const ActionRecord& r = records_[as_size(action)];
  const std::vector<int>& looks = task_.spec().snapshots;
  const int every = task_.spec().control_every;
  for (std::vector<double>* x : {&start_q_, &start_v_, &by_u_, &by_action_})
    std::fill(x->begin(), x->end(), 0.0);
  rollout_.recompute_snapshots(tape);
  reverse_judgement(r, action, after);
  std::size_t next = looks.size();
  for (int t = task_.spec().steps_per_action; t > 0; --t) {
    if (next > 0 && looks[next - 1] == t) {
      tape.show(t, rollout_.batch(), 0);
      add_moment(--next);
    }
    if (t % every == 0 || t == task_.spec().steps_per_action)
      rollout_.recompute_controls(r, action, (t - 1) / every * every, tape);
    adjoint_.reverse_step(rollout_.batch(), 0, tape, t - 1, rollout_.u());
    for (int l = 0; l < rollout_.lanes(); ++l) {
      const std::span<double> by_u = part(by_u_, l);
      for (std::size_t k = 0; k < by_u.size(); ++k)
        by_u[k] += adjoint_.loss(0).u[k * kBlock + as_size(l)];
    }
    if ((t - 1) % every == 0) reverse_controls(r, action, t - 1, tape);
  }
  reverse_start(r, action);
}

/// Adds what the reward, the observation and the state after an action pass on to the moments, the
/// memory and the action.
void ActionBlock::reverse_judgement(const ActionRecord& r, std::int64_t action,
                                    const AfterAction& after) {
  clear_moments();
  for (int l = 0; l < rollout_.lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    const TaskView view =
        rollout_.view(r, action + 1, l, part(r.task_state, l), rollout_.snapshots(l));
    const ViewCotangent to{cotangents(l), part(by_action_, l), part(by_memory_, l)};
    if (after.reward[as_size(l)] != 0) task_.reward_vjp(view, after.reward[as_size(l)], to);
    add_seen(view, l, after, to);
  }
}

void ActionBlock::clear_moments() {
  for (MomentRows& m : moments_)
    for (std::vector<double>* x : {&m.q, &m.v, &m.end_effectors, &m.tactile})
      std::fill(x->begin(), x->end(), 0.0);
}

/// Adds what a lane's observation and the state that it shows pass on. An observation that has no
/// weight needs no derivative.
void ActionBlock::add_seen(const TaskView& view, int lane, const AfterAction& after,
                           const ViewCotangent& to) {
  const auto own = [lane](std::span<const double> rows) {
    const std::size_t width = rows.size() / kBlock;
    return rows.subspan(as_size(lane) * width, width);
  };
  const std::span<const double> weight = own(after.observation), q = own(after.q), v = own(after.v);
  if (std::any_of(weight.begin(), weight.end(), [](double w) { return w != 0; }))
    task_.observe_vjp(view, weight, to);
  const SnapshotCotangent& now = to.snapshots.back();
  for (std::size_t i = 0; i < q.size(); ++i) now.q[i] += q[i];
  for (std::size_t i = 0; i < v.size(); ++i) now.v[i] += v[i];
}

/// Adds cotangents of a moment, whose states the batch shows, to those of the state.
void ActionBlock::add_moment(std::size_t moment) {
  const MomentRows& m = moments_[moment];
  BlockCotangent& c = adjoint_.loss(0);
  for (int l = 0; l < rollout_.lanes(); ++l) {
    const std::span<const double> q = part(m.q, l), v = part(m.v, l);
    for (std::size_t i = 0; i < q.size(); ++i) {
      c.q[i * kBlock + as_size(l)] += q[i];
      c.v[i * kBlock + as_size(l)] += v[i];
    }
  }
  if (m.end_effectors.empty() && m.tactile.empty()) return;
  pullback_.place(rollout_.batch(), 0);
  pullback_.clear();
  for (int l = 0; l < rollout_.lanes(); ++l) add_fields(moment, l);
  pullback_.finish(c);
}

void ActionBlock::add_fields(std::size_t moment, int lane) {
  const std::span<const double> end_effectors = part(moments_[moment].end_effectors, lane);
  std::span<const double> fields = part(moments_[moment].tactile, lane);
  for (std::size_t k = 0; 3 * k < end_effectors.size(); ++k)
    pullback_.end_effector(lane, static_cast<int>(k), end_effectors.subspan(3 * k, 3));
  const auto sensors = task_.model().sensors();
  for (std::size_t s = 0; s < sensors.size() && !fields.empty(); ++s) {
    const std::size_t numbers = 3 * as_size(sensors[s].points);
    pullback_.dense_field(lane, static_cast<int>(s), fields.first(numbers),
                          adjoint_.loss(0).parameters);
    fields = fields.subspan(numbers);
  }
}

/// Reverses the controls that hold from `step` on.
void ActionBlock::reverse_controls(const ActionRecord& r, std::int64_t action, int step,
                                   const BlockTape& tape) {
  for (int l = 0; l < rollout_.lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    const Snapshot first = rollout_.first_moment(tape, l);
    const SnapshotCotangent to{part(start_q_, l), part(start_v_, l), {}, {}};
    task_.controls_vjp(rollout_.view(r, action, l, part(r.task_state, l), {&first, 1}), step,
                       part(by_u_, l), {{&to, 1}, part(by_action_, l), part(by_memory_, l)});
  }
  std::fill(by_u_.begin(), by_u_.end(), 0.0);
}

/// Goes back to where the action was chosen, through a restart and through the update of the
/// memory.
void ActionBlock::reverse_start(const ActionRecord& r, std::int64_t action) {
  BlockCotangent& c = adjoint_.loss(0);
  const std::size_t nv = as_size(task_.model().nv());
  for (int l = 0; l < rollout_.lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    const auto at = [l](AlignedVector<double>& rows, std::size_t i) -> double& {
      return rows[i * kBlock + as_size(l)];
    };
    const std::span<double> q = part(start_q_, l), v = part(start_v_, l),
                            memory = part(by_memory_, l);
    const std::span<double> by_action = part(by_action_, l);
    const Snapshot seen{part(r.q, l), part(r.v, l), {}, {}};
    if (task_.spec().restarts) {
      std::vector<double> placed_q(q.begin(), q.end()), placed_v(v.begin(), v.end());
      for (std::size_t i = 0; i < nv; ++i) {
        placed_q[i] += at(c.q, i);
        placed_v[i] += at(c.v, i);
        q[i] = v[i] = at(c.q, i) = at(c.v, i) = at(c.previous_q, i) = at(c.previous_v, i) = 0;
      }
      c.shear[as_size(l)].clear();  // friction remembers nothing of before
      const SnapshotCotangent to{q, v, {}, {}};
      task_.restart_state_vjp(rollout_.view(r, action, l, part(r.task_state, l), {&seen, 1}),
                              placed_q, placed_v, {{&to, 1}, by_action, memory});
    }
    const SnapshotCotangent to{q, v, {}, {}};
    task_.begin_action_vjp(rollout_.view(r, action, l, part(r.found, l), {&seen, 1}), memory,
                           {{&to, 1}, by_action, {}});
    for (std::size_t i = 0; i < nv; ++i) {
      at(c.q, i) += q[i];
      at(c.v, i) += v[i];
    }
  }
}

std::span<double> ActionBlock::part(std::vector<double>& all, int lane) {
  const std::size_t width = all.size() / kBlock;
  return std::span(all).subspan(as_size(lane) * width, width);
}
std::span<const double> ActionBlock::part(const std::vector<double>& all, int lane) {
  const std::size_t width = all.size() / kBlock;
  return std::span(all).subspan(as_size(lane) * width, width);
}

std::span<const SnapshotCotangent> ActionBlock::cotangents(int lane) {
  for (std::size_t m = 0; m < moments_.size(); ++m) {
    MomentRows& rows = moments_[m];
    to_moments_[m] = {part(rows.q, lane), part(rows.v, lane), part(rows.end_effectors, lane),
                      part(rows.tactile, lane)};
  }
  return to_moments_;
}

}  // namespace tangere
