// SPDX-License-Identifier: Apache-2.0
// Each action has a tape of its own. With the state x and the task state m before the action, m⁺
// the task state during it, and K steps with snapshots:
//   r = evaluate(snapshots, m⁺, a);  o = observe(snapshots, m⁺, a)
//   x_(k+1) = step(x_k, controls(x_0, m⁺, a))
//   x_0 = restart_state(x, m⁺, a);  m⁺ = begin_action(x, m, a)
#include "tasks/gradients/task_block.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "engine/base/as_size.hpp"
#include "engine/rows/episode_channels.hpp"
#include "tasks/run/number_row.hpp"

namespace tangere {

using kernels::kBlock;

namespace {

double bytes_of_tape(const Task& task, const TapeOptions& o) {
  return double(BlockTape::bytes(task.model(), integrator_in_force(task.model(), o.stepper),
                                 task.spec().steps_per_action));
}

/// Tapes of `segment` actions, the checkpoints between them and all records [bytes].
double bytes_with(const Task& task, const TapeOptions& o, std::int64_t segment) {
  return double(o.length) * ActionRecord::bytes(task) + double(segment) * bytes_of_tape(task, o) +
         checkpoint_bytes(task.model(), o.length, segment);
}

TapePlan plan_of(const Task& task, const TapeOptions& o, std::int64_t blocks) {
  return {o.length, task.spec().steps_per_action,
          units_on_tape(
              task.model(), o.length, bytes_of_tape(task, o), o.tape_bytes,
              [&](std::int64_t segment) { return double(blocks) * bytes_with(task, o, segment); },
              "actions")};
}

std::vector<double> lane_rows(std::size_t width) { return std::vector<double>(kBlock * width); }

/// A lane's part of rows by lane.
template <class Rows>
auto part(Rows& all, int lane) {
  const std::size_t width = all.size() / kBlock;
  return std::span(all).subspan(as_size(lane) * width, width);
}

void clear(std::initializer_list<std::vector<double>*> all) {
  for (std::vector<double>* x : all) std::fill(x->begin(), x->end(), 0.0);
}

/// Adds to rows of lanes what there is of them.
void add_rows(std::span<const double> from, std::vector<double>& to) {
  for (std::size_t i = 0; i < from.size(); ++i) to[i] += from[i];
}

}  // namespace

TapeOptions options_for(const Task& task, TapeOptions o, const char* what) {
  if (o.length < 0 || o.length > task.spec().horizon)
    throw InputError(
        fmt::format("{} of {} actions of task {}; expected 1 to {}, its horizon, or 0 for all",
                    what, o.length, task.spec().name, task.spec().horizon));
  if (o.length == 0) o.length = task.spec().horizon;
  if (!(o.tape_bytes > 0))
    throw InputError(fmt::format("tapes of {} bytes; expected a positive number", o.tape_bytes));
  return o;
}

TaskBlock::TaskBlock(const Task& task, const TapeOptions& options, std::int64_t blocks)
    : TapeBlock(task.model(), options, 1, plan_of(task, options, blocks)),
      task_(task),
      options_(options),
      rollout_(task, options.stepper, options.precision),
      records_(as_size(options.length), ActionRecord(task)),
      shear_arrays_(shear_state_arrays(task.model())),
      start_(task.model(), Integrator::bdf1, 0),
      snapshot_cotangents_(task.spec().snapshots.size()),
      start_q_(lane_rows(as_size(task.model().nv()))),
      start_v_(start_q_),
      u_bar_(lane_rows(as_size(task.model().nu()))),
      action_bar_(lane_rows(task.spec().action.size())),
      task_state_bar_(lane_rows(as_size(task.spec().task_state))),
      shown_(lane_rows(task.spec().observation_size())),
      shown_q_(start_q_),
      shown_v_(start_q_),
      reward_bar_(kBlock) {
  // A restart is the earlier states of a reading, whose steps go on.
  if (task.spec().restarts) check_has_no_lag(task.model(), task.fields());
  const auto end_effectors = lane_rows(task.end_effectors_size()),
             tactile = lane_rows(task.tactile_size()), bodies = lane_rows(task.bodies_size()),
             shear_state = lane_rows(task.shear_state_size());
  snapshots_bar_.assign(snapshot_cotangents_.size(),
                        {start_q_, start_v_, end_effectors, tactile, bodies, shear_state});
  if (task_.spec().warm_up)
    warm_up_.assign(snapshots_bar_.size() - 1, {lane_rows(as_size(task.model().nq())), start_v_,
                                                end_effectors, tactile, bodies, shear_state});
}

double TaskBlock::bytes(const Task& task, const TapeOptions& o, std::int64_t blocks) {
  // Cotangents of snapshots, and snapshots of a warm-up, have the size of snapshots.
  const double moments = (task.spec().warm_up ? 3 : 2) * BlockWorker::bytes(task);
  return std::min(double(blocks) * bytes_with(task, o, o.length), o.tape_bytes) +
         double(blocks) * (moments + double(Stepper::workspace_bytes(task.model()) +
                                            kBlock * Stepper::candidate_bytes(task.model())));
}

void TaskBlock::start(std::uint64_t seed, EpisodeRange episodes, bool record) {
  std::vector<std::int64_t> numbers(as_size(episodes.end - episodes.first));
  std::iota(numbers.begin(), numbers.end(), episodes.first);
  rollout_.start(seed, numbers);
  start_.start(rollout_.batch(), 0);
  start_forward(record);
  took_.fill(false);
  first_varying_.clear();
  for (int l = 0; l < lanes(); ++l) {
    start_shear_[as_size(l)] = rollout_.batch().shear_state(l);
    const std::span<const Snapshot> seen = rollout_.start_view(l).snapshots;
    for (std::size_t m = 0; m < warm_up_.size(); ++m) {
      const auto keep = [l](std::span<const double> from, std::vector<double>& to) {
        std::copy(from.begin(), from.end(), part(to, l).begin());
      };
      keep(seen[m].q, warm_up_[m].q);
      keep(seen[m].v, warm_up_[m].v);
      keep(seen[m].end_effectors, warm_up_[m].end_effectors);
      keep(seen[m].tactile, warm_up_[m].tactile);
      keep(seen[m].bodies, warm_up_[m].bodies);
      keep(seen[m].shear_state, warm_up_[m].shear_state);
    }
  }
}

void TaskBlock::displace(std::span<const double> q, std::span<const double> v,
                         std::span<const double> shear_state) {
  for (int l = 0; l < lanes(); ++l) {
    rollout_.displace(l, number_row(q, l, as_size(model_.nq())),
                      number_row(v, l, as_size(model_.nv())));
    if (shear_state.empty()) continue;
    // Every point has an entry, so that there are derivatives by displacements of zero.
    start_shear_[as_size(l)] =
        shear_arrays_.read_all(number_row(shear_state, l, 3 * shear_arrays_.count()));
    rollout_.batch().set_shear_state(l, start_shear_[as_size(l)]);
  }
  start_.start(rollout_.batch(), 0);
  rollout_.record_start();
  for (int l = 0; l < lanes(); ++l) rollout_.observe_start(l);
}

void TaskBlock::step(std::span<const double> actions, std::span<const double> varying) {
  took_.fill(false);
  if (!rollout_.running()) return;
  ActionRecord& r = records_[as_size(taken_)];
  if (!varying.empty() && first_varying_.empty()) first_varying_ = rollout_.varying();
  r.varying.assign(varying.begin(), varying.end());
  if (!varying.empty()) rollout_.set_varying(varying);
  std::copy(actions.begin(), actions.end(), r.chosen.begin());
  take(r);
}

void TaskBlock::take(ActionRecord& r) {
  rollout_.begin(r);
  took_ = r.taken;
  take_tape(rollout_.batch(), 0);
}

void TaskBlock::take_steps(std::int64_t, BlockTape* tape) {
  rollout_.take_steps(tape);
  rollout_.conclude();
}

/// Sets the numbers of <randomize> that an action had; -1: those of the start.
void TaskBlock::restore_varying(std::int64_t action) {
  if (first_varying_.empty()) return;
  while (action >= 0 && records_[as_size(action)].varying.empty()) --action;
  rollout_.set_varying(action < 0 ? first_varying_ : records_[as_size(action)].varying);
}

void TaskBlock::retake_steps(std::int64_t action, bool from_checkpoint, BlockTape& tape) {
  restore_varying(action);
  if (!from_checkpoint) rollout_.recompute_restart(records_[as_size(action)], action);
  rollout_.retake_steps(records_[as_size(action)], action, tape);
}

void TaskBlock::begin_reverse() {
  start_back();
  clear({&task_state_bar_, &shown_, &shown_q_, &shown_v_});
}

void TaskBlock::add_to_shown(const ActionCotangents& by) {
  add_rows(by.observation, shown_);
  add_rows(by.q, shown_q_);
  add_rows(by.v, shown_v_);
}

/// Moves the derivatives by the scene's numbers since they were set to `bar`, (lanes, numbers).
void TaskBlock::take_parameters(std::span<double> bar) {
  BlockCotangent& c = adjoint_.loss(0);
  const std::size_t width = as_size(parameters_.count());
  for (int l = 0; l < lanes() && !bar.empty(); ++l)
    parameters_.gradient(c, rollout_.batch(), l, number_row(bar, l, width));
  std::ranges::fill(c.parameters, 0.0);
}

void TaskBlock::reverse(std::int64_t action, const ActionCotangents& by,
                        std::span<double> action_bar, std::span<double> parameter_bar) {
  add_to_shown(by);
  clear({&reward_bar_});
  add_rows(by.reward, reward_bar_);
  std::fill(action_bar.begin(), action_bar.end(), 0.0);
  std::ranges::fill(parameter_bar, 0.0);
  if (action >= taken_) return;  // no lane took it
  reverse_tape(rollout_.batch(), 0);
  const ActionRecord& r = records_[as_size(action)];
  if (!r.varying.empty()) take_parameters(parameter_bar);
  const TensorSpec& spec = task_.spec().action;
  for (int l = 0; l < lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    for (std::size_t k = 0; k < spec.size(); ++k) {
      const double requested = part(r.chosen, l)[k];
      if (requested >= spec.low && requested <= spec.high)
        action_bar[as_size(l) * spec.size() + k] = part(action_bar_, l)[k];
    }
    for (std::vector<double>* x : {&shown_, &shown_q_, &shown_v_})  // already added
      std::ranges::fill(part(*x, l), 0.0);
  }
}

/// Moves the adjoint's cotangents from the state after an action to the state in which the action
/// was chosen.
void TaskBlock::reverse_steps(std::int64_t action, const BlockTape& tape) {
  const ActionRecord& r = records_[as_size(action)];
  const std::vector<int>& snapshots = task_.spec().snapshots;
  const int every = task_.spec().control_every;
  clear({&start_q_, &start_v_, &u_bar_, &action_bar_});
  restore_varying(action);
  rollout_.recompute_snapshots(tape);
  reverse_outcome(r, action);
  std::size_t next = snapshots.size();
  for (int t = task_.spec().steps_per_action; t > 0; --t) {
    if (next > 0 && snapshots[next - 1] == t) {
      tape.show(t, rollout_.batch(), 0);
      add_snapshot(--next);
    }
    if (t % every == 0 || t == task_.spec().steps_per_action)
      rollout_.recompute_controls(r, action, (t - 1) / every * every, tape);
    adjoint_.reverse_step(rollout_.batch(), 0, tape, t - 1, rollout_.u());
    for (int l = 0; l < lanes(); ++l) {
      const std::span<double> u_bar = part(u_bar_, l);
      for (std::size_t k = 0; k < u_bar.size(); ++k)
        u_bar[k] += adjoint_.loss(0).u[k * kBlock + as_size(l)];
    }
    if ((t - 1) % every == 0) reverse_controls(r, action, t - 1, tape);
  }
  reverse_start(r, action);
}

/// Pulls cotangents of the reward, the observation and the state after an action back to the
/// snapshots, the task state and the action.
void TaskBlock::reverse_outcome(const ActionRecord& r, std::int64_t action) {
  clear_snapshots();
  for (int l = 0; l < lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    const TaskView view =
        rollout_.view(r, action + 1, l, part(r.task_state, l), rollout_.snapshots(l));
    const ViewCotangent to{cotangents(l), part(action_bar_, l), part(task_state_bar_, l),
                           part(adjoint_.loss(0).points, l)};
    const double weight = reward_bar_[as_size(l)];
    if (weight != 0) task_.reward_vjp(view, weight, to);
    reverse_observation(view, l, to);
  }
}

void TaskBlock::clear_snapshots() {
  for (SnapshotRows& m : snapshots_bar_)
    clear({&m.q, &m.v, &m.end_effectors, &m.tactile, &m.bodies, &m.shear_state});
}

/// Pulls cotangents of a lane's observation and state back and adds them. An observation with zero
/// cotangent needs no derivative.
void TaskBlock::reverse_observation(const TaskView& view, int lane, const ViewCotangent& to) {
  const std::span<const double> weight = part(shown_, lane);
  if (std::any_of(weight.begin(), weight.end(), [](double w) { return w != 0; }))
    task_.observe_vjp(view, weight, to);
  const SnapshotCotangent& now = to.snapshots.back();
  for (std::size_t i = 0; i < now.q.size(); ++i) {
    now.q[i] += part(shown_q_, lane)[i];
    now.v[i] += part(shown_v_, lane)[i];
  }
}

/// Adds cotangents of a snapshot, whose state is in the batch, to those of the state.
void TaskBlock::add_snapshot(std::size_t moment) {
  const SnapshotRows& m = snapshots_bar_[moment];
  BlockCotangent& c = adjoint_.loss(0);
  for (int l = 0; l < lanes(); ++l) {
    const std::span<const double> q = part(m.q, l), v = part(m.v, l);
    for (std::size_t i = 0; i < q.size(); ++i) {
      c.q[i * kBlock + as_size(l)] += q[i];
      c.v[i * kBlock + as_size(l)] += v[i];
    }
  }
  for (int l = 0; l < lanes() && !m.shear_state.empty(); ++l)
    add_shear_state(part(m.shear_state, l), l);
  if (m.end_effectors.empty() && m.tactile.empty() && m.bodies.empty()) return;
  pullback_.place(rollout_.batch(), 0);
  pullback_.clear();
  for (int l = 0; l < lanes(); ++l) add_readings(moment, l);
  pullback_.finish(c);
}

/// Adds cotangents of a lane's shear state, whose entries are in the batch. A point without an
/// entry has the constant 0.
void TaskBlock::add_shear_state(std::span<const double> bar, int lane) {
  const ShearState& entries = rollout_.batch().shear_state(lane);
  std::vector<double>& to = adjoint_.loss(0).shear[as_size(lane)];
  to.resize(3 * entries.size());
  for (std::size_t k = 0; k < to.size(); ++k)
    to[k] += bar[shear_arrays_.first_of(entries[k / 3]) + k % 3];
}

void TaskBlock::add_readings(std::size_t moment, int lane) {
  const std::span<const double> end_effectors = part(snapshots_bar_[moment].end_effectors, lane),
                                bodies = part(snapshots_bar_[moment].bodies, lane);
  std::span<const double> fields = part(snapshots_bar_[moment].tactile, lane);
  for (std::size_t k = 0; 3 * k < end_effectors.size(); ++k)
    pullback_.end_effector(lane, static_cast<int>(k), end_effectors.subspan(3 * k, 3));
  const std::size_t nb = bodies.size() / kMotion;
  for (std::size_t b = 0; b < nb; ++b)
    pullback_.body(lane, static_cast<int>(b), bodies.subspan(7 * b, 7),
                   bodies.subspan(7 * nb + 6 * b, 6));
  BlockCotangent& c = adjoint_.loss(0);
  for (const FieldOutput& output : task_.fields()) {
    const int s = output.sensor;
    const std::size_t numbers = numbers_of(task_.model(), output);
    const std::span<double> points = c.points_of(task_.model(), s, lane);
    if (is_picture(output.form))
      pullback_.picture(lane, output, fields.first(numbers), c.parameters);
    else if (output.form == FieldForm::pressure)
      pullback_.pressure(lane, s, fields.first(numbers), c.parameters, points);
    else if (output.form == FieldForm::ideal)
      pullback_.ideal_field(lane, s, fields.first(numbers), c.parameters, points);
    else
      pullback_.dense_field(lane, s, fields.first(numbers), c.parameters, points);
    fields = fields.subspan(numbers);
  }
}

/// Reverses the controls that hold from `step` on.
void TaskBlock::reverse_controls(const ActionRecord& r, std::int64_t action, int step,
                                 const BlockTape& tape) {
  for (int l = 0; l < lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    const Snapshot first = rollout_.first_moment(tape, l);
    const SnapshotCotangent to{part(start_q_, l), part(start_v_, l), {}, {}};
    task_.controls_vjp(rollout_.view(r, action, l, part(r.task_state, l), {&first, 1}), step,
                       part(u_bar_, l), {{&to, 1}, part(action_bar_, l), part(task_state_bar_, l)});
  }
  std::fill(u_bar_.begin(), u_bar_.end(), 0.0);
}

/// Pulls cotangents back through the restart and the update of the task state to the state in which
/// the action was chosen.
void TaskBlock::reverse_start(const ActionRecord& r, std::int64_t action) {
  BlockCotangent& c = adjoint_.loss(0);
  const std::size_t nv = as_size(task_.model().nv());
  for (int l = 0; l < lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    const auto at = [l](AlignedVector<double>& rows, std::size_t i) -> double& {
      return rows[i * kBlock + as_size(l)];
    };
    const std::span<double> q = part(start_q_, l), v = part(start_v_, l),
                            memory = part(task_state_bar_, l);
    const std::span<double> action_bar = part(action_bar_, l);
    const Snapshot seen{part(r.q, l), part(r.v, l), {}, {}};
    if (task_.spec().restarts) {
      std::vector<double> placed_q(q.begin(), q.end()), placed_v(v.begin(), v.end());
      for (std::size_t i = 0; i < nv; ++i) {
        placed_q[i] += at(c.q, i);
        placed_v[i] += at(c.v, i);
        q[i] = v[i] = at(c.q, i) = at(c.v, i) = at(c.previous_q, i) = at(c.previous_v, i) = 0;
      }
      c.shear[as_size(l)].clear();  // a restart clears the shear state
      const SnapshotCotangent to{q, v, {}, {}};
      task_.restart_state_vjp(rollout_.view(r, action, l, part(r.task_state, l), {&seen, 1}),
                              placed_q, placed_v, {{&to, 1}, action_bar, memory});
    }
    const SnapshotCotangent to{q, v, {}, {}};
    task_.begin_action_vjp(rollout_.view(r, action, l, part(r.found, l), {&seen, 1}), memory,
                           {{&to, 1}, action_bar, {}});
    for (std::size_t i = 0; i < nv; ++i) {
      at(c.q, i) += q[i];
      at(c.v, i) += v[i];
    }
  }
}

std::span<const SnapshotCotangent> TaskBlock::cotangents(int lane) {
  for (std::size_t m = 0; m < snapshots_bar_.size(); ++m) {
    SnapshotRows& rows = snapshots_bar_[m];
    snapshot_cotangents_[m] = {
        part(rows.q, lane),       part(rows.v, lane),      part(rows.end_effectors, lane),
        part(rows.tactile, lane), part(rows.bodies, lane), part(rows.shear_state, lane)};
  }
  return snapshot_cotangents_;
}

/// Copies the states in which the first actions began into the batch.
void TaskBlock::add_start_to_shown() {
  start_.show(0, rollout_.batch(), 0);
  rollout_.record_start();
}

void TaskBlock::reverse_reset(const ActionCotangents& by, const StartCotangents& out) {
  restore_varying(-1);
  add_to_shown(by);
  add_start_to_shown();
  clear_snapshots();
  const std::vector<double> no_action(task_.spec().action.size());
  std::vector<double> unused_action_bar(no_action.size()),
      task_state_bar(as_size(task_.spec().task_state));
  for (int l = 0; l < lanes(); ++l) {
    TaskView view = rollout_.start_view(l);
    std::vector<Snapshot> seen(view.snapshots.begin(), view.snapshots.end());
    for (std::size_t m = 0; m < warm_up_.size(); ++m) {
      const SnapshotRows& kept = warm_up_[m];
      seen[m] = {part(kept.q, l),       part(kept.v, l),      part(kept.end_effectors, l),
                 part(kept.tactile, l), part(kept.bodies, l), part(kept.shear_state, l)};
    }
    view.actions = 0;
    view.action = no_action;
    if (taken_ > 0) view.task_state = part(records_[0].found, l);
    view.snapshots = seen;
    reverse_observation(view, l,
                        {cotangents(l).last(seen.size()), unused_action_bar, task_state_bar,
                         part(adjoint_.loss(0).points, l)});
  }
  add_snapshot(snapshots_bar_.size() - 1);
  for (int l = 0; l < lanes(); ++l) {
    const auto own = [&](std::span<double> all) {
      const std::size_t width = all.size() / as_size(lanes());
      return all.subspan(as_size(l) * width, width);
    };
    get_start(0, rollout_.batch(), l, own(out.q), own(out.v), own(out.parameters), own(out.points));
    const std::span<double> shear = own(out.shear_state);
    std::ranges::fill(shear, 0.0);
    const std::vector<double>& bar = adjoint_.loss(0).shear[as_size(l)];
    for (std::size_t k = 0; k < bar.size() && !shear.empty(); ++k)
      shear[shear_arrays_.first_of(start_shear_[as_size(l)][k / 3]) + k % 3] = bar[k];
  }
}

void TaskBlock::play(std::uint64_t seed, EpisodeRange episodes, const TaskActions& actions,
                     std::int64_t to, TaskGradients& out,
                     std::vector<FailedEnvironment>& failures) {
  start(seed, episodes);
  const int count = lanes();
  std::vector<bool> solved(as_size(count), true);
  const auto note_failures = [&](std::int64_t action) {
    for (int l = 0; l < count; ++l) {
      const StepStatus status = rollout_.batch().status(l);
      if (failed(status) && solved[as_size(l)])
        failures.push_back({static_cast<int>(to) + l, action, status});
      solved[as_size(l)] = !failed(status);
    }
  };
  note_failures(-1);
  while (taken_ < plan_.tapes && may_go_on() && rollout_.running()) {
    ActionRecord& r = records_[as_size(taken_)];
    rollout_.choose(actions, r);
    take(r);
    note_failures(taken_ - 1);
  }
  newton_iterations_ += rollout_.counts().steps.newton_iterations;
  if (stopped()) return;
  begin_reverse();
  const std::size_t width = task_.spec().action.size(), row = as_size(options_.length) * width;
  const std::vector<double> ones(as_size(count), 1.0);
  std::vector<double> action_bar(as_size(count) * width);
  for (std::int64_t a = taken_ - 1; a >= 0 && may_go_on(); --a) {
    reverse(a, {.reward = ones}, action_bar, {});
    for (int l = 0; l < count; ++l) {
      if (!records_[as_size(a)].taken[as_size(l)]) continue;
      const std::size_t at = as_size(to + l) * row + as_size(a) * width;
      std::ranges::copy(part(records_[as_size(a)].chosen, l),
                        out.action.begin() + std::ptrdiff_t(at));
      std::ranges::copy(number_row(action_bar, l, width), out.u.begin() + std::ptrdiff_t(at));
    }
  }
  if (!stopped()) finish_return(to, out);
}

void TaskBlock::finish_return(std::int64_t to, TaskGradients& out) {
  for (int l = 0; l < lanes(); ++l) {
    const std::size_t e = as_size(to + l);
    const auto own = [&](std::vector<double>& all) {
      const std::size_t width = all.size() / out.value.size();
      return std::span(all).subspan(e * width, width);
    };
    out.value[e] = rollout_.data().returns[as_size(l)];
    out.length[e] = rollout_.data().length[as_size(l)];
    get_start(0, rollout_.batch(), l, own(out.q), own(out.v), own(out.parameters), {});
  }
}

}  // namespace tangere
