// SPDX-License-Identifier: Apache-2.0
// Reads the variables of Open MPI, of MPICH and its relatives (PMI), and of Slurm. Needs none of
// their libraries.
#include "apps/workers.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cstdlib>
#include <cstring>
#include <optional>

#include "engine/base/error.hpp"

namespace tangere::apps {
namespace {

struct Variables {
  const char* index;
  const char* count;
};

// Slurm's own numbers come last, because for mpirun within a Slurm job they are those of the
// daemons on the nodes. SLURM_NTASKS cannot replace SLURM_STEP_NUM_TASKS: it is also set in a batch
// script, whose plain commands run once.
constexpr Variables kProcess[] = {{"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"},
                                  {"PMI_RANK", "PMI_SIZE"},
                                  {"SLURM_PROCID", "SLURM_STEP_NUM_TASKS"}};

std::optional<std::int64_t> whole_number(const char* text) {
  std::int64_t value = 0;
  const char* const end = text + std::strlen(text);
  const auto [at, error] = std::from_chars(text, end, value);
  if (error != std::errc() || at != end || value < 0 || value > 1'000'000'000) return std::nullopt;
  return value;
}

std::int64_t number_of(const char* variable) {
  const char* const text = std::getenv(variable);
  if (text == nullptr)
    throw InputError(fmt::format("{} is not set, but the variables beside it are", variable));
  const std::optional<std::int64_t> value = whole_number(text);
  if (!value) throw InputError(fmt::format("{}={}; expected a whole number", variable, text));
  return *value;
}

void check_below(const char* variable, std::int64_t index, std::int64_t count) {
  if (index < 0 || index >= count)
    throw InputError(fmt::format("{} says number {} of {}; expected 0 to {}", variable, index,
                                 count, count - 1));
}

/// Returns the position in the array's list of numbers, which may begin anywhere and have gaps.
std::optional<Worker> array_worker() {
  if (std::getenv("SLURM_ARRAY_TASK_ID") == nullptr) return std::nullopt;
  const std::int64_t id = number_of("SLURM_ARRAY_TASK_ID"),
                     count = number_of("SLURM_ARRAY_TASK_COUNT");
  const std::int64_t low =
      std::getenv("SLURM_ARRAY_TASK_MIN") == nullptr ? 0 : number_of("SLURM_ARRAY_TASK_MIN");
  const std::int64_t step =
      std::getenv("SLURM_ARRAY_TASK_STEP") == nullptr ? 1 : number_of("SLURM_ARRAY_TASK_STEP");
  if (step < 1 || (id - low) % step != 0)
    throw InputError(
        fmt::format("SLURM_ARRAY_TASK_ID={} is not SLURM_ARRAY_TASK_MIN={} and multiples of "
                    "SLURM_ARRAY_TASK_STEP={}; expected an array like 0-99",
                    id, low, step));
  const std::int64_t index = (id - low) / step;
  check_below("SLURM_ARRAY_TASK_ID", index, count);
  return Worker{index, count, "SLURM_ARRAY_TASK_ID"};
}

std::optional<Worker> process_worker() {
  for (const Variables& variables : kProcess) {
    if (std::getenv(variables.index) == nullptr || std::getenv(variables.count) == nullptr)
      continue;
    const Worker worker{number_of(variables.index), number_of(variables.count), variables.index};
    check_below(variables.index, worker.index, worker.count);
    return worker;
  }
  return std::nullopt;
}

}  // namespace

Worker worker_from_environment() {
  const std::optional<Worker> array = array_worker(), process = process_worker();
  if (!array) return process.value_or(Worker{});
  if (!process) return *array;
  return {array->index * process->count + process->index, array->count * process->count,
          array->source + " and " + process->source};
}

Worker worker_named(const std::string& words) {
  const std::size_t slash = words.find('/');
  const std::string before = words.substr(0, slash),
                    after = slash == std::string::npos ? "" : words.substr(slash + 1);
  const std::optional<std::int64_t> index = whole_number(before.c_str()),
                                    count = whole_number(after.c_str());
  if (before.empty() || after.empty() || !index || !count || *index >= *count)
    throw InputError(
        fmt::format("--shard {}; expected k/S, shard k of S, with k from 0 to S - 1", words));
  return {*index, *count, "--shard"};
}

std::vector<std::int64_t> shards_of(const Worker& worker, std::int64_t shards) {
  std::vector<std::int64_t> mine;
  for (std::int64_t shard = worker.index; shard < shards; shard += worker.count)
    mine.push_back(shard);
  return mine;
}

}  // namespace tangere::apps
