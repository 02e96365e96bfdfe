// SPDX-License-Identifier: Apache-2.0
// J⁺ = S J + P J⁻ + U D. S, P, U: derivatives of the step by the state before it, by the state
// before that, and by its controls. D: derivatives of the controls.
#include "tasks/gradients/row_jacobians.hpp"

#include <algorithm>

#include "engine/base/as_size.hpp"

namespace tangere {

using kernels::kBlock;

namespace {

/// to (rows, columns) += a (rows, inner) times b (inner, columns).
void add_product(std::span<double> to, std::span<const double> a, std::span<const double> b,
                 std::size_t inner, std::size_t columns) {
  const std::size_t rows = to.size() / columns;
  for (std::size_t i = 0; i < rows; ++i)
    for (std::size_t k = 0; k < inner; ++k) {
      const double x = a[i * inner + k];
      if (x == 0) continue;
      for (std::size_t j = 0; j < columns; ++j) to[i * columns + j] += x * b[k * columns + j];
    }
}

std::span<const double> of_lane(const std::vector<double>& all, int lane) {
  const std::size_t width = all.size() / kBlock;
  return std::span(all).subspan(as_size(lane) * width, width);
}

/// Results of a task's reverse functions for one number.
struct Bars {
  std::vector<double> state, action, memory;  // (2 nv), …
  SnapshotCotangent moment;

