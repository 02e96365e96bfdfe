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

std::span<const double> lane_row(const std::vector<double>& all, int lane) {
  const std::size_t width = all.size() / kBlock;
  return std::span(all).subspan(as_size(lane) * width, width);
}

/// Rows of derivatives by (q, v, action, task state): calls reverse(weight, out) with a weight of 1
/// for each of `count` numbers in turn.
template <class Reverse>
std::vector<double> reversed_rows(const Task& task, std::size_t count, const Reverse& reverse) {
  const std::size_t nv = as_size(task.model().nv()), width = task.spec().action.size(),
                    columns = 2 * nv + width + as_size(task.spec().task_state);
  std::vector<double> rows(count * columns), weight(count);
  for (std::size_t k = 0; k < count; ++k) {
    const std::span<double> row = std::span(rows).subspan(k * columns, columns);
    const SnapshotCotangent moment{row.first(nv), row.subspan(nv, nv), {}, {}};
    weight[k] = 1;
    reverse(weight,
            ViewCotangent{{&moment, 1}, row.subspan(2 * nv, width), row.subspan(2 * nv + width)});
    weight[k] = 0;
  }
  return rows;
}

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

std::vector<double> control_rows(const Task& task, const TaskView& view, int step) {
  return reversed_rows(task, as_size(task.model().nu()), [&](const auto& weight, const auto& out) {
    task.controls_vjp(view, step, weight, out);
  });
}

std::vector<double> restart_rows(const Task& task, const TaskView& view) {
  const std::size_t nv = as_size(task.model().nv());
  return reversed_rows(task, 2 * nv, [&](std::span<const double> weight, const auto& out) {
    task.restart_state_vjp(view, weight.first(nv), weight.subspan(nv), out);
  });
}

std::vector<double> memory_rows(const Task& task, const TaskView& view) {
  return reversed_rows(task, as_size(task.spec().task_state),
                       [&](const auto& weight, const ViewCotangent& out) {
                         std::copy(weight.begin(), weight.end(), out.task_state.begin());
                         task.begin_action_vjp(view, out.task_state, {out.snapshots, out.action});
                       });
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
      for (int l = 0; l < rollout.lanes(); ++l) {
        std::ranges::fill(controls_[as_size(l)], 0.0);
        if (!r.taken[as_size(l)]) continue;
        const Snapshot first = rollout.first_moment(tape, l);
        controls_[as_size(l)] = control_rows(
            task_, rollout.view(r, action, l, lane_row(r.task_state, l), {&first, 1}), t);
      }
    }
    steps_.evaluate(rollout.batch(), 0, tape, t, rollout.u());
    for (int l = 0; l < rollout.lanes(); ++l) {
      steps_.get(l, step);
      chains_[as_size(l)].add(step, controls_[as_size(l)]);
    }
  }
  for (int l = 0; l < rollout.lanes(); ++l) compose(rollout, r, action, l);
}

/// Pulls derivatives by the first state, the action and the task state back to the state in which
/// the action was chosen.
void ActionJacobians::compose(TaskRollout& rollout, const ActionRecord& r, std::int64_t action,
                              int lane) {
  RowJacobian chain;
  chains_[as_size(lane)].get(chain);
  RowJacobian& out = rows_[as_size(lane)];
  out = {chain.state, chain.previous, std::vector<double>(state_ * width_)};
  std::vector<double> d_dmemory(state_ * memory_);
  const auto row = [](std::vector<double>& all, std::size_t i, std::size_t width) {
    return std::span(all).subspan(i * width, width);
  };
  for (std::size_t i = 0; i < state_; ++i) {
    const std::span<const double> others = row(chain.others, i, width_ + memory_);
    std::copy_n(others.begin(), width_, row(out.others, i, width_).begin());
    std::copy_n(others.begin() + static_cast<std::ptrdiff_t>(width_), memory_,
                row(d_dmemory, i, memory_).begin());
  }
  if (!r.taken[as_size(lane)]) return;
  const Snapshot seen{lane_row(r.q, lane), lane_row(r.v, lane), {}, {}};
  std::vector<double> rows;
  // Adds a number of each row, `by`, times row k of `rows`.
  const auto add_row = [&](std::size_t i, std::size_t k, double by) {
    const std::span<const double> from = std::span(rows).subspan(k * (state_ + width_ + memory_));
    add_times(row(out.state, i, state_), by, from);
    add_times(row(out.others, i, width_), by, from.subspan(state_));
    add_times(row(d_dmemory, i, memory_), by, from.subspan(state_ + width_));
  };
  if (task_.spec().restarts) {
    std::fill(out.state.begin(), out.state.end(), 0.0);
    std::fill(out.previous.begin(), out.previous.end(), 0.0);
    rows = restart_rows(task_,
                        rollout.view(r, action, lane, lane_row(r.task_state, lane), {&seen, 1}));
    for (std::size_t k = 0; k < state_; ++k)
      for (std::size_t i = 0; i < state_; ++i) add_row(i, k, chain.state[i * state_ + k]);
  }
  // The task state before the action counts as constant.
  const std::vector<double> kept = d_dmemory;
  rows = memory_rows(task_, rollout.view(r, action, lane, lane_row(r.found, lane), {&seen, 1}));
  for (std::size_t k = 0; k < memory_; ++k)
    for (std::size_t i = 0; i < state_; ++i) add_row(i, k, kept[i * memory_ + k]);
  const TensorSpec& spec = task_.spec().action;
  for (std::size_t k = 0; k < width_; ++k) {
    const double requested = lane_row(r.chosen, lane)[k];
    for (std::size_t i = 0; i < state_ && (requested < spec.low || requested > spec.high); ++i)
      out.others[i * width_ + k] = 0;
  }
}

}  // namespace tangere
