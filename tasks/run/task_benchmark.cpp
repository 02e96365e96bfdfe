// SPDX-License-Identifier: Apache-2.0
// Environment steps of a task for the clock: policy, steps, looks, rewards and resets, nothing
// stored.
#include <fmt/format.h>

#include <array>
#include <chrono>
#include <ctime>

#include "tasks/run/task_episodes.hpp"

namespace tangere {
namespace {

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void chain(const VectorTask& vector, std::vector<std::uint64_t>& checksums) {
  for (int e = 0; e < vector.environments(); ++e) {
    const auto i = static_cast<std::size_t>(e);
    const std::array<double, 4> rest{
        vector.rewards()[i], static_cast<double>(vector.terminated()[i]),
        static_cast<double>(vector.truncated()[i]), static_cast<double>(vector.success()[i])};
    checksums[i] =
        chain_bits(chain_bits(checksums[i], vector.observation(e)), std::span<const double>(rest));
  }
}

std::int64_t tactile_points(const Task& task) {
  return static_cast<std::int64_t>(task.tactile_size() / 3 * task.spec().moments.size());
}

}  // namespace

BenchmarkResult run_task_benchmark(const Task& task, const Policy& policy, int environments,
                                   std::int64_t actions, int repeat, const VectorOptions& options,
                                   const BenchmarkGoOn& go_on) {
  if (actions < 1 || repeat < 1)
    throw InputError(
        fmt::format("{} environment steps, {} passes; expected at least 1", actions, repeat));
  VectorTask vector(task, environments, options);
  std::vector<double> u(static_cast<std::size_t>(environments) * task.spec().action.size());
  BenchmarkResult result;
  for (int e = 0; e < environments; ++e)
    result.checksums.push_back(
        static_cast<std::uint64_t>(vector.episodes()[static_cast<std::size_t>(e)]));
  for (int pass = 0; pass <= repeat; ++pass) {
    if (pass > 0) vector.reset(options.seed);
    const double cpu = cpu_seconds();
    const auto begin = std::chrono::steady_clock::now();
    for (std::int64_t t = 0; t < actions; ++t) {
      if (go_on && !go_on()) {
        result.stopped = true;
        return result;
      }
      policy.act(vector, u);
      vector.step(u);
      if (pass > 0) continue;
      chain(vector, result.checksums);
      for (int e = 0; e < environments; ++e)
        if (failed(vector.status(e)) && vector.truncated()[static_cast<std::size_t>(e)] != 0)
          result.failures.push_back({e, t, vector.status(e)});
    }
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begin;
    if (pass > 0) result.times.push_back({wall.count(), cpu_seconds() - cpu});
  }
  // Counts of one pass; the others take the same steps.
  const VectorCounts counts = vector.counts();
  result.environment_steps = counts.environment_steps;
  result.simulation_steps = counts.simulation_steps;
  result.newton_iterations = counts.newton_iterations;
  result.tactile_points = tactile_points(task) * environments * actions;
  return result;
}

}  // namespace tangere
