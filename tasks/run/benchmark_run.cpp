// SPDX-License-Identifier: Apache-2.0
// A thread steps a block through the whole episode. The block's state stays in that thread's cache,
// and threads do not synchronise between steps.
#include "tasks/run/benchmark_run.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <ctime>
#include <mutex>
#include <optional>
#include <string>

#include "engine/base/as_size.hpp"
#include "engine/step/stepper.hpp"
#include "kernels/numbers/block.hpp"
#include "tasks/run/benchmark_fields.hpp"
#include "tasks/run/block_threads.hpp"
#include "tasks/run/checksum.hpp"
#include "tasks/run/episode_program.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {
namespace {

using kernels::kBlock;

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// Scratch of one thread, which allocates it: its pages lie in the memory next to the thread.
struct Worker {
  std::optional<Stepper> stepper;
  std::optional<Readout> readout;
  std::unique_ptr<EpisodeProgram> program;
};

/// What one block did in one pass.
struct BlockTally {
  StepCounts counts;  ///< of a scene; a task's program counts itself
  std::int64_t tactile_points = 0;
  std::vector<FailedEnvironment> failures;
};

/// Repeatable episodes and all their buffers.
class Benchmark {
 public:
  using MakeProgram = std::function<std::unique_ptr<EpisodeProgram>()>;

  /// `task_data`: shared by the programs of a task; null for a scene.
  Benchmark(const Batch& start, const BenchmarkOptions& options, const std::stop_token& stop,
            std::shared_ptr<EnvironmentData> task_data, const MakeProgram& make_program)
      : start_(start),
        batch_(start),
        options_(options),
        stop_(stop),
        data_(std::move(task_data)),
        frames_(data_ == nullptr ? options.frames : FrameKind::none),
        u_(as_size(start.environments()) * as_size(start.model().nu())),
        fields_(start.model(), start.environments(), options, frames_),
        tallies_(as_size(start.blocks())),
        checksums_(as_size(start.environments())),
        make_program_(make_program),
        workers_(as_size(options.threads)),
        threads_(options.threads, options.pinned) {}

  BenchmarkResult run() {
    BenchmarkResult result;
    pass(true);
    report(result);
    for (Worker& worker : workers_) program_of(worker);  // of threads that had no block
    while (!stopped_ && std::ssize(result.times) < options_.repeat) {
      const BenchmarkTime time = pass(false);
      if (!stopped_) result.times.push_back(time);
    }
    result.stopped = stopped_;
    return result;
  }

 private:
  /// Runs one pass from the start. With `checked` it computes checksums, which takes time.
  BenchmarkTime pass(bool checked) {
    batch_ = start_;
    for (Worker& worker : workers_)
      if (TaskProgram* const task = task_program(worker)) task->clear_counts();
    if (data_ != nullptr) {
      data_->restart(batch_);
      threads_.for_each(batch_.blocks(), workers_, [&](Worker& w, int b) { start_block(b, w); });
    }
    const double cpu = cpu_seconds();
    const auto begin = std::chrono::steady_clock::now();
    threads_.for_each(batch_.blocks(), workers_,
                      [&](Worker& w, int b) { run_block(b, w, checked); });
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin;
    return {wall.count(), cpu_seconds() - cpu};
  }

  /// Reports the pass before.
  void report(BenchmarkResult& result) const {
    for (const BlockTally& tally : tallies_) {
      result.counts += tally.counts;
      result.tactile_points += tally.tactile_points;
      result.failures.insert(result.failures.end(), tally.failures.begin(), tally.failures.end());
    }
    result.environment_steps = result.counts.simulation_steps;
    for (const Worker& worker : workers_)
      if (const TaskProgram* const task = task_program(worker)) {
        result.environment_steps += task->counts().environment_steps;
        result.counts += task->counts().steps;
      }
    std::stable_sort(result.failures.begin(), result.failures.end(),
                     [](const auto& a, const auto& b) { return a.step < b.step; });
    result.checksums = checksums_;
  }

  static TaskProgram* task_program(const Worker& worker) {
    return worker.program == nullptr ? nullptr : worker.program->task_program();
  }

