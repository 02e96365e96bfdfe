// SPDX-License-Identifier: Apache-2.0
// A thread takes a block and steps it through the whole episode: its state stays in that thread's
// cache, and no thread waits for another between steps.
#include "tasks/run/benchmark_run.hpp"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <chrono>
#include <ctime>
#include <string>

#include "engine/step/stepper.hpp"
#include "kernels/numbers/block.hpp"
#include "tasks/run/benchmark_fields.hpp"
#include "tasks/run/thread_order.hpp"

namespace tangere {
namespace {

using kernels::kBlock;

/// Scratch of one thread.
struct Worker {
  Worker(const Model& model, Precision precision) : stepper(model), readout(model, precision) {}
  Stepper stepper;
  Readout readout;
};

/// What one block did in one pass.
struct BlockTally {
  std::int64_t environment_steps = 0, newton_iterations = 0, tactile_points = 0;
  std::vector<FailedEnvironment> failures;
};

std::uint64_t mix(std::uint64_t hash, std::uint64_t bits) {
  return std::rotl(hash ^ bits, 29) * 0x9e3779b97f4a7c15U + 0x632be59bd9b4e019U;
}

template <class Bits, class T>
std::uint64_t chain(std::uint64_t checksum, std::span<const T> numbers) {
  // Four chains beside each other: in a single one each product would wait for the one before.
  std::array<std::uint64_t, 4> chains{checksum, checksum + 1, checksum + 2, checksum + 3};
  for (std::size_t i = 0; i < numbers.size(); ++i)
    chains[i % 4] = mix(chains[i % 4], std::bit_cast<Bits>(numbers[i]));
  for (const std::uint64_t chain : chains) checksum = mix(checksum, chain);
  return checksum;
}

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

/// An episode that can be run again and again, and all memory for it.
class Episode {
 public:
  Episode(const Batch& start, const ControlProgram& controls, const BenchmarkOptions& options,
          const BenchmarkGoOn& go_on)
      : start_(start),
        batch_(start),
        controls_(controls),
        options_(options),
        go_on_(go_on),
        u_(lanes(start.environments()) * lanes(start.model().nu())),
        fields_(start.model(), start.environments(), options.frames, options.precision),
        tallies_(lanes(start.blocks())),
        checksums_(lanes(start.environments())),
        cap_(tbb::global_control::max_allowed_parallelism, lanes(options.threads)),
        arena_(options.threads) {
    workers_.reserve(lanes(options.threads));
    for (int i = 0; i < options.threads; ++i)
      workers_.emplace_back(start.model(), options.precision);
    if (workers_[0].stepper.timestep() != controls.timestep())
      throw InputError("controls laid out for a timestep of " +
                       std::to_string(controls.timestep()) + " s; the scene's is " +
                       std::to_string(workers_[0].stepper.timestep()) + " s");
  }

  /// One pass from the start; with `checked`, checksums are made, which takes time.
  BenchmarkTime pass(bool checked) {
    batch_ = start_;
    const double cpu = cpu_seconds();
    const auto begin = std::chrono::steady_clock::now();
    const auto run_blocks = [&](const tbb::blocked_range<int>& blocks) {
      TaskOrder::arrive();
      Worker& worker = workers_[lanes(tbb::this_task_arena::current_thread_index())];
      const TaskOrder::Task task(order_, &worker);
      for (int b = blocks.begin(); b != blocks.end(); ++b) run_block(b, worker, checked);
    };
    order_.begin();
    arena_.execute([&] {
      // One block at a time to whoever is free: some blocks need more iterations than others, and
      // the machine may have other work on some cores.
      tbb::parallel_for(tbb::blocked_range<int>(0, batch_.blocks(), 1),
                        ByReference<decltype(run_blocks)>{&run_blocks}, tbb::simple_partitioner{});
    });
    order_.end();
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin;
    return {wall.count(), cpu_seconds() - cpu};
  }

  [[nodiscard]] bool stopped() const { return stopped_; }

  /// Of the pass before.
  void report(BenchmarkResult& result) const {
    for (const BlockTally& tally : tallies_) {
      result.environment_steps += tally.environment_steps;
      result.simulation_steps += tally.environment_steps;
      result.newton_iterations += tally.newton_iterations;
      result.tactile_points += tally.tactile_points;
      result.failures.insert(result.failures.end(), tally.failures.begin(), tally.failures.end());
    }
    std::stable_sort(result.failures.begin(), result.failures.end(),
                     [](const auto& a, const auto& b) { return a.step < b.step; });
    result.checksums = checksums_;
  }

 private:
  static std::size_t lanes(int n) { return static_cast<std::size_t>(n); }

