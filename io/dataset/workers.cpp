// SPDX-License-Identifier: Apache-2.0
// Reads the variables of schedulers and launchers. Needs none of their libraries.
#include "io/dataset/workers.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cstdlib>
#include <cstring>
#include <optional>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

struct Variables {
  const char* index;
  const char* count;
};

constexpr Variables kOwn{"TANGERE_WORKER", "TANGERE_WORKERS"};

// Of processes of a parallel program: Open MPI, MPICH and its relatives (PMI), srun. Slurm's own
// numbers come last, because for mpirun within a Slurm job they are those of the daemons on the
// nodes. SLURM_NTASKS cannot replace SLURM_STEP_NUM_TASKS: it is also set in a batch script, whose
// plain commands run once.
constexpr Variables kProcess[] = {{"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"},
                                  {"PMI_RANK", "PMI_SIZE"},
                                  {"SLURM_PROCID", "SLURM_STEP_NUM_TASKS"}};

/// The numbers of an array's tasks: first, first + step, …, last, or `count` of them. A variable
/// that is null or not set has the value in parentheses.
struct Array {
  const char* index;
  const char* count;  ///< null: as `last` says; without that, as TANGERE_WORKERS says
  const char* first;  ///< (`first_number`)
  const char* step;   ///< (1)
  const char* last;   ///< null: as `count` says
  std::int64_t first_number = 0;
  const char* none = "";  ///< the value of `index` outside an array
};

constexpr Array kArrays[] = {
    {"SLURM_ARRAY_TASK_ID", "SLURM_ARRAY_TASK_COUNT", "SLURM_ARRAY_TASK_MIN",
     "SLURM_ARRAY_TASK_STEP", nullptr},
    {"AWS_BATCH_JOB_ARRAY_INDEX", "AWS_BATCH_JOB_ARRAY_SIZE", nullptr, nullptr, nullptr},
    {"SGE_TASK_ID", nullptr, "SGE_TASK_FIRST", "SGE_TASK_STEPSIZE", "SGE_TASK_LAST", 1,
     "undefined"},
    {"LSB_JOBINDEX", nullptr, nullptr, "LSB_JOBINDEX_STEP", "LSB_JOBINDEX_END", 1, "0"},
    {"JOB_COMPLETION_INDEX", nullptr, nullptr, nullptr, nullptr},  // Kubernetes
    {"PBS_ARRAY_INDEX", nullptr, nullptr, nullptr, nullptr},       // OpenPBS
    {"PBS_ARRAYID", nullptr, nullptr, nullptr, nullptr}};          // Torque

std::optional<std::int64_t> whole_number(const char* text) {
  std::int64_t value = 0;
  const char* const end = text + std::strlen(text);
  const auto [at, error] = std::from_chars(text, end, value);
  if (error != std::errc() || at != end || value < 0 || value > 1'000'000'000) return std::nullopt;
  return value;
}

bool is_set(const char* variable) { return std::getenv(variable) != nullptr; }

std::int64_t number_of(const char* variable) {
  const char* const text = std::getenv(variable);
  if (text == nullptr)
    throw InputError(fmt::format("{} is not set, but the variables beside it are", variable));
  const std::optional<std::int64_t> value = whole_number(text);
  if (!value) throw InputError(fmt::format("{}={}; expected a whole number", variable, text));
  return *value;
}

std::int64_t number_or(const char* variable, std::int64_t otherwise) {
  return variable == nullptr || !is_set(variable) ? otherwise : number_of(variable);
}

Worker checked(std::int64_t index, std::int64_t count, const char* variable) {
  if (index < 0 || index >= count)
    throw InputError(fmt::format("{} says number {} of {}; expected 0 to {}", variable, index,
                                 count, count - 1));
  return {index, count, variable};
}

Worker worker_of(const Variables& variables) {
  return checked(number_of(variables.index), number_of(variables.count), variables.index);
}

/// The position in the array's list of numbers, which may begin anywhere and have gaps.
Worker task_of(const Array& array) {
  const std::int64_t id = number_of(array.index),
                     first = number_or(array.first, array.first_number),
                     step = number_or(array.step, 1);
  if (step < 1 || (id - first) % step != 0)
    throw InputError(fmt::format(
        "{}={} is not {}{} and multiples of {}={}; expected an array like 0-99", array.index, id,
        array.first ? fmt::format("{}=", array.first) : "", first, array.step, step));
  std::int64_t count = 0;
  if (array.count != nullptr) {
    count = number_of(array.count);
  } else if (array.last != nullptr) {
    count = (number_of(array.last) - first) / step + 1;
  } else {
    if (!is_set(kOwn.count))
      throw InputError(fmt::format(
          "{}={} without the number of processes; expected {} to be set to it, or to 1 and {} to 0 "
          "if this process is alone",
          array.index, id, kOwn.count, kOwn.index));
    count = number_of(kOwn.count);
  }
  return checked((id - first) / step, count, array.index);
}

std::optional<Worker> array_worker() {
  for (const Array& array : kArrays) {
    const char* const text = std::getenv(array.index);
    if (text != nullptr && std::strcmp(text, array.none) != 0) return task_of(array);
  }
  return std::nullopt;
}

std::optional<Worker> process_worker() {
  for (const Variables& variables : kProcess)
    if (is_set(variables.index) && is_set(variables.count)) return worker_of(variables);
  return std::nullopt;
}

}  // namespace

Worker worker_from_environment() {
  if (is_set(kOwn.index)) return worker_of(kOwn);
  const std::optional<Worker> array = array_worker(), process = process_worker();
  if (!array) {
    if (is_set(kOwn.count) && !process)
      throw InputError(fmt::format("{} without {}; expected both", kOwn.count, kOwn.index));
    return process.value_or(Worker{});
  }
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

}  // namespace tangere
