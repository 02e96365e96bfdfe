// SPDX-License-Identifier: Apache-2.0
// Takes differences sixteen episodes at a time: all step sizes of one entry are lanes of one block.
// Computes tangents of a return forward: the reverse function of a task gives one row of its
// derivative at a time, and the tangent is all rows times the change. Steps run in dual numbers.
#include "tasks/gradients/gradient_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "engine/base/as_size.hpp"
#include "engine/derivative/tangent.hpp"
#include "engine/sense/readout.hpp"

namespace tangere {
namespace {

constexpr double kMargin =
    2e-2;  // distance of actions from their bounds: more than differences move them

double dot(std::span<const double> a, std::span<const double> b) {
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

/// Lane 0 of an array of rows by lane.
std::span<const double> of_lane(const std::vector<double>& all) {
  return std::span(all).first(all.size() / kernels::kBlock);
}

class TaskTangent {
 public:
  /// Plays lane 0 of `rollout`, which has just started, with `actions`: (A, action), within their
  /// bounds.
  TaskTangent(TaskRollout& rollout, std::span<const double> actions, const StepperOptions& options);

  [[nodiscard]] double along(const InputDirection& direction);

 private:
  /// A change of what a task looks at.
  struct ViewTangent {
    std::vector<std::vector<double>> q, v, end_effectors, tactile;  // per moment
    std::vector<double> memory, action;
  };
  struct OwnCotangent;
  void begin(std::size_t action);
  void take_steps(std::size_t action, const InputDirection& d, ViewTangent& seen);
  void look(std::size_t action, std::size_t moment, const InputDirection& d, ViewTangent& seen);
  [[nodiscard]] double reward(std::size_t action, const ViewTangent& seen);

  TaskRollout& rollout_;
  const Task& task_;
  Tangent tangent_;
  Readout readout_;
  std::vector<ActionRecord> records_;
  std::vector<BlockTape> tapes_;
  StateTangent state_;
  std::vector<double> memory_,
      action_;  // changes of the memory after begin_action and of the current action
};

/// Room for the results of a task's reverse functions.
struct TaskTangent::OwnCotangent {
  std::vector<std::vector<double>> q, v, end_effectors, tactile;
  std::vector<double> memory, action;
  std::vector<MomentCotangent> moments;

  OwnCotangent(const Task& task, std::size_t count)
      : memory(as_size(task.spec().memory)), action(task.spec().action.size()) {
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
  /// Product with the changes of an action's start.
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
      memory_(as_size(task_.spec().memory)),
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
  const std::size_t nv = as_size(task_.model().nv()), moments = task_.spec().moments.size();
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

/// Computes the memory that the action keeps, and the state from which it starts.
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
  const std::size_t nu = as_size(task_.model().nu());
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
    std::vector<double> change(3 * as_size(sensors[s].points));
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

class ReturnChecker : public GradientChecker {
 public:
  ReturnChecker(const Task& task, const TaskMaker& make, const TaskActions& actions,
                const TaskCheckOptions& o)
      : GradientChecker(task.model(), o), task_(task), make_(make), task_options_(o) {
    TaskGradients gradient = task_gradients(task, within_bounds(actions), wanted());
    if (!gradient.failures.empty())
      throw InputError(fmt::format("action {} of episode {} of task {} finds no solution: {}",
                                   gradient.failures[0].step, o.episode, task.spec().name,
                                   to_string(gradient.failures[0].status)));
    out_.loss = gradient.value[0];
    length_ = gradient.length[0];
    const std::size_t numbers = as_size(length_) * task.spec().action.size();
    gradient.action.resize(numbers);
    gradient.by_action.resize(numbers);
    u_name_ = "actions";
    by_u_ = std::move(gradient.by_action);
    by_q_ = std::move(gradient.by_q);
    by_v_ = std::move(gradient.by_v);
    by_numbers_ = std::move(gradient.by_parameter);
    rollout_.emplace(task, o.stepper, Precision::f64);
    rollout_->start(o.seed, {&o.episode, 1});
    const Moment first = view_of(rollout_->batch(), rollout_->data(), 0).now();
    at_ = {{first.q.begin(), first.q.end()}, {first.v.begin(), first.v.end()}, gradient.action};
    for (std::size_t k = 0; k < model_.scene().randomizations.size(); ++k)
      varying_.push_back(rollout_->batch().randomized_value(0, static_cast<int>(k)));
    tangent_.emplace(*rollout_, at_.u, o.stepper);
  }

  [[nodiscard]] std::int64_t length() const { return length_; }

 private:
  TaskActions within_bounds(const TaskActions& actions) const {
    const double low = task_.spec().action.low + kMargin, high = task_.spec().action.high - kMargin;
    return [&actions, low, high](const TaskView& view, std::span<const double> observation,
                                 std::span<double> action) {
      actions(view, observation, action);
      for (double& a : action) a = std::clamp(a, low, high);
    };
  }
  [[nodiscard]] TaskGradientOptions wanted() const {
    TaskGradientOptions wanted;
    wanted.episodes = 1;
    wanted.first_episode = task_options_.episode;
    wanted.seed = options_.seed;
    wanted.actions = task_options_.actions;
    wanted.stepper = task_options_.stepper;
    wanted.precision = Precision::f64;
    wanted.parameters = true;
    return wanted;
  }

  [[nodiscard]] std::vector<double> values(const Scene* other,
                                           const std::vector<CheckInputs>& inputs,
                                           const std::vector<double>& varying) const override {
    const std::unique_ptr<Task> made = other != nullptr ? make_(*other) : nullptr;
    const Task& task = made ? *made : task_;
    TaskRollout rollout(task, task_options_.stepper, Precision::f64);
    rollout.start(options_.seed, std::vector<std::int64_t>(inputs.size(), task_options_.episode));
    for (int l = 0; l < rollout.lanes(); ++l) {
      for (std::size_t k = 0; k < varying.size(); ++k)
        if (rollout.batch().is_parameter(static_cast<int>(k)))
          rollout.batch().set_randomized_value(l, static_cast<int>(k), varying[k]);
      rollout.displace(l, inputs[as_size(l)].q, inputs[as_size(l)].v);
    }
    const std::size_t width = task.spec().action.size();
    ActionRecord record(task);
    for (std::int64_t a = 0; a < length_; ++a) {
      for (std::size_t l = 0; l < inputs.size(); ++l)
        std::copy_n(inputs[l].u.begin() + a * std::int64_t(width), width,
                    record.asked.begin() + std::ptrdiff_t(l * width));
      rollout.begin(record);
      rollout.take_steps(nullptr);
      rollout.conclude();
    }
    std::vector<double> sums = rollout.data().returns;
    for (int l = 0; l < rollout.lanes(); ++l)
      if (failed(rollout.batch().status(l))) sums[as_size(l)] = NAN;
    return sums;
  }

  [[nodiscard]] double along(const InputDirection& d) override { return tangent_->along(d); }
  [[nodiscard]] const Batch& batch() const override { return rollout_->batch(); }
  [[nodiscard]] std::string control_name(std::size_t i) const override {
    const TensorSpec& action = task_.spec().action;
    return fmt::format("action {} {}[{}]", i / action.size(), action.name, i % action.size());
  }

  const Task& task_;
  const TaskMaker& make_;
  const TaskCheckOptions& task_options_;
  std::int64_t length_ = 0;  // actions until the end
  std::optional<TaskRollout> rollout_;
  std::optional<TaskTangent> tangent_;
};

}  // namespace

TaskGradientCheck check_task_gradient(const Task& task, const TaskMaker& make,
                                      const TaskActions& actions, const TaskCheckOptions& options) {
  ReturnChecker checker(task, make, actions, options);
  checker.check();
  return {checker.result(), checker.length()};
}

}  // namespace tangere
