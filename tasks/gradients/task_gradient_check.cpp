// SPDX-License-Identifier: Apache-2.0
// Differences sixteen episodes at a time: all step sizes of one entry are lanes of one block.
#include "tasks/gradients/task_gradient_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/step/displacement.hpp"
#include "tasks/gradients/task_tangent.hpp"

namespace tangere {
namespace {

constexpr double kMargin =
    2e-2;  // actions stay so far within their bounds: more than differences move them

std::size_t size(std::int64_t n) { return static_cast<std::size_t>(n); }

/// The inputs of one episode.
struct Inputs {
  std::vector<double> q, v, actions;  ///< (nq), (nv) where the first action begins; (A, action)
};

class Check {
 public:
  Check(const Task& task, const TaskMaker& make, const TaskActions& actions,
        const TaskCheckOptions& o)
      : task_(task), make_(make), options_(o), parameters_(task.model()) {
    gradient_ = task_gradients(task, within_bounds(actions), wanted());
    if (!gradient_.lost.empty())
      throw InputError(fmt::format("action {} of episode {} of task {} finds no solution: {}",
                                   gradient_.lost[0].action, o.episode, task.spec().name,
                                   to_string(gradient_.lost[0].status)));
    out.loss = gradient_.value[0];
    out.actions = gradient_.length[0];
    gradient_.action.resize(size(out.actions) * task.spec().action.size());
    gradient_.by_action.resize(gradient_.action.size());
    rollout_.emplace(task, o.stepper, Precision::f64);
    rollout_->start(o.seed, {&o.episode, 1});
    const Moment first = view_of(rollout_->batch(), rollout_->data(), 0).now();
    at_ = {{first.q.begin(), first.q.end()}, {first.v.begin(), first.v.end()}, gradient_.action};
    for (std::size_t k = 0; k < task.model().scene().randomizations.size(); ++k)
      varying_.push_back(rollout_->batch().randomized_value(0, static_cast<int>(k)));
    tangent_.emplace(*rollout_, at_.actions, o.stepper);
  }

  void actions() {
    const std::size_t width = task_.spec().action.size();
    add({"actions", gradient_.by_action, all_of(gradient_.by_action.size()),
         [&](std::size_t i) {
           return difference(kControlScale, [i](Inputs& x, double e) { x.actions[i] += e; });
         },
         [&, width](std::size_t i) {
           return fmt::format("action {} {}[{}]", i / width, task_.spec().action.name, i % width);
         }},
        0, [](std::span<const double> d) {
          return EpisodeDirection{d, {}, {}, {}};
        });
  }
  void positions() {
    const auto move = [this](std::size_t i) {
      return
          [this, i](Inputs& x, double e) { displace(task_.model(), x.q, static_cast<int>(i), e); };
    };
    add({"q", gradient_.by_q, all_of(gradient_.by_q.size()),
         [&](std::size_t i) { return difference(1, move(i)); }, dof_name()},
        1, [](std::span<const double> d) {
          return EpisodeDirection{{}, d, {}, {}};
        });
  }
  void velocities() {
    add({"v", gradient_.by_v, all_of(gradient_.by_v.size()),
         [&](std::size_t i) {
           return difference(kVelocityScale, [i](Inputs& x, double e) { x.v[i] += e; });
         },
         dof_name()},
        2, [](std::span<const double> d) {
          return EpisodeDirection{{}, {}, d, {}};
        });
  }
  /// By relative changes of what this episode has: units differ.
  void numbers() {
    const RelativeGradient r(parameters_, task_.model().scene(), varying_, gradient_.by_parameter);
    std::vector<double> rows(size(parameter_rows(task_.model())));
    add({"numbers", r.gradient, r.given,
         [&](std::size_t k) { return difference_of_number(static_cast<int>(k)); },
         [&](std::size_t k) { return parameters_.infos()[k].name; }},
        3, [&](std::span<const double> d) {
          parameters_.spread(r.change(d), rollout_->batch(), 0, rows);
          return EpisodeDirection{{}, {}, {}, rows};
        });
  }

