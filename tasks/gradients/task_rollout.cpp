// SPDX-License-Identifier: Apache-2.0
// Takes the parts of a VectorTask's action one by one, and repeats them for the reverse pass.
#include "tasks/gradients/task_rollout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/as_size.hpp"
#include "tasks/run/number_row.hpp"

namespace tangere {

using kernels::kBlock;

ActionRecord::ActionRecord(const Task& task) {
  const auto rows = [](std::size_t width) { return std::vector<double>(kBlock * width); };
  q = rows(as_size(task.model().nq()));
  v = rows(as_size(task.model().nv()));
  found = task_state = rows(as_size(task.spec().task_state));
  chosen = action = rows(task.spec().action.size());
}

double ActionRecord::bytes(const Task& task) {
  const std::size_t numbers = as_size(task.model().nq()) + as_size(task.model().nv()) +
                              2 * as_size(task.spec().task_state) + 2 * task.spec().action.size() +
                              task.model().scene().randomizations.size();
  return static_cast<double>(numbers * kBlock * sizeof(double) + sizeof(ActionRecord));
}

TaskRollout::TaskRollout(const Task& task, const StepperOptions& options, Precision precision)
    : task_(task),
      worker_(task, precision),
      options_(differentiable(options)),
      integrator_(integrator_in_force(task.model(), options_)),
      u_(kBlock * as_size(task.model().nu())),
      q_(as_size(task.model().nq())),
      v_(as_size(task.model().nv())) {}

Stepper& TaskRollout::stepper() {
  if (shared_ != nullptr) return *shared_;
  if (!own_) own_ = std::make_unique<Stepper>(task_.model(), options_);
  return *own_;
}

void TaskRollout::start(std::uint64_t seed, std::span<const std::int64_t> episodes) {
  const auto count = static_cast<int>(episodes.size());
  batch_.emplace(task_.model(), count, seed);
  data_.emplace(task_, count);
  std::copy(episodes.begin(), episodes.end(), data_->next_episode.begin());
  counts_ = {};
  std::fill(u_.begin(), u_.end(), 0.0);
  worker_.begin(*batch_, *data_, 0, {});
  if (task_.spec().warm_up) {
    for (int k = 0; k < task_.spec().steps_per_action; ++k) {
      worker_.compute_controls(*batch_, *data_, 0, k);
      stepper().step_block(*batch_, 0, data_->u);
      worker_.record_snapshot(*batch_, 0, k, counts_);
    }
  } else {
    worker_.record_start(*batch_, 0);
  }
  worker_.conclude(*batch_, *data_, 0, counts_);
}

void TaskRollout::displace(int lane, std::span<const double> q, std::span<const double> v) {
  batch_->displace_state(lane, q, v);
  std::copy(q.begin(), q.end(), number_row(data_->q, lane, q.size()).begin());
  std::copy(v.begin(), v.end(), number_row(data_->v, lane, v.size()).begin());
}

std::vector<double> TaskRollout::varying() const {
  const auto count = static_cast<int>(task_.model().scene().randomizations.size());
  std::vector<double> values;
  for (int l = 0; l < lanes(); ++l)
    for (int k = 0; k < count; ++k) values.push_back(batch_->randomized_value(l, k));
  return values;
}

void TaskRollout::set_varying(std::span<const double> values) {
  const std::size_t count = task_.model().scene().randomizations.size();
  for (int l = 0; l < lanes(); ++l) batch_->set_all_randomized(l, number_row(values, l, count));
}

void TaskRollout::record_start() { worker_.record_start(*batch_, 0); }

TaskView TaskRollout::start_view(int lane) const {
  TaskView view = view_of(*batch_, *data_, lane);
  const std::span<const Snapshot> seen = worker_.snapshots(lane);
  view.snapshots = task_.spec().warm_up ? seen : seen.last(1);
  return view;
}

void TaskRollout::observe_start(int lane) {
  task_.observe(start_view(lane),
                number_row(data_->observation, lane, task_.spec().observation_size()));
}

bool TaskRollout::running() const {
  return std::any_of(data_->state.begin(), data_->state.end(),
                     [](EnvironmentState s) { return s == EnvironmentState::running; });
}

void TaskRollout::choose(const TaskActions& actions, ActionRecord& r) {
  const std::size_t width = task_.spec().action.size(), seen = task_.spec().observation_size();
  for (int l = 0; l < lanes(); ++l) {
    if (data_->state[as_size(l)] != EnvironmentState::running) continue;
    const std::span<double> requested = number_row(r.chosen, l, width);
    actions(view_of(*batch_, *data_, l), number_row(data_->observation, l, seen), requested);
    for (std::size_t k = 0; k < width; ++k)
      if (!std::isfinite(requested[k]))
        throw InputError(
            fmt::format("number {} of action {} of episode {} is {}; expected a finite number", k,
                        data_->length[as_size(l)], data_->episodes[as_size(l)], requested[k]));
  }
}

void TaskRollout::begin(ActionRecord& r) {
  for (int l = 0; l < lanes(); ++l)
    r.taken[as_size(l)] = data_->state[as_size(l)] == EnvironmentState::running;
  const auto keep = [&](const std::vector<double>& from, std::vector<double>& to) {
    std::copy(from.begin(), from.end(), to.begin());
  };
  keep(data_->q, r.q);
  keep(data_->v, r.v);
  keep(data_->task_state, r.found);
  worker_.begin(*batch_, *data_, 0, std::span<const double>(r.chosen).first(data_->action.size()));
  keep(data_->task_state, r.task_state);
  keep(data_->action, r.action);
}

void TaskRollout::take_steps(BlockTape* tape) {
  if (tape != nullptr) tape->start(*batch_, 0);
  for (int k = 0; k < task_.spec().steps_per_action; ++k) {
    worker_.compute_controls(*batch_, *data_, 0, k);
    stepper().step_block(*batch_, 0, data_->u, tape);
    worker_.record_snapshot(*batch_, 0, k, counts_);
  }
}

void TaskRollout::conclude() { worker_.conclude(*batch_, *data_, 0, counts_); }

void TaskRollout::recompute_restart(const ActionRecord& r, std::int64_t action) {
  if (!task_.spec().restarts) return;
  for (int l = 0; l < lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    const auto q = number_row(r.q, l, q_.size()), v = number_row(r.v, l, v_.size());
    std::copy(q.begin(), q.end(), q_.begin());
    std::copy(v.begin(), v.end(), v_.begin());
    const Snapshot seen{q, v, {}, {}};
    task_.restart_state(
        view(r, action, l, number_row(r.task_state, l, as_size(task_.spec().task_state)),
             {&seen, 1}),
        q_, v_);
    batch_->set_state(l, q_, v_);
  }
}

void TaskRollout::retake_steps(const ActionRecord& r, std::int64_t action, BlockTape& tape) {
  for (int l = 0; l < lanes(); ++l) batch_->hold(l, !r.taken[as_size(l)]);
  tape.start(*batch_, 0);
  const int every = task_.spec().control_every;
  const auto u = std::span(u_).first(as_size(lanes()) * as_size(task_.model().nu()));
  for (int k = 0; k < task_.spec().steps_per_action; ++k) {
    if (k % every == 0) recompute_controls(r, action, k, tape);
    stepper().step_block(*batch_, 0, u, &tape);
  }
}

void TaskRollout::recompute_controls(const ActionRecord& r, std::int64_t action, int step,
                                     const BlockTape& tape) {
  const std::size_t memory = as_size(task_.spec().task_state);
  for (int l = 0; l < lanes(); ++l) {
    if (!r.taken[as_size(l)]) continue;
    const Snapshot first = first_moment(tape, l);
    task_.controls(view(r, action, l, number_row(r.task_state, l, memory), {&first, 1}), step,
                   number_row(u_, l, as_size(task_.model().nu())));
  }
}

void TaskRollout::recompute_snapshots(const BlockTape& tape) {
  for (const int moment : task_.spec().snapshots) {
    tape.show(moment, *batch_, 0);
    worker_.record_snapshot(*batch_, 0, moment - 1, recounted_);
  }
}

TaskView TaskRollout::view(const ActionRecord& r, std::int64_t action, int lane,
                           std::span<const double> memory, std::span<const Snapshot> now) const {
  return {batch_->seed(),
          data_->episodes[as_size(lane)],
          action,
          memory,
          number_row(r.action, lane, task_.spec().action.size()),
          now};
}

Snapshot TaskRollout::first_moment(const BlockTape& tape, int lane) {
  const double* const column = tape.state(0) + lane;
  for (std::size_t i = 0; i < q_.size(); ++i) q_[i] = column[i * kBlock];
  for (std::size_t i = 0; i < v_.size(); ++i) v_[i] = column[(q_.size() + i) * kBlock];
  return {q_, v_, {}, {}};
}

}  // namespace tangere
