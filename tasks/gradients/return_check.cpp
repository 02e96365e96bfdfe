// SPDX-License-Identifier: Apache-2.0
// Takes differences sixteen episodes at a time: all step sizes of one entry are lanes of one block.
// Tangents come from task_tangent.hpp.
#include "tasks/gradients/gradient_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "engine/base/as_size.hpp"
#include "tasks/gradients/gradient_compare.hpp"
#include "tasks/gradients/run_trace.hpp"
#include "tasks/gradients/task_tangent.hpp"

namespace tangere {
namespace {

constexpr double kMargin =
    2e-2;  // distance of actions from their bounds: more than differences move them

class ReturnChecker : public GradientChecker {
 public:
  ReturnChecker(const Task& task, const TaskMaker& make, const TaskActions& actions,
                const CheckOptions& o)
      : GradientChecker(task.model(), o), task_(task), make_(make) {
    TaskGradients gradient = task_gradients(task, within_bounds(actions), o.seed,
                                            {o.episode, o.episode + 1}, requested());
    if (!gradient.failures.empty())
      throw InputError(fmt::format("action {} of episode {} of task {} finds no solution: {}",
                                   gradient.failures[0].step, o.episode, task.spec().name,
                                   to_string(gradient.failures[0].status)));
    out_.loss = gradient.value[0];
    out_.length = gradient.length[0];
    const std::size_t numbers = as_size(out_.length) * task.spec().action.size();
    gradient.action.resize(numbers);
    gradient.u.resize(numbers);
    u_name_ = "actions";
    grad_u_ = std::move(gradient.u);
    grad_q_ = std::move(gradient.q);
    grad_v_ = std::move(gradient.v);
    grad_numbers_ = std::move(gradient.parameters);
    rollout_.emplace(task, o.stepper, Precision::f64);
    rollout_->start(o.seed, {&o.episode, 1});
    const Snapshot first = view_of(rollout_->batch(), rollout_->data(), 0).now();
    at_ = {{first.q.begin(), first.q.end()}, {first.v.begin(), first.v.end()}, gradient.action};
    for (std::size_t k = 0; k < model_.scene().randomizations.size(); ++k)
      varying_.push_back(rollout_->batch().randomized_value(0, static_cast<int>(k)));
    tangent_.emplace(*rollout_, at_.u, o.stepper);
  }

 private:
  TaskActions within_bounds(const TaskActions& actions) const {
    const double low = task_.spec().action.low + kMargin, high = task_.spec().action.high - kMargin;
    return [&actions, low, high](const TaskView& view, std::span<const double> observation,
                                 std::span<double> action) {
      actions(view, observation, action);
      for (double& a : action) a = std::clamp(a, low, high);
    };
  }
  [[nodiscard]] TapeOptions requested() const {
    TapeOptions requested;
    requested.length = options_.length;
    requested.stepper = options_.stepper;
    requested.parameters = true;
    return requested;
  }

  [[nodiscard]] std::vector<double> values(const Scene* other,
                                           const std::vector<CheckInputs>& inputs,
                                           const std::vector<double>& varying,
                                           RunTrace* trace) const override {
    const std::unique_ptr<Task> made = other != nullptr ? make_(*other) : nullptr;
    const Task& task = made ? *made : task_;
    TaskRollout rollout(task, options_.stepper, Precision::f64);
    rollout.start(options_.seed, std::vector<std::int64_t>(inputs.size(), options_.episode));
    for (int l = 0; l < rollout.lanes(); ++l) {
      for (std::size_t k = 0; k < varying.size(); ++k)
        if (rollout.batch().is_parameter(static_cast<int>(k)))
          rollout.batch().set_randomized_value(l, static_cast<int>(k), varying[k]);
      rollout.displace(l, inputs[as_size(l)].q, inputs[as_size(l)].v);
    }
    const std::size_t width = task.spec().action.size();
    ActionRecord record(task);
    for (std::int64_t a = 0; a < out_.length; ++a) {
      for (std::size_t l = 0; l < inputs.size(); ++l)
        std::copy_n(inputs[l].u.begin() + a * std::int64_t(width), width,
                    record.chosen.begin() + std::ptrdiff_t(l * width));
      rollout.begin(record);
      rollout.take_steps(nullptr);
      rollout.conclude();
      if (trace != nullptr) trace->add(rollout.batch());
    }
    std::vector<double> sums = rollout.data().returns;
    for (int l = 0; l < rollout.lanes(); ++l)
      if (failed(rollout.batch().status(l))) sums[as_size(l)] = NAN;
    return sums;
  }

  [[nodiscard]] double along(const InputDirection& d) override { return tangent_->along(d); }
  [[nodiscard]] bool reads_fields() const override { return true; }
  [[nodiscard]] const Batch& batch() const override { return rollout_->batch(); }
  [[nodiscard]] std::string control_name(std::size_t i) const override {
    const TensorSpec& action = task_.spec().action;
    return fmt::format("action {} {}[{}]", i / action.size(), action.name, i % action.size());
  }

  const Task& task_;
  const TaskMaker& make_;
  std::optional<TaskRollout> rollout_;
  std::optional<TaskTangent> tangent_;
};

}  // namespace

GradientCheck check_task_gradient(const Task& task, const TaskMaker& make,
                                  const TaskActions& actions, const CheckOptions& options) {
  ReturnChecker checker(task, make, actions, options);
  checker.check();
  checker.explain();
  return checker.result();
}

}  // namespace tangere
