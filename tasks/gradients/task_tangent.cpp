// SPDX-License-Identifier: Apache-2.0
// Tangents of an action by its numbers, the task state and the state in which it begins.
#include "tasks/gradients/task_tangent.hpp"

#include <algorithm>
#include <numeric>

#include "engine/base/as_size.hpp"

namespace tangere {
namespace {

double product(std::span<const double> a, std::span<const double> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

/// Lane 0 of an array of rows by lane.
std::span<const double> first_lane(const std::vector<double>& all) {
  return std::span(all).first(all.size() / kernels::kBlock);
}

std::vector<double> given(std::span<const double> x, std::size_t n) {
  return x.empty() ? std::vector<double>(n) : std::vector<double>(x.begin(), x.end());
}

}  // namespace

/// Room for the results of a task's reverse functions.
struct TaskTangent::OwnCotangent {
  std::vector<std::vector<double>> q, v, end_effectors, tactile;
  std::vector<double> memory, action;
  std::vector<SnapshotCotangent> moments;

  OwnCotangent(const Task& task, std::size_t count)
      : memory(as_size(task.spec().task_state)), action(task.spec().action.size()) {
    const std::vector<double> dofs(as_size(task.model().nv()));
    for (std::size_t m = 0; m < count; ++m) {
      q.push_back(dofs);
      v.push_back(dofs);
      end_effectors.emplace_back(task.end_effectors_size());
      tactile.emplace_back(task.tactile_size());
    }
    for (std::size_t m = 0; m < count; ++m)
      moments.push_back({q[m], v[m], end_effectors[m], tactile[m]});
  }
  [[nodiscard]] ViewCotangent out() { return {moments, action, memory}; }
};

TaskTangent::TaskTangent(TaskRollout& rollout, std::span<const double> actions,
                         const StepperOptions& options)
    : rollout_(rollout),
      task_(rollout.task()),
      tangent_(task_.model(), options),
      memory_(as_size(task_.spec().task_state)),
      action_(task_.spec().action.size()) {
  const bool other = std::ranges::any_of(
      task_.fields(), [](const FieldOutput& o) { return o.form != FieldForm::field; });
  if (task_.bodies_size() > 0 || other)
    throw InputError("task " + task_.spec().name +
                     " reads bodies, pressures or ideal fields, which have no forward derivatives; "
                     "expected end effectors and fields");
  for (std::size_t a = 0; a * action_.size() < actions.size(); ++a) {
    ActionRecord& r = records_.emplace_back(task_);
    const auto own = actions.subspan(a * action_.size(), action_.size());
    std::copy(own.begin(), own.end(), r.chosen.begin());
    rollout.begin(r);
    tapes_.emplace_back(task_.model(), rollout.integrator(), task_.spec().steps_per_action);
    rollout.take_steps(&tapes_.back());
    rollout.conclude();
  }
}

double TaskTangent::along(const InputDirection& d) {
  start(d.q, d.v);
  double sum = 0;
  for (std::size_t a = 0; a < records_.size(); ++a)
    sum += take(d.u.empty() ? d.u : d.u.subspan(a * action_.size(), action_.size()), d.numbers);
  return sum;
}

void TaskTangent::start(std::span<const double> q, std::span<const double> v) {
  const std::size_t nv = as_size(task_.model().nv());
  state_ = {given(q, nv), given(v, nv), std::vector<double>(nv), std::vector<double>(nv)};
  std::fill(memory_.begin(), memory_.end(), 0.0);
  taken_ = 0;
}

double TaskTangent::take(std::span<const double> change, std::span<const double> numbers) {
  const std::size_t action = taken_++;
  action_ = given(change, action_.size());
  rollout_.recompute_snapshots(tapes_[action]);
  begin(action);
  seen_ = unseen(task_.spec().snapshots.size());
  take_steps(action, numbers);
  return reward(action);
}

ViewTangent TaskTangent::unseen(std::size_t moments) const {
  ViewTangent seen;
  seen.memory = memory_;
  seen.action = action_;
  for (auto* x : {&seen.q, &seen.v, &seen.end_effectors, &seen.tactile}) x->resize(moments);
  return seen;
}

TaskView TaskTangent::view() const {
  return rollout_.view(records_[taken_ - 1], std::int64_t(taken_), 0,
                       first_lane(records_[taken_ - 1].task_state), rollout_.snapshots(0));
}

ViewTangent TaskTangent::seen_at_start(std::span<const double> numbers) {
  std::fill(action_.begin(), action_.end(), 0.0);
  ViewTangent seen = unseen(1);
  read_snapshot(tapes_.front(), 0, 0, numbers, seen);
  return seen;
}

TaskView TaskTangent::start_view() {
  tapes_.front().show(0, rollout_.batch(), 0);
  rollout_.record_start();
  TaskView view = rollout_.start_view(0);
  view.actions = 0;
  view.task_state = first_lane(records_.front().found);
  view.snapshots = view.snapshots.last(1);
  return view;
}

/// Products of `rows` with the tangents of state, action and task state at the start of an action.
std::vector<double> TaskTangent::times(const std::vector<double>& rows,
                                       const StateTangent& start) const {
  std::vector<double> change;
  for (const auto* part : {&start.q, &start.v, &action_, &memory_})
    change.insert(change.end(), part->begin(), part->end());
  std::vector<double> products;
  for (std::size_t k = 0; k < rows.size(); k += change.size())
    products.push_back(product(std::span(rows).subspan(k, change.size()), change));
  return products;
}

/// The view at the start of an action.
TaskView TaskTangent::view_of_action(std::size_t action, const std::vector<double>& memory,
                                     const Snapshot& first) const {
  return rollout_.view(records_[action], std::int64_t(action), 0, first_lane(memory), {&first, 1});
}

/// Computes the task state during the action, and its initial state.
void TaskTangent::begin(std::size_t action) {
  const ActionRecord& r = records_[action];
  const Snapshot seen{first_lane(r.q), first_lane(r.v), {}, {}};
  memory_ = times(memory_rows(task_, view_of_action(action, r.found, seen)), state_);
  if (!task_.spec().restarts) return;
  const std::vector<double> placed =
      times(restart_rows(task_, view_of_action(action, r.task_state, seen)), state_);
  const auto middle = placed.begin() + std::ptrdiff_t(state_.q.size());
  const std::vector<double> zero(state_.q.size());
  state_ = {{placed.begin(), middle}, {middle, placed.end()}, zero, zero};
}

void TaskTangent::take_steps(std::size_t action, std::span<const double> numbers) {
  const ActionRecord& r = records_[action];
  const BlockTape& tape = tapes_[action];
  const TaskSpec& spec = task_.spec();
  const StateTangent start = state_;
  const std::size_t nu = as_size(task_.model().nu());
  std::vector<double> u_dot;
  std::size_t next = 0;
  for (int t = 0; t < spec.steps_per_action; ++t) {
    if (t % spec.control_every == 0) {
      rollout_.recompute_controls(r, std::int64_t(action), t, tape);
      const Snapshot first = rollout_.first_moment(tape, 0);
      u_dot = times(control_rows(task_, view_of_action(action, r.task_state, first), t), start);
    }
    tape.show(t, rollout_.batch(), 0);
    tangent_.step(rollout_.batch(), 0, 0, tape, t, rollout_.u().first(nu), u_dot, numbers, state_);
    if (spec.snapshots[next] == t + 1) read_snapshot(tape, t + 1, next++, numbers, seen_);
  }
}

void TaskTangent::read_snapshot(const BlockTape& tape, int step, std::size_t moment,
                                std::span<const double> numbers, ViewTangent& seen) {
  seen.q[moment] = state_.q;
  seen.v[moment] = state_.v;
  tape.show(step, rollout_.batch(), 0);
  seen.end_effectors[moment].resize(task_.end_effectors_size());
  if (task_.end_effectors_size() > 0)
    tangent_.end_effectors(rollout_.batch(), 0, 0, tape, step, numbers, state_,
                           seen.end_effectors[moment]);
  if (task_.tactile_size() == 0) return;
  for (const FieldOutput& output : task_.fields()) {
    const int s = output.sensor;
    std::vector<double> change(3 * as_size(task_.model().sensors()[as_size(s)].points));
    tangent_.field(rollout_.batch(), 0, 0, tape, step, s, numbers, {}, state_, change);
    seen.tactile[moment].insert(seen.tactile[moment].end(), change.begin(), change.end());
  }
}

double TaskTangent::reward(std::size_t action) const {
  OwnCotangent bar(task_, seen_.q.size());
  task_.reward_vjp(rollout_.view(records_[action], std::int64_t(action) + 1, 0,
                                 first_lane(records_[action].task_state), rollout_.snapshots(0)),
                   1, bar.out());
  double sum = product(bar.memory, seen_.memory) + product(bar.action, seen_.action);
  for (std::size_t m = 0; m < seen_.q.size(); ++m)
    sum += product(bar.q[m], seen_.q[m]) + product(bar.v[m], seen_.v[m]) +
           product(bar.end_effectors[m], seen_.end_effectors[m]) +
           product(bar.tactile[m], seen_.tactile[m]);
  return sum;
}

}  // namespace tangere