  void run_block(int block, Worker& worker, bool checked) {
    const int first = block * kBlock, last = std::min(first + kBlock, batch_.environments());
    const std::size_t nu = lanes(batch_.model().nu());
    BlockTally tally;
    if (checked)
      for (int e = first; e < last; ++e)
        checksums_[lanes(e)] = static_cast<std::uint64_t>(batch_.episode(e));
    std::array<bool, kBlock> live{};
    for (int e = first; e < last; ++e) live[lanes(e - first)] = !failed(batch_.status(e));
    for (std::int64_t t = 0; t < options_.rollout.steps; ++t) {
      if (go_on_ && !go_on_()) {
        stopped_ = true;
        return;
      }
      for (int e = first; e < last; ++e)
        controls_.evaluate(t, batch_.episode(e), std::span(u_).subspan(lanes(e) * nu, nu));
      worker.stepper.step_block(batch_, block, u_);
      count(first, last, t, live, tally);
      if (options_.frames != FrameKind::none)
        read_fields(first, last, t + 1, live, worker, checked, tally);
    }
    if (checked) chain_states(first, last);
    tallies_[lanes(block)] = std::move(tally);
  }

  /// Environments that failed in this step leave `live`.
  void count(int first, int last, std::int64_t step, std::array<bool, kBlock>& live,
             BlockTally& tally) const {
    for (int e = first; e < last; ++e) {
      bool& alive = live[lanes(e - first)];
      if (!alive) continue;
      ++tally.environment_steps;
      tally.newton_iterations += batch_.iterations(e);
      if (!failed(batch_.status(e))) continue;
      tally.failures.push_back({e, step, batch_.status(e)});
      alive = false;
    }
  }

  /// The fields due after `done` steps.
  void read_fields(int first, int last, std::int64_t done, const std::array<bool, kBlock>& live,
                   Worker& worker, bool checked, BlockTally& tally) {
    const std::span<const SensorInfo> sensors = batch_.model().sensors();
    for (std::size_t s = 0; s < sensors.size(); ++s) {
      const int sensor = static_cast<int>(s);
      if (done % tactile_interval(sensors[s], options_.rollout) != 0) continue;
      fields_.read(worker.readout, batch_, first / kBlock, sensor);
      for (int e = first; e < last; ++e) {
        if (!live[lanes(e - first)]) continue;
        tally.tactile_points += sensors[s].points;
        if (checked) checksums_[lanes(e)] = fields_.chain(checksums_[lanes(e)], e, sensor);
      }
    }
  }

  void chain_states(int first, int last) {
    std::vector<double> q(lanes(batch_.model().nq())), v(lanes(batch_.model().nv()));
    for (int e = first; e < last; ++e) {
      batch_.get_q(e, q);
      batch_.get_v(e, v);
      checksums_[lanes(e)] = chain_bits(chain_bits(checksums_[lanes(e)], q), v);
    }
  }

  const Batch& start_;
  Batch batch_;
  const ControlProgram& controls_;
  const BenchmarkOptions& options_;
  const BenchmarkGoOn& go_on_;
  std::vector<double> u_;  // (E, nu)
  BenchmarkFields fields_;
  std::vector<BlockTally> tallies_;
  std::vector<std::uint64_t> checksums_;
  std::vector<Worker> workers_;  // by the thread's index in the arena
  std::atomic<bool> stopped_{false};
  TaskOrder order_;
  // The arena alone is not enough where more threads are asked for than there are cores.
  tbb::global_control cap_;
  tbb::task_arena arena_;
};

void check(const ControlProgram& controls, const BenchmarkOptions& options) {
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
  controls.check_covers(options.rollout.steps);
}

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
}

}  // namespace

const char* to_string(FrameKind value) {
  switch (value) {
    case FrameKind::none: return "none";
    case FrameKind::dense: return "dense";
    case FrameKind::compact: return "compact";
  }
  return "unknown";
}

std::uint64_t chain_bits(std::uint64_t checksum, std::span<const double> numbers) {
  return chain<std::uint64_t>(checksum, numbers);
}
std::uint64_t chain_bits(std::uint64_t checksum, std::span<const float> numbers) {
  return chain<std::uint32_t>(checksum, numbers);
}

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
                              const BenchmarkOptions& options, const BenchmarkGoOn& go_on) {
  check(controls, options);
  Episode episode(start, controls, options, go_on);
  BenchmarkResult result;
  episode.pass(true);
  episode.report(result);
  while (!episode.stopped() && result.times.size() < static_cast<std::size_t>(options.repeat)) {
    const BenchmarkTime time = episode.pass(false);
    if (!episode.stopped()) result.times.push_back(time);
  }
  result.stopped = episode.stopped();
  return result;
}

double benchmark_bytes(const Model& model, int environments, const BenchmarkOptions& options) {
  const double per_environment = static_cast<double>(model.state_bytes_per_environment()) +
                                 field_bytes(model, options.frames, options.precision) +
                                 model.nu() * static_cast<double>(sizeof(double)) +
                                 sizeof(std::uint64_t);
  const double per_thread = static_cast<double>(Stepper::workspace_bytes(model));
  return environments * per_environment + options.threads * per_thread;
}

}  // namespace tangere
