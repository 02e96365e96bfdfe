// SPDX-License-Identifier: Apache-2.0
// The parts of an action that a VectorTask takes at once, one step of all blocks at a time.
#include "tasks/run/task_pilot.hpp"

#include <algorithm>
#include <numeric>

#include "tasks/run/block_worker.hpp"

namespace tangere {

struct TaskPilot::Impl {
  const Task& task;
  const Policy& policy;
  EnvironmentData data;
  std::vector<BlockWorker> workers;  // per block: what it saw last is in it
  std::vector<double> actions;
  VectorCounts counts;

  Impl(const Task& t, const Policy& p, Batch& batch, Precision precision)
      : task(t), policy(p), data(t, batch.environments()), actions(data.action.size()) {
    for (int b = 0; b < batch.blocks(); ++b) workers.emplace_back(t, precision);
    for (std::size_t e = 0; e < data.next_episode.size(); ++e)
      data.next_episode[e] = batch.episode(static_cast<int>(e));
    each_block([&](BlockWorker& worker, int b) { worker.begin(batch, data, b, {}); });
    if (t.spec().opening) return;
    each_block([&](BlockWorker& worker, int b) {
      worker.look_at_start(batch, b);
      worker.conclude(batch, data, b, counts);
    });
  }

  template <class Body>
  void each_block(const Body& body) {
    for (std::size_t b = 0; b < workers.size(); ++b) body(workers[b], static_cast<int>(b));
  }

  /// Steps of openings count as action -1.
  [[nodiscard]] std::int64_t action_of(std::int64_t step) const {
    return step / task.spec().steps_per_action - (task.spec().opening ? 1 : 0);
  }

  void choose(const Batch& batch) {
    const std::size_t width = task.spec().action.size(), seen = task.spec().observation_size();
    for (int e = 0; e < batch.environments(); ++e)
      policy.act(view_of(batch, data, e),
                 std::span(data.observation).subspan(static_cast<std::size_t>(e) * seen, seen),
                 std::span(actions).subspan(static_cast<std::size_t>(e) * width, width));
  }
};

TaskPilot::TaskPilot(const Task& task, const Policy& policy, Batch& batch, Precision precision)
    : impl_(std::make_unique<Impl>(task, policy, batch, precision)) {}
TaskPilot::~TaskPilot() = default;

void TaskPilot::drive(std::int64_t step, Batch& batch, std::span<double> u) {
  Impl& p = *impl_;
  const auto k = static_cast<int>(step % p.task.spec().steps_per_action);
  if (k == 0 && p.action_of(step) >= 0) {
    p.choose(batch);
    p.each_block([&](BlockWorker& worker, int b) { worker.begin(batch, p.data, b, p.actions); });
  }
  p.each_block([&](BlockWorker& worker, int b) { worker.ask_for_controls(batch, p.data, b, k); });
  std::copy(p.data.u.begin(), p.data.u.end(), u.begin());
}

void TaskPilot::done(std::int64_t step, Batch& batch, RowSink& sink) {
  Impl& p = *impl_;
  const auto k = static_cast<int>(step % p.task.spec().steps_per_action);
  p.each_block([&](BlockWorker& worker, int b) { worker.look_after(batch, b, k, p.counts); });
  if (k + 1 != p.task.spec().steps_per_action) return;
  p.each_block([&](BlockWorker& worker, int b) { worker.conclude(batch, p.data, b, p.counts); });
  if (const std::int64_t action = p.action_of(step); action >= 0)
    sink.write(ActionRow{action, step + 1, p.data.action, p.data.reward, p.data.terminated,
                         p.data.truncated, p.data.success});
}

std::int64_t TaskPilot::steps(const TaskSpec& spec) {
  return (spec.horizon + (spec.opening ? 1 : 0)) * static_cast<std::int64_t>(spec.steps_per_action);
}

std::int64_t TaskPilot::successes() const {
  return std::count(impl_->data.success.begin(), impl_->data.success.end(), std::uint8_t{1});
}

double TaskPilot::mean_return() const {
  const std::vector<double>& returns = impl_->data.returns;
  return std::accumulate(returns.begin(), returns.end(), 0.0) / static_cast<double>(returns.size());
}

}  // namespace tangere
