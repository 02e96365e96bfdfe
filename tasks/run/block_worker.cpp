// SPDX-License-Identifier: Apache-2.0
// Advances a block by one action: starts episodes or takes actions, then K steps with snapshots,
// then rewards and observations.
#include "tasks/run/block_worker.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/as_size.hpp"
#include "kernels/numbers/block.hpp"
#include "tasks/run/block_reader.hpp"
#include "tasks/run/number_row.hpp"

namespace tangere {

using kernels::kBlock;

EnvironmentData::EnvironmentData(const Task& task, int environments) {
  const TaskSpec& spec = task.spec();
  const Model& model = task.model();
  const std::size_t e = as_size(environments);
  task_state.resize(e * as_size(spec.task_state));
  action.resize(e * spec.action.size());
  observation.resize(e * spec.observation_size());
  u.resize(e * as_size(model.nu()));
  q.resize(e * as_size(model.nq()));
  v.resize(e * as_size(model.nv()));
  for (std::vector<double>* numbers : {&reward, &returns}) numbers->resize(e);
  for (std::vector<std::uint8_t>* flags : {&terminated, &truncated, &success, &starting})
    flags->resize(e);
  length.resize(e);
  episodes.resize(e);
  next_episode.resize(e);
  state.assign(e, EnvironmentState::to_start);
  for (int i = 0; i < environments; ++i)
    now.push_back(
        {number_row(q, i, as_size(model.nq())), number_row(v, i, as_size(model.nv())), {}, {}});
}

double EnvironmentData::bytes(const Task& task) {
  const TaskSpec& spec = task.spec();
  const Model& model = task.model();
  const std::size_t numbers = as_size(spec.task_state) + spec.action.size() +
                              spec.observation_size() + as_size(model.nu()) + as_size(model.nq()) +
                              as_size(model.nv()) + 5;
  return static_cast<double>(numbers * sizeof(double) + 5 + sizeof(Snapshot));
}

void EnvironmentData::restart(const Batch& batch) {
  for (std::size_t e = 0; e < state.size(); ++e)
    next_episode[e] = batch.episode(static_cast<int>(e));
  std::fill(state.begin(), state.end(), EnvironmentState::to_start);
}

void EnvironmentData::start_next(int first, int environments) {
  for (std::size_t e = as_size(first); e < as_size(first + environments); ++e) {
    if (state[e] != EnvironmentState::over) continue;
    state[e] = EnvironmentState::to_start;
    next_episode[e] = episodes[e] + std::ssize(state);
  }
}

TaskView view_of(const Batch& batch, const EnvironmentData& data, int environment) {
  const std::size_t e = as_size(environment), environments = data.reward.size();
  const std::size_t memory = data.task_state.size() / environments,
                    action = data.action.size() / environments;
  return {batch.seed(),
          data.episodes[e],
          data.length[e],
          number_row(data.task_state, environment, memory),
          number_row(data.action, environment, action),
          {&data.now[e], 1}};
}

BlockWorker::BlockWorker(const Task& task, Precision precision)
    : task_(task),
      readout_(task.model(), precision),
      varying_(task.model().scene().randomizations.size()) {
  const TaskSpec& spec = task.spec();
  const std::size_t moments = spec.snapshots.size();
  q_.resize(moments * kBlock * as_size(task.model().nq()));
  v_.resize(moments * kBlock * as_size(task.model().nv()));
  end_effectors_.resize(moments * kBlock * task.end_effectors_size());
  tactile_.resize(moments * kBlock * task.tactile_size());
  bodies_.resize(moments * kBlock * task.bodies_size());
  shear_.resize(moments * kBlock * task.shear_state_size());
  if (!shear_.empty()) shear_arrays_ = shear_state_arrays(task.model());
  for (int lane = 0; lane < kBlock; ++lane)
    for (std::size_t m = 0; m < moments; ++m)
      moments_.push_back({part(q_, m, lane), part(v_, m, lane), part(end_effectors_, m, lane),
                          part(tactile_, m, lane), part(bodies_, m, lane), part(shear_, m, lane)});
  if (spec.settling_steps == 0) return;
  StepperOptions options;
  options.timestep = spec.settling_timestep;
  settling_stepper_.emplace(task.model(), options);
}

double BlockWorker::bytes(const Task& task) {
  const std::size_t numbers = as_size(task.model().nq()) + as_size(task.model().nv()) +
                              task.end_effectors_size() + task.tactile_size() + task.bodies_size() +
                              task.shear_state_size();
  return static_cast<double>(task.spec().snapshots.size() * kBlock * numbers * sizeof(double));
}

std::span<double> BlockWorker::part(std::vector<double>& snapshots, std::size_t moment,
                                    int lane) const {
  const std::size_t width = snapshots.size() / (task_.spec().snapshots.size() * kBlock);
  return std::span(snapshots).subspan((moment * kBlock + as_size(lane)) * width, width);
}

void BlockWorker::begin(Batch& batch, EnvironmentData& data, int block,
                        std::span<const double> actions) {
  const int first = block * kBlock, last = std::min(first + kBlock, batch.environments());
  for (int e = first; e < last; ++e) {
    data.starting[as_size(e)] = data.state[as_size(e)] == EnvironmentState::to_start ? 1 : 0;
    if (data.starting[as_size(e)] != 0) {
      start(batch, data, e);
    } else if (data.state[as_size(e)] == EnvironmentState::running) {
      take_action(batch, data, e, actions);
    }
  }
}

void BlockWorker::compute_controls(const Batch& batch, EnvironmentData& data, int block,
                                   int step) const {
  if (step % task_.spec().control_every != 0) return;
  const int first = block * kBlock, last = std::min(first + kBlock, batch.environments());
  for (int e = first; e < last; ++e)
    if (!batch.held(e))
      task_.controls(view_of(batch, data, e), step,
                     number_row(data.u, e, as_size(task_.model().nu())));
}

void BlockWorker::record_snapshot(const Batch& batch, int block, int step, VectorCounts& counts) {
  const int first = block * kBlock, last = std::min(first + kBlock, batch.environments());
  for (int e = first; e < last; ++e)
    if (!batch.held(e) && !failed(batch.status(e))) counts.steps.count(batch, e);
  const std::vector<int>& moments = task_.spec().snapshots;
  const auto moment = std::lower_bound(moments.begin(), moments.end(), step + 1);
  if (*moment == step + 1)
    read_snapshot(batch, block, as_size(static_cast<int>(moment - moments.begin())));
}

void BlockWorker::record_start(const Batch& batch, int block) {
  read_snapshot(batch, block, task_.spec().snapshots.size() - 1);
}

void BlockWorker::conclude(Batch& batch, EnvironmentData& data, int block, VectorCounts& counts) {
  const int first = block * kBlock, last = std::min(first + kBlock, batch.environments());
  for (int e = first; e < last; ++e) conclude_one(batch, data, e, counts);
}

std::span<const Snapshot> BlockWorker::snapshots(int lane) const {
  const std::size_t count = task_.spec().snapshots.size();
  return std::span(moments_).subspan(as_size(lane) * count, count);
}

void BlockWorker::start(Batch& batch, EnvironmentData& data, int environment) {
  const TaskSpec& spec = task_.spec();
  const std::size_t e = as_size(environment);
  const std::span<double> q = number_row(data.q, environment, as_size(task_.model().nq()));
  const std::span<double> v = number_row(data.v, environment, as_size(task_.model().nv()));
  const std::span<double> memory =
      number_row(data.task_state, environment, as_size(spec.task_state));
  data.episodes[e] = data.next_episode[e];
  data.length[e] = 0;
  data.returns[e] = 0;
  batch.reset(environment, data.episodes[e]);
  batch.get_q(environment, q);
  batch.get_v(environment, v);
  for (std::size_t k = 0; k < varying_.size(); ++k)
    varying_[k] = batch.randomized_value(environment, static_cast<int>(k));
  std::fill(memory.begin(), memory.end(), 0.0);
  task_.start({batch.seed(), data.episodes[e], q, v, varying_, memory});
  for (std::size_t k = 0; k < varying_.size(); ++k)
    if (batch.is_parameter(static_cast<int>(k)))
      batch.set_randomized_value(environment, static_cast<int>(k), varying_[k]);
  const std::span<double> action = number_row(data.action, environment, spec.action.size());
  std::fill(action.begin(), action.end(), 0.0);
  if (spec.settling_steps > 0) settle_start(batch, data, environment);
  batch.set_state(environment, q, v);
  if (spec.settling_steps > 0) batch.set_shear_state(environment, settling_->shear_state(0));
  if (spec.warm_up) {
    task_.begin_action(view_of(batch, data, environment), memory);
  } else {
    batch.hold(environment);
  }
}

/// Settles one environment in a batch of its own, so that others take no extra steps.
void BlockWorker::settle_start(const Batch& batch, EnvironmentData& data, int environment) {
  const Model& model = task_.model();
  if (!settling_ || settling_->seed() != batch.seed()) settling_.emplace(model, 1, batch.seed());
  const Snapshot& now = data.now[as_size(environment)];
  settling_->reset(0, data.episodes[as_size(environment)]);
  for (std::size_t k = 0; k < varying_.size(); ++k)
    if (batch.is_parameter(static_cast<int>(k)))
      settling_->set_randomized_value(0, static_cast<int>(k), varying_[k]);
  settling_->set_state(0, now.q, now.v);
  const std::span<double> u = number_row(data.u, environment, as_size(model.nu()));
  task_.controls(view_of(batch, data, environment), 0, u);
  for (int k = 0; k < task_.spec().settling_steps; ++k) settling_stepper_->step(*settling_, u);
  settling_->get_q(0, number_row(data.q, environment, now.q.size()));
  settling_->get_v(0, number_row(data.v, environment, now.v.size()));
}

void BlockWorker::take_action(Batch& batch, EnvironmentData& data, int environment,
                              std::span<const double> actions) {
  const TensorSpec& spec = task_.spec().action;
  const std::span<double> action = number_row(data.action, environment, spec.size());
  for (std::size_t k = 0; k < action.size(); ++k) {
    const double requested = actions[as_size(environment) * spec.size() + k];
    // clamp() lets NaN pass. The controls are then NaN, and the step reports it.
    action[k] = std::clamp(requested, spec.low, spec.high);
  }
  task_.begin_action(view_of(batch, data, environment),
                     number_row(data.task_state, environment, as_size(task_.spec().task_state)));
  if (!task_.spec().restarts) return;
  const std::span<double> q = number_row(data.q, environment, as_size(task_.model().nq()));
  const std::span<double> v = number_row(data.v, environment, as_size(task_.model().nv()));
  task_.restart_state(view_of(batch, data, environment), q, v);
  batch.set_state(environment, q, v);
}

void BlockWorker::read_snapshot(const Batch& batch, int block, std::size_t moment) {
  const int first = block * kBlock;
  const auto place = [&](std::vector<double>& snapshots) {
    return [this, &snapshots, moment, first](int e) { return part(snapshots, moment, e - first); };
  };
  read_states(batch, block, place(q_), place(v_));
  if (task_.end_effectors_size() > 0)
    read_end_effectors(readout_, batch, block, place(end_effectors_));
  read_fields<double>(readout_, batch, block, task_.fields(), place(tactile_));
  for (int e = first; shear_arrays_ && e < first + lanes_of(batch, block); ++e)
    shear_arrays_->write(batch.shear_state(e), part(shear_, moment, e - first));
  if (task_.bodies_size() == 0) return;
  const std::size_t poses = 7 * as_size(task_.model().nb());
  for (int e = first; e < first + lanes_of(batch, block); ++e) {
    const std::span<double> own = part(bodies_, moment, e - first);
    readout_.bodies(batch, e, own.first(poses), own.subspan(poses));
  }
}

void BlockWorker::conclude_one(Batch& batch, EnvironmentData& data, int environment,
                               VectorCounts& counts) {
  const TaskSpec& spec = task_.spec();
  const std::size_t e = as_size(environment);
  data.reward[e] = 0;
  if (data.state[e] == EnvironmentState::over) return;
  TaskView view = view_of(batch, data, environment);
  const std::span<const Snapshot> moments = this->snapshots(environment % kBlock);
  view.snapshots = moments;
  const Snapshot& now = moments.back();
  std::copy(now.q.begin(), now.q.end(), number_row(data.q, environment, now.q.size()).begin());
  std::copy(now.v.begin(), now.v.end(), number_row(data.v, environment, now.v.size()).begin());
  data.terminated[e] = data.truncated[e] = data.success[e] = 0;
  if (data.starting[e] != 0) {
    if (!spec.warm_up) {
      batch.hold(environment, false);
      view.snapshots = moments.last(1);
    }
    data.state[e] = EnvironmentState::running;
  } else {
    const bool lost = failed(batch.status(environment));
    ++counts.environment_steps;
    view.actions = ++data.length[e];
    StepOutcome verdict = task_.evaluate(view);
    if (lost && !std::isfinite(verdict.reward)) verdict.reward = 0;  // the action was no number
    data.reward[e] = verdict.reward;
    data.returns[e] += verdict.reward;
    data.terminated[e] = verdict.terminated && !lost;
    data.truncated[e] = lost || (!verdict.terminated && data.length[e] == spec.horizon);
    data.success[e] = verdict.success && !lost;
    if (data.terminated[e] != 0 || data.truncated[e] != 0) {
      data.state[e] = EnvironmentState::over;
      batch.hold(environment);
    }
  }
  task_.observe(view, number_row(data.observation, environment, spec.observation_size()));
}

}  // namespace tangere
