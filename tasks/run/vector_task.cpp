// SPDX-License-Identifier: Apache-2.0
// A thread advances a block of 16 environments by one action: it starts new episodes, steps, takes
// snapshots, and computes rewards and observations.
#include "tasks/run/vector_task.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "tasks/run/block_threads.hpp"
#include "tasks/run/block_worker.hpp"
#include "tasks/run/row_readings.hpp"

namespace tangere {

struct VectorTask::Impl {
  /// Scratch of one thread.
  struct Worker {
    BlockWorker block;
    Stepper stepper;
    RowReadings::Reader reader;
  };

  Impl(const Task& t, int environments, const VectorOptions& o)
      : task(t),
        options(o),
        data(t, environments),
        batch(t.model(), environments, o.seed, o.first_episode),
        readings(t, o.readings, environments),
        threads(o.threads) {
    workers.reserve(static_cast<std::size_t>(o.threads));
    for (int i = 0; i < o.threads; ++i)
      workers.push_back({BlockWorker(t, o.precision), Stepper(t.model()),
                         RowReadings::Reader(readings, t.model(), o.precision)});
    tallies.resize(static_cast<std::size_t>(batch.blocks()));
  }

  void reset(std::uint64_t seed, std::int64_t first_episode) {
    options.seed = seed;
    options.first_episode = first_episode;
    if (batch.seed() != seed)
      batch = Batch(task.model(), batch.environments(), seed, options.first_episode);
    for (int e = 0; e < batch.environments(); ++e)
      data.next_episode[static_cast<std::size_t>(e)] = options.first_episode + e;
    std::fill(data.state.begin(), data.state.end(), EnvironmentState::to_start);
    std::fill(tallies.begin(), tallies.end(), VectorCounts{});
    run({});
  }

  /// Marks all other environments as over, so that only `which` restart.
  void restart(std::span<const std::uint8_t> which) {
    const std::vector<EnvironmentState> states = data.state;
    const std::vector<double> rewards = data.reward;
    for (std::size_t e = 0; e < which.size(); ++e) {
      if (which[e] == 0) {
        batch.hold(static_cast<int>(e));
        data.state[e] = EnvironmentState::over;
      } else if (states[e] != EnvironmentState::to_start) {
        data.next_episode[e] = data.episodes[e] + std::ssize(states);
        data.state[e] = EnvironmentState::to_start;
      }
    }
    step_blocks({});
    for (std::size_t e = 0; e < which.size(); ++e) {
      if (which[e] != 0) continue;
      data.state[e] = states[e];
      data.reward[e] = rewards[e];
      batch.hold(static_cast<int>(e), states[e] != EnvironmentState::running);
    }
  }

  void run(std::span<const double> actions) {
    step_blocks(actions);
    if (options.autoreset) data.start_next(0, batch.environments());
  }

  void step_blocks(std::span<const double> actions) {
    threads.for_each(batch.blocks(), workers,
                     [&](Worker& worker, int block) { act(worker, block, actions); });
  }

  /// `actions`: empty if every environment of the block starts.
  void act(Worker& worker, int block, std::span<const double> actions) {
    VectorCounts& counts = tallies[static_cast<std::size_t>(block)];
    worker.block.begin(batch, data, block, actions);
    for (int k = 0; k < task.spec().steps_per_action; ++k) {
      worker.block.compute_controls(batch, data, block, k);
      worker.stepper.step_block(batch, block, data.u);
      worker.block.record_snapshot(batch, block, k, counts);
      if (!readings.channels().empty()) readings.read(worker.reader, batch, data, block, k);
    }
    worker.block.conclude(batch, data, block, counts);
  }

  const Task& task;
  VectorOptions options;
  EnvironmentData data;
  Batch batch;
  RowReadings readings;
  std::vector<Worker> workers;        // by the thread's index in the arena
  std::vector<VectorCounts> tallies;  // per block
  BlockThreads threads;
};

VectorTask::VectorTask(const Task& task, int environments, const VectorOptions& options) {
  if (options.threads < 1)
    throw InputError(std::to_string(options.threads) + " threads; expected at least 1");
  impl_ = std::make_unique<Impl>(task, environments, options);
  impl_->reset(options.seed, options.first_episode);
}
VectorTask::~VectorTask() = default;
VectorTask::VectorTask(VectorTask&&) noexcept = default;
VectorTask& VectorTask::operator=(VectorTask&&) noexcept = default;

void VectorTask::reset(std::uint64_t seed) { impl_->reset(seed, impl_->options.first_episode); }
void VectorTask::reset(std::uint64_t seed, std::int64_t first_episode) {
  impl_->reset(seed, first_episode);
}
void VectorTask::restart(std::span<const std::uint8_t> which) {
  if (which.size() != impl_->data.state.size())
    throw InputError(std::to_string(which.size()) + " marks of environments; expected " +
                     std::to_string(impl_->data.state.size()));
  impl_->restart(which);
}

void VectorTask::step(std::span<const double> actions) {
  const std::size_t expected = impl_->data.action.size();
  if (actions.size() != expected)
    throw InputError(std::to_string(actions.size()) + " numbers of actions; expected " +
                     std::to_string(expected));
  impl_->run(actions);
}

const Task& VectorTask::task() const { return impl_->task; }
std::uint64_t VectorTask::seed() const { return impl_->options.seed; }
int VectorTask::environments() const { return impl_->batch.environments(); }
std::span<const double> VectorTask::observations() const { return impl_->data.observation; }
std::span<const double> VectorTask::observation(int environment) const {
  const std::size_t width = impl_->task.spec().observation_size();
  return observations().subspan(static_cast<std::size_t>(environment) * width, width);
}
std::span<const double> VectorTask::actions() const { return impl_->data.action; }
std::span<const double> VectorTask::rewards() const { return impl_->data.reward; }
std::span<const std::uint8_t> VectorTask::terminated() const { return impl_->data.terminated; }
std::span<const std::uint8_t> VectorTask::truncated() const { return impl_->data.truncated; }
std::span<const std::uint8_t> VectorTask::success() const { return impl_->data.success; }
std::span<const std::uint8_t> VectorTask::starting() const { return impl_->data.starting; }
std::span<const double> VectorTask::returns() const { return impl_->data.returns; }
std::span<const std::int64_t> VectorTask::lengths() const { return impl_->data.length; }
std::span<const std::int64_t> VectorTask::episodes() const { return impl_->data.episodes; }
StepStatus VectorTask::status(int environment) const { return impl_->batch.status(environment); }
TaskView VectorTask::view(int environment) const {
  return view_of(impl_->batch, impl_->data, environment);
}
const Batch& VectorTask::batch() const { return impl_->batch; }

const std::vector<EpisodeChannel>& VectorTask::readings() const {
  return impl_->readings.channels();
}
std::span<const float> VectorTask::reading(std::size_t k) const {
  return impl_->readings.numbers(k);
}
std::span<const std::uint8_t> VectorTask::colours(std::size_t k) const {
  return impl_->readings.bytes(k);
}

VectorCounts VectorTask::counts() const {
  VectorCounts sum;
  for (const VectorCounts& tally : impl_->tallies) sum += tally;
  return sum;
}

}  // namespace tangere