  /// Allocates the worker of a thread on its first block.
  EpisodeProgram& program_of(Worker& worker) {
    if (worker.program == nullptr) {
      const std::lock_guard lock(making_);
      worker.stepper.emplace(start_.model());
      worker.readout.emplace(start_.model(), options_.precision);
      worker.program = make_program_();
    }
    return *worker.program;
  }

  void start_block(int block, Worker& worker) {
    EpisodeProgram& program = program_of(worker);
    program.start(batch_, block);
    if (program.opening_steps() == 0) return;
    for (int t = 0; t < program.opening_steps(); ++t) take_step(t, block, worker);
    program.after_row(batch_, block);
  }

  void take_step(std::int64_t t, int block, Worker& worker) {
    worker.program->controls(t, batch_, block, u_);
    worker.stepper->step_block(batch_, block, u_);
    worker.program->after_step(t, batch_, block);
  }

  void run_block(int block, Worker& worker, bool checked) {
    EpisodeProgram& program = program_of(worker);
    const int first = block * kBlock, last = first + lanes_of(batch_, block);
    BlockTally tally;
    StepTally steps(batch_, first, last - first);
    if (checked)
      for (int e = first; e < last; ++e)
        checksums_[as_size(e)] = static_cast<std::uint64_t>(start_.episode(e));
    for (std::int64_t row = 0; row < options_.rollout.steps; ++row) {
      for (int k = 0; k < program.steps_per_row(); ++k) {
        if (stop_.stop_requested()) {
          stopped_ = true;
          return;
        }
        const std::int64_t t = row * program.steps_per_row() + k;
        take_step(program.opening_steps() + t, block, worker);
        if (data_ != nullptr) continue;
        steps.count(batch_, t);
        if (frames_ != FrameKind::none)
          read_fields(first, last, t + 1, steps, worker, checked, tally);
      }
      if (data_ == nullptr) continue;
      program.after_row(batch_, block);
      if (checked) chain_action(first, last, row, tally);
    }
    if (data_ == nullptr) {
      tally.counts = steps.counts;
      tally.failures = std::move(steps.failures);
      if (checked) chain_states(first, last);
    }
    tallies_[as_size(block)] = std::move(tally);
  }

  /// Reads the fields that are due after `done` steps.
  void read_fields(int first, int last, std::int64_t done, const StepTally& steps, Worker& worker,
                   bool checked, BlockTally& tally) {
    const std::span<const SensorInfo> sensors = batch_.model().sensors();
    for (std::size_t k = 0; k < fields_.outputs().size(); ++k) {
      const FieldOutput of = fields_.outputs()[k];
      if (!reading_times(batch_.model(), of, options_.rollout).at(done, options_.rollout.steps))
        continue;
      fields_.read(*worker.readout, batch_, first / kBlock, k);
      for (int e = first; e < last; ++e) {
        if (!steps.live(e)) continue;
        if (!is_view(of.form)) tally.tactile_points += sensors[as_size(of.sensor)].points;
        if (checked) checksums_[as_size(e)] = fields_.chain(checksums_[as_size(e)], e, k);
      }
    }
  }

  void chain_states(int first, int last) {
    std::vector<double> q(as_size(batch_.model().nq())), v(as_size(batch_.model().nv()));
    for (int e = first; e < last; ++e) {
      batch_.get_q(e, q);
      batch_.get_v(e, v);
      checksums_[as_size(e)] = chain_bits(chain_bits(checksums_[as_size(e)], q), v);
    }
  }

  void chain_action(int first, int last, std::int64_t action, BlockTally& tally) {
    const EnvironmentData& d = *data_;
    const std::size_t seen = d.observation.size() / d.reward.size();
    for (int e = first; e < last; ++e) {
      const std::size_t i = as_size(e);
      const std::array<double, 4> rest{d.reward[i], double(d.terminated[i]), double(d.truncated[i]),
                                       double(d.success[i])};
      checksums_[i] =
          chain_bits(chain_bits(checksums_[i], std::span(d.observation).subspan(i * seen, seen)),
                     std::span<const double>(rest));
      if (failed(batch_.status(e)) && d.truncated[i] != 0)
        tally.failures.push_back({e, action, batch_.status(e)});
    }
  }

