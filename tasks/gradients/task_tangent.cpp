// SPDX-License-Identifier: Apache-2.0
// A row of a task's derivative is what its reverse gives for one number; a tangent is all rows
// times the change.
#include "tasks/gradients/task_tangent.hpp"

#include <algorithm>
#include <numeric>

namespace tangere {
namespace {

std::size_t size(std::int64_t n) { return static_cast<std::size_t>(n); }

double dot(std::span<const double> a, std::span<const double> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

/// Lane 0 of rows by lane.
std::span<const double> of_lane(const std::vector<double>& all) {
  return std::span(all).first(all.size() / kernels::kBlock);
}

}  // namespace

/// Room for what a task's reverse functions add to.
struct TaskTangent::OwnCotangent {
  std::vector<std::vector<double>> q, v, end_effectors, tactile;
  std::vector<double> memory, action;
  std::vector<MomentCotangent> moments;

  OwnCotangent(const Task& task, std::size_t count)
      : memory(size(task.spec().memory)), action(task.spec().action.size()) {
    const std::vector<double> dofs(size(task.model().nv()));
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
  /// Times the changes of an action's start.
  [[nodiscard]] double start_dot(const StateTangent& x, const std::vector<double>& dm,
                                 const std::vector<double>& da) const {
    return dot(q[0], x.q) + dot(v[0], x.v) + dot(memory, dm) + dot(action, da);
  }
};

TaskTangent::TaskTangent(TaskRollout& rollout, std::span<const double> actions,
                         const StepperOptions& options)
    : rollout_(rollout),
      task_(rollout.task()),
      tangent_(task_.model(), options),
      readout_(task_.model()),
      memory_(size(task_.spec().memory)),
      action_(task_.spec().action.size()) {
  for (std::size_t a = 0; a * action_.size() < actions.size(); ++a) {
    ActionRecord& r = records_.emplace_back(task_);
    const auto own = actions.subspan(a * action_.size(), action_.size());
    std::copy(own.begin(), own.end(), r.asked.begin());
    rollout.begin(r);
    tapes_.emplace_back(task_.model(), rollout.integrator(), task_.spec().steps_per_action);
    rollout.take_steps(&tapes_.back());
    rollout.conclude();
  }
}

double TaskTangent::along(const InputDirection& d) {
  const auto given = [](std::span<const double> x, std::size_t n) {
    return x.empty() ? std::vector<double>(n) : std::vector<double>(x.begin(), x.end());
  };
  const std::size_t nv = size(task_.model().nv()), moments = task_.spec().moments.size();
  state_ = {given(d.q, nv), given(d.v, nv), std::vector<double>(nv), std::vector<double>(nv)};
  std::fill(memory_.begin(), memory_.end(), 0.0);
  double sum = 0;
  for (std::size_t a = 0; a < records_.size(); ++a) {
    action_ =
        given(d.u.empty() ? d.u : d.u.subspan(a * action_.size(), action_.size()), action_.size());
    rollout_.look_again(tapes_[a]);
    begin(a);
    ViewTangent seen;
    seen.memory = memory_;
    seen.action = action_;
    for (auto* x : {&seen.q, &seen.v, &seen.end_effectors, &seen.tactile}) x->resize(moments);
    take_steps(a, d, seen);
    sum += reward(a, seen);
  }
  return sum;
}

/// What the action keeps, and the state that it starts from.
void TaskTangent::begin(std::size_t action) {
  const ActionRecord& r = records_[action];
  const Moment seen{of_lane(r.q), of_lane(r.v), {}, {}};
  std::vector<double> memory(memory_.size());
  for (std::size_t k = 0; k < memory.size(); ++k) {
    OwnCotangent bar(task_, 1);
    bar.memory[k] = 1;
    task_.begin_action_vjp(rollout_.view(r, std::int64_t(action), 0, of_lane(r.found), {&seen, 1}),
                           bar.memory, {bar.moments, bar.action});
    memory[k] = bar.start_dot(state_, memory_, action_);
  }
  memory_ = memory;
  if (!task_.spec().restarts) return;
  const std::size_t nv = state_.q.size();
  StateTangent placed{std::vector<double>(nv), std::vector<double>(nv), std::vector<double>(nv),
                      std::vector<double>(nv)};
  for (std::size_t i = 0; i < 2 * nv; ++i) {
    OwnCotangent bar(task_, 1);
    std::vector<double> q(nv), v(nv);
    (i < nv ? q[i] : v[i - nv]) = 1;
    task_.place_vjp(rollout_.view(r, std::int64_t(action), 0, of_lane(r.memory), {&seen, 1}), q, v,
                    bar.out());
    (i < nv ? placed.q[i] : placed.v[i - nv]) = bar.start_dot(state_, memory_, action_);
  }
  state_ = placed;
}

void TaskTangent::take_steps(std::size_t action, const InputDirection& d, ViewTangent& seen) {
  const ActionRecord& r = records_[action];
  const BlockTape& tape = tapes_[action];
  const TaskSpec& spec = task_.spec();
  const StateTangent start = state_;
  const std::size_t nu = size(task_.model().nu());
  std::vector<double> u_dot(nu);
  std::size_t next = 0;
  for (int t = 0; t < spec.steps_per_action; ++t) {
    if (t % spec.control_every == 0) {
      rollout_.ask_again(r, std::int64_t(action), t, tape);
      for (std::size_t k = 0; k < nu; ++k) {
        OwnCotangent bar(task_, 1);
        std::vector<double> weight(nu);
        weight[k] = 1;
        const Moment first = rollout_.first_moment(tape, 0);
        task_.controls_vjp(
            rollout_.view(r, std::int64_t(action), 0, of_lane(r.memory), {&first, 1}), t, weight,
            bar.out());
        u_dot[k] = bar.start_dot(start, memory_, action_);
      }
    }
    tape.show(t, rollout_.batch(), 0);
    tangent_.step(rollout_.batch(), 0, 0, tape, t, rollout_.u().first(nu), u_dot, d.numbers,
                  state_);
    if (spec.moments[next] == t + 1) look(action, next++, d, seen);
  }
}

void TaskTangent::look(std::size_t action, std::size_t moment, const InputDirection& d,
                       ViewTangent& seen) {
  const BlockTape& tape = tapes_[action];
  const int step = task_.spec().moments[moment];
  seen.q[moment] = state_.q;
  seen.v[moment] = state_.v;
  tape.show(step, rollout_.batch(), 0);
  const std::size_t nv = state_.q.size();
  if (task_.end_effectors_size() > 0) {
    std::vector<double> jacobian(task_.end_effectors_size() * nv);
    readout_.end_effector_jacobian(rollout_.batch(), 0, jacobian);
    for (std::size_t i = 0; i < task_.end_effectors_size(); ++i)
      seen.end_effectors[moment].push_back(dot(std::span(jacobian).subspan(i * nv, nv), state_.q));
  }
  if (task_.tactile_size() == 0) return;
  const auto sensors = task_.model().sensors();
  for (std::size_t s = 0; s < sensors.size(); ++s) {
    std::vector<double> change(3 * size(sensors[s].points));
    tangent_.field(rollout_.batch(), 0, 0, tape, step, static_cast<int>(s), d.numbers, {}, state_,
                   change);
    seen.tactile[moment].insert(seen.tactile[moment].end(), change.begin(), change.end());
  }
}

double TaskTangent::reward(std::size_t action, const ViewTangent& seen) {
  const ActionRecord& r = records_[action];
  OwnCotangent bar(task_, seen.q.size());
  task_.reward_vjp(
      rollout_.view(r, std::int64_t(action) + 1, 0, of_lane(r.memory), rollout_.moments(0)), 1,
      bar.out());
  double sum = dot(bar.memory, seen.memory) + dot(bar.action, seen.action);
  for (std::size_t m = 0; m < seen.q.size(); ++m)
    sum += dot(bar.q[m], seen.q[m]) + dot(bar.v[m], seen.v[m]) +
           dot(bar.end_effectors[m], seen.end_effectors[m]) + dot(bar.tactile[m], seen.tactile[m]);
  return sum;
}

}  // namespace tangere