  Bars(std::size_t two_nv, std::size_t width, std::size_t memories)
      : state(two_nv), action(width), memory(memories) {
    moment = {std::span(state).first(two_nv / 2), std::span(state).subspan(two_nv / 2), {}, {}};
  }
  Bars(const Bars&) = delete;
  [[nodiscard]] ViewCotangent out() { return {{&moment, 1}, action, memory}; }
};

/// to += x times from.
void add_times(std::span<double> to, double x, std::span<const double> from) {
  for (std::size_t i = 0; i < to.size(); ++i) to[i] += x * from[i];
}

}  // namespace

RowChain::RowChain(int nv, std::size_t others)
    : state_(2 * as_size(nv)), others_(others), columns_(2 * state_ + others) {
  for (auto* x : {&now_, &before_, &next_}) x->resize(state_ * columns_);
}

void RowChain::begin() {
  for (auto* x : {&now_, &before_}) std::fill(x->begin(), x->end(), 0.0);
  for (std::size_t i = 0; i < state_; ++i) {
    now_[i * columns_ + i] = 1;
    before_[i * columns_ + state_ + i] = 1;
  }
}

void RowChain::add(const StepJacobian& step, std::span<const double> controls) {
  std::fill(next_.begin(), next_.end(), 0.0);
  add_product(next_, step.state, now_, state_, columns_);
  add_product(next_, step.previous, before_, state_, columns_);
  const std::size_t nu = step.u.size() / state_, given = state_ + others_;
  for (std::size_t i = 0; i < state_; ++i)
    for (std::size_t k = 0; k < nu; ++k) {
      const std::span<const double> row = controls.subspan(k * given, given);
      add_times(std::span(next_).subspan(i * columns_, state_), step.u[i * nu + k], row);
      add_times(std::span(next_).subspan(i * columns_ + 2 * state_, others_), step.u[i * nu + k],
                row.subspan(state_));
    }
  std::swap(before_, now_);
  std::swap(now_, next_);
}

void RowChain::get(RowJacobian& out) const {
  out.state.clear();
  out.previous.clear();
  out.others.clear();
  for (std::size_t i = 0; i < state_; ++i) {
    const auto row = now_.begin() + static_cast<std::ptrdiff_t>(i * columns_),
               one = row + static_cast<std::ptrdiff_t>(state_);
    const auto two = one + static_cast<std::ptrdiff_t>(state_);
    out.state.insert(out.state.end(), row, one);
    out.previous.insert(out.previous.end(), one, two);
    out.others.insert(out.others.end(), two, two + static_cast<std::ptrdiff_t>(others_));
  }
}

ActionJacobians::ActionJacobians(const Task& task, const StepperOptions& options)
    : task_(task),
      steps_(task.model(), options),
      state_(2 * as_size(task.model().nv())),
      width_(task.spec().action.size()),
      memory_(as_size(task.spec().task_state)),
      chains_(kBlock, RowChain(task.model().nv(), width_ + memory_)),
      controls_(kBlock,
                std::vector<double>(as_size(task.model().nu()) * (state_ + width_ + memory_))),
      rows_(kBlock) {}

void ActionJacobians::evaluate(TaskRollout& rollout, const ActionRecord& r, std::int64_t action,
                               const BlockTape& tape) {
  const TaskSpec& spec = task_.spec();
  for (RowChain& chain : chains_) chain.begin();
  StepJacobian step;
  for (int t = 0; t < spec.steps_per_action; ++t) {
    if (t % spec.control_every == 0) {
      rollout.recompute_controls(r, action, t, tape);
      for (int l = 0; l < rollout.lanes(); ++l) ask(rollout, r, action, t, tape, l);
    }
    steps_.evaluate(rollout.batch(), 0, tape, t, rollout.u());
    for (int l = 0; l < rollout.lanes(); ++l) {
      steps_.get(l, step);
      chains_[as_size(l)].add(step, controls_[as_size(l)]);
    }
  }
  for (int l = 0; l < rollout.lanes(); ++l) compose(rollout, r, action, l);
}

/// Computes the derivatives of a lane's controls from `step` on by the action's first state, the
/// action and the memory.
void ActionJacobians::ask(TaskRollout& rollout, const ActionRecord& r, std::int64_t action,
                          int step, const BlockTape& tape, int lane) {
  std::vector<double>& d = controls_[as_size(lane)];
  std::fill(d.begin(), d.end(), 0.0);
  if (!r.taken[as_size(lane)]) return;
  const std::size_t nu = as_size(task_.model().nu()), given = state_ + width_ + memory_;
  for (std::size_t k = 0; k < nu; ++k) {
    Bars bars(state_, width_, memory_);
    std::vector<double> weight(nu);
    weight[k] = 1;
    const Snapshot first = rollout.first_moment(tape, lane);
    task_.controls_vjp(rollout.view(r, action, lane, of_lane(r.task_state, lane), {&first, 1}),
                       step, weight, bars.out());
    auto to = d.begin() + static_cast<std::ptrdiff_t>(k * given);
    for (const auto* part : {&bars.state, &bars.action, &bars.memory})
      to = std::copy(part->begin(), part->end(), to);
  }
}

/// Turns derivatives by the first state, the action and the memory into derivatives at the point
/// where the action was chosen.
void ActionJacobians::compose(TaskRollout& rollout, const ActionRecord& r, std::int64_t action,
                              int lane) {
  RowJacobian chain;
  chains_[as_size(lane)].get(chain);
  RowJacobian& out = rows_[as_size(lane)];
  out = {chain.state, chain.previous, std::vector<double>(state_ * width_)};
  std::vector<double> by_memory(state_ * memory_);
  const auto row = [](std::vector<double>& all, std::size_t i, std::size_t width) {
    return std::span(all).subspan(i * width, width);
  };
  for (std::size_t i = 0; i < state_; ++i) {
    const std::span<const double> others = row(chain.others, i, width_ + memory_);
    std::copy_n(others.begin(), width_, row(out.others, i, width_).begin());
    std::copy_n(others.begin() + static_cast<std::ptrdiff_t>(width_), memory_,
                row(by_memory, i, memory_).begin());
  }
  if (!r.taken[as_size(lane)]) return;
  const Snapshot seen{of_lane(r.q, lane), of_lane(r.v, lane), {}, {}};
  if (task_.spec().restarts) {
    std::fill(out.state.begin(), out.state.end(), 0.0);
    std::fill(out.previous.begin(), out.previous.end(), 0.0);
    for (std::size_t k = 0; k < state_; ++k) {
      Bars bars(state_, width_, memory_);
      std::vector<double> weight(state_);
      weight[k] = 1;
      task_.restart_state_vjp(
          rollout.view(r, action, lane, of_lane(r.task_state, lane), {&seen, 1}),
          std::span(weight).first(state_ / 2), std::span(weight).subspan(state_ / 2), bars.out());
      for (std::size_t i = 0; i < state_; ++i) {
        const double by_placed = chain.state[i * state_ + k];
        add_times(row(out.state, i, state_), by_placed, bars.state);
        add_times(row(out.others, i, width_), by_placed, bars.action);
        add_times(row(by_memory, i, memory_), by_placed, bars.memory);
      }
    }
  }
  for (std::size_t k = 0; k < memory_; ++k) {
    Bars bars(state_, width_, memory_);
    bars.memory[k] = 1;
    task_.begin_action_vjp(rollout.view(r, action, lane, of_lane(r.found, lane), {&seen, 1}),
                           bars.memory, {{&bars.moment, 1}, bars.action});
    for (std::size_t i = 0; i < state_; ++i) {
      add_times(row(out.state, i, state_), by_memory[i * memory_ + k], bars.state);
      add_times(row(out.others, i, width_), by_memory[i * memory_ + k], bars.action);
    }
  }
  const TensorSpec& spec = task_.spec().action;
  for (std::size_t k = 0; k < width_; ++k) {
    const double asked = of_lane(r.chosen, lane)[k];
    for (std::size_t i = 0; i < state_ && (asked < spec.low || asked > spec.high); ++i)
      out.others[i * width_ + k] = 0;
  }
}

}  // namespace tangere