  const Batch& start_;
  Batch batch_;
  const BenchmarkOptions& options_;
  const std::stop_token& stop_;
  std::shared_ptr<EnvironmentData> data_;
  FrameKind frames_;
  std::vector<double> u_;  // (E, nu)
  BenchmarkFields fields_;
  std::vector<BlockTally> tallies_;
  std::vector<std::uint64_t> checksums_;
  const MakeProgram make_program_;
  std::mutex making_;
  std::vector<Worker> workers_;  // by the thread's index in the arena
  std::atomic<bool> stopped_{false};
  BlockThreads threads_;
};

void check(const BenchmarkOptions& options) {
  const auto at_least_one = [](const char* what, std::int64_t value) {
    if (value < 1)
      throw InputError("a benchmark with " + std::to_string(value) + " " + what +
                       "; expected at least 1");
  };
  at_least_one("threads", options.threads);
  at_least_one("timed passes", options.repeat);
  at_least_one("steps", options.rollout.steps);
  if (options.rollout.every < 0)
    throw InputError("tactile every " + std::to_string(options.rollout.every) +
                     " steps; expected 1 or more, or 0 for the scene's own");
}

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
}

}  // namespace

std::uint64_t BenchmarkResult::checksum() const {
  std::uint64_t sum = 0;
  for (const std::uint64_t checksum : checksums) sum += checksum;
  return sum;
}

BenchmarkTime BenchmarkResult::best() const {
  return *std::min_element(times.begin(), times.end(),
                           [](const auto& a, const auto& b) { return a.seconds < b.seconds; });
}

BenchmarkTime BenchmarkResult::median() const {
  std::vector<double> wall, cpu;
  for (const BenchmarkTime& time : times) {
    wall.push_back(time.seconds);
    cpu.push_back(time.cpu_seconds);
  }
  return {median_of(std::move(wall)), median_of(std::move(cpu))};
}

BenchmarkResult run_benchmark(const Batch& start, const ControlProgram& controls,
                              const BenchmarkOptions& options, const std::stop_token& stop) {
  check(options);
  controls.check_covers(options.rollout.steps);
  const double timestep = Stepper(start.model()).timestep();
  if (timestep != controls.timestep())
    throw InputError("controls laid out for a timestep of " + std::to_string(controls.timestep()) +
                     " s; the scene's is " + std::to_string(timestep) + " s");
  return Benchmark(start, options, stop, nullptr,
                   [&] { return std::make_unique<SceneProgram>(controls); })
      .run();
}

BenchmarkResult run_benchmark(const Batch& start, const Task& task, const Policy& policy,
                              const BenchmarkOptions& options, const std::stop_token& stop) {
  check(options);
  const auto data = std::make_shared<EnvironmentData>(task, start.environments());
  BenchmarkResult result =
      Benchmark(start, options, stop, data, [&] {
        return std::make_unique<TaskProgram>(task, policy, data, options.precision, 1,
                                             TaskProgram::AtEnd::again);
      }).run();
  result.tactile_points = static_cast<std::int64_t>(task.tactile_size() / 3) *
                          std::ssize(task.spec().snapshots) * start.environments() *
                          options.rollout.steps;
  return result;
}

double benchmark_bytes(const Model& model, int environments, const BenchmarkOptions& options) {
  const double per_environment =
      static_cast<double>(model.state_bytes_per_environment() + Stepper::candidate_bytes(model)) +
      field_bytes(model, options, options.frames) +
      model.nu() * static_cast<double>(sizeof(double)) + sizeof(std::uint64_t);
  const double per_thread = static_cast<double>(Stepper::workspace_bytes(model));
  return environments * per_environment + options.threads * per_thread;
}

double benchmark_bytes(const Task& task, int environments, const BenchmarkOptions& options) {
  BenchmarkOptions no_fields = options;
  no_fields.frames = FrameKind::none;
  return benchmark_bytes(task.model(), environments, no_fields) +
         environments * EnvironmentData::bytes(task) + options.threads * BlockWorker::bytes(task);
}

}  // namespace tangere