  TaskGradientCheck out;

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
    wanted.first_episode = options_.episode;
    wanted.seed = options_.seed;
    wanted.actions = options_.actions;
    wanted.stepper = options_.stepper;
    wanted.precision = Precision::f64;
    wanted.parameters = true;
    return wanted;
  }

  /// The return of each of `inputs`, lanes of one block; NaN where a step finds no solution.
  [[nodiscard]] std::vector<double> returns(const Task& task, const std::vector<Inputs>& inputs,
                                            const std::vector<double>& varying) const {
    TaskRollout rollout(task, options_.stepper, Precision::f64);
    rollout.start(options_.seed, std::vector<std::int64_t>(inputs.size(), options_.episode));
    for (int l = 0; l < rollout.lanes(); ++l) {
      for (std::size_t k = 0; k < varying.size(); ++k)
        if (rollout.batch().is_parameter(static_cast<int>(k)))
          rollout.batch().set_randomized_value(l, static_cast<int>(k), varying[k]);
      rollout.displace(l, inputs[size(l)].q, inputs[size(l)].v);
    }
    const std::size_t width = task.spec().action.size();
    ActionRecord record(task);
    for (std::int64_t a = 0; a < out.actions; ++a) {
      for (std::size_t l = 0; l < inputs.size(); ++l)
        std::copy_n(inputs[l].actions.begin() + a * std::int64_t(width), width,
                    record.asked.begin() + std::ptrdiff_t(l * width));
      rollout.begin(record);
      rollout.take_steps(nullptr);
      rollout.conclude();
    }
    std::vector<double> sums = rollout.data().returns;
    for (int l = 0; l < rollout.lanes(); ++l)
      if (failed(rollout.batch().status(l))) sums[size(l)] = NAN;
    return sums;
  }

  /// change(inputs, e): one entry of the inputs moved by e.
  [[nodiscard]] Difference difference(double scale,
                                      const std::function<void(Inputs&, double)>& change) const {
    std::vector<Inputs> all;
    for (const double e : sweep(scale)) {
      all.push_back(at_);
      change(all.back(), e);
    }
    return best_difference(returns(task_, all, varying_), scale);
  }

  /// Of number k of the scene, by its relative change.
  [[nodiscard]] Difference difference_of_number(int k) const {
    std::vector<double> values;
    for (const double e : sweep(1)) {
      Scene scene = task_.model().scene();
      std::vector<double> varying = varying_;
      const int random = parameters_.randomization(scene, k);
      (random < 0 ? parameters_.in(scene, k) : varying[size(random)]) *= 1 + e;
      values.push_back(returns(*make_(scene), {at_}, varying)[0]);
    }
    return best_difference(values, 1);
  }

  void add(const Comparison& c, std::uint32_t purpose,
           const std::function<EpisodeDirection(std::span<const double>)>& along) {
    out.inputs.push_back(compare(c, out.loss, options_, purpose));
    const std::vector<double> d = random_direction(c.gradient.size(), options_.seed, purpose);
    compare_along(out.inputs.back(), c.gradient, d, tangent_->along(along(d)));
  }
  [[nodiscard]] std::function<std::string(std::size_t)> dof_name() const {
    return [this](std::size_t i) { return std::string(task_.model().v_names()[i]); };
  }

  const Task& task_;
  const TaskMaker& make_;
  const TaskCheckOptions& options_;
  Parameters parameters_;
  TaskGradients gradient_;
  std::optional<TaskRollout> rollout_;
  std::optional<TaskTangent> tangent_;
  Inputs at_;
  std::vector<double> varying_;  // what the scene randomises, in its order
};

}  // namespace

TaskGradientCheck check_task_gradient(const Task& task, const TaskMaker& make,
                                      const TaskActions& actions, const TaskCheckOptions& options) {
  Check check(task, make, actions, options);
  check.actions();
  check.positions();
  check.velocities();
  check.numbers();
  return check.out;
}

}  // namespace tangere
