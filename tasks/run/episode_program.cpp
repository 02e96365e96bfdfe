// SPDX-License-Identifier: Apache-2.0
// A scene only supplies controls; a task takes the parts of an action one after the other.
#include "tasks/run/episode_program.hpp"

#include <algorithm>
#include <array>

#include "tasks/run/step_tally.hpp"

namespace tangere {

using kernels::kBlock;

VectorCounts EpisodeProgram::counts(const StepTally& tally) const {
  return {tally.counts.simulation_steps, tally.counts};
}

void write_controls(const ControlProgram& controls, std::int64_t step, const Batch& batch,
                    int block, std::span<double> u) {
  const auto nu = static_cast<std::size_t>(batch.model().nu());
  const int first = block * kBlock;
  for (int e = first; e < first + lanes_of(batch, block); ++e)
    controls.evaluate(step, batch.episode(e), u.subspan(static_cast<std::size_t>(e) * nu, nu));
}

void write_controls(const ControlProgram& controls, std::int64_t step, const Batch& batch,
                    std::span<double> u) {
  for (int b = 0; b < batch.blocks(); ++b) write_controls(controls, step, batch, b, u);
}

void SceneProgram::controls(std::int64_t step, Batch& batch, int block, std::span<double> u) {
  if (step % steps_per_row_ == 0) write_controls(controls_, first_step_ + step, batch, block, u);
}

TaskProgram::TaskProgram(const Task& task, const Policy& policy,
                         std::shared_ptr<EnvironmentData> data, Precision precision, int in_turn,
                         AtEnd at_end)
    : task_(task),
      policy_(policy),
      data_(std::move(data)),
      actions_(data_->action.size()),
      at_end_(at_end) {
  workers_.reserve(static_cast<std::size_t>(in_turn));
  for (int b = 0; b < in_turn; ++b) workers_.emplace_back(task, precision);
  if (!policy.is_batched()) return;
  seen_.resize(kBlock * task.spec().observation_size());
  chosen_.resize(kBlock * task.spec().action.size());
}

void TaskProgram::start(Batch& batch, int block) {
  worker(block).begin(batch, *data_, block, {});
  if (task_.spec().warm_up) return;
  worker(block).record_start(batch, block);
  worker(block).conclude(batch, *data_, block, counts_);
}

/// One call of the policy for all environments that have not ended, except those with the random
/// policy.
void TaskProgram::choose_together(const Batch& batch, int block) {
  const std::size_t width = task_.spec().action.size(), seen = task_.spec().observation_size();
  std::array<TaskView, kBlock> views;
  std::array<std::size_t, kBlock> requested{};
  std::size_t count = 0;
  const int first = block * kBlock;
  for (int e = first; e < first + lanes_of(batch, block); ++e) {
    const auto at = static_cast<std::size_t>(e);
    if (data_->state[at] != EnvironmentState::running) continue;
    const TaskView view = view_of(batch, *data_, e);
    const std::span observation = std::span(data_->observation).subspan(at * seen, seen);
    if (policy_.player(view.seed, view.episode) > 0) {
      policy_.act(view, observation, std::span(actions_).subspan(at * width, width));
      continue;
    }
    std::copy(observation.begin(), observation.end(),
              seen_.begin() + static_cast<std::ptrdiff_t>(count * seen));
    views[count] = view;
    requested[count++] = at;
  }
  if (count == 0) return;
  policy_.act(std::span(views).first(count), std::span(seen_).first(count * seen),
              std::span(chosen_).first(count * width));
  for (std::size_t i = 0; i < count; ++i)
    std::copy_n(chosen_.begin() + static_cast<std::ptrdiff_t>(i * width), width,
                actions_.begin() + static_cast<std::ptrdiff_t>(requested[i] * width));
}

void TaskProgram::choose(const Batch& batch, int block) {
  if (policy_.is_batched()) return choose_together(batch, block);
  const std::size_t width = task_.spec().action.size(), seen = task_.spec().observation_size();
  const auto first = static_cast<std::size_t>(block) * kBlock,
             last = first + static_cast<std::size_t>(lanes_of(batch, block));
  for (std::size_t e = first; e < last; ++e)
    policy_.act(view_of(batch, *data_, static_cast<int>(e)),
                std::span(data_->observation).subspan(e * seen, seen),
                std::span(actions_).subspan(e * width, width));
}

void TaskProgram::controls(std::int64_t step, Batch& batch, int block, std::span<double> u) {
  const auto k = static_cast<int>(step % steps_per_row());
  if (k == 0 && step >= opening_steps()) {
    choose(batch, block);
    worker(block).begin(batch, *data_, block, actions_);
  }
  worker(block).compute_controls(batch, *data_, block, k);
  const auto nu = static_cast<std::size_t>(batch.model().nu());
  const std::size_t first = static_cast<std::size_t>(block) * kBlock * nu,
                    count = static_cast<std::size_t>(lanes_of(batch, block)) * nu;
  std::copy_n(data_->u.begin() + static_cast<std::ptrdiff_t>(first), count,
              u.begin() + static_cast<std::ptrdiff_t>(first));
}

void TaskProgram::after_step(std::int64_t step, const Batch& batch, int block) {
  worker(block).record_snapshot(batch, block, static_cast<int>(step % steps_per_row()), counts_);
}

void TaskProgram::after_row(Batch& batch, int block) {
  worker(block).conclude(batch, *data_, block, counts_);
  if (at_end_ == AtEnd::again) data_->start_next(block * kBlock, lanes_of(batch, block));
}

std::int64_t TaskProgram::steps(const TaskSpec& spec) {
  return (spec.horizon + (spec.warm_up ? 1 : 0)) * static_cast<std::int64_t>(spec.steps_per_action);
}

}  // namespace tangere
