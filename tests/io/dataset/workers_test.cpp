// SPDX-License-Identifier: Apache-2.0
// Which share a process makes, from the variables of every scheduler and launcher that is known.
#include "io/dataset/workers.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using testing::HasSubstr;
using Variables = std::map<std::string, std::string>;

/// Sets variables and takes those of a scheduler that runs the tests away, until it is destroyed.
class Environment {
 public:
  explicit Environment(const Variables& set) {
    for (const char* name :
         {"TANGERE_WORKER", "TANGERE_WORKERS", "OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID",
          "SLURM_ARRAY_TASK_ID", "AWS_BATCH_JOB_ARRAY_INDEX", "SGE_TASK_ID", "LSB_JOBINDEX",
          "JOB_COMPLETION_INDEX", "PBS_ARRAY_INDEX", "PBS_ARRAYID"})
      change(name, nullptr);
    for (const auto& [name, value] : set) change(name, value.c_str());
  }
  ~Environment() {
    for (const auto& [name, value] : before_)
      value ? setenv(name.c_str(), value->c_str(), 1) : unsetenv(name.c_str());
  }
  Environment(const Environment&) = delete;
  Environment& operator=(const Environment&) = delete;

 private:
  void change(const std::string& name, const char* value) {
    const char* const old = std::getenv(name.c_str());
    before_.emplace(name, old ? std::optional<std::string>(old) : std::nullopt);
    value ? setenv(name.c_str(), value, 1) : unsetenv(name.c_str());
  }

  std::map<std::string, std::optional<std::string>> before_;
};

struct Row {
  const char* launcher;
  Variables variables;
  std::int64_t index, count;
  const char* source;
};

TEST(Workers, AreReadFromTheVariablesOfEveryLauncher) {
  const std::vector<Row> rows{
      {"alone", {}, 0, 1, ""},
      {"Open MPI",
       {{"OMPI_COMM_WORLD_RANK", "2"}, {"OMPI_COMM_WORLD_SIZE", "4"}},
       2,
       4,
       "OMPI_COMM_WORLD_RANK"},
      {"PMI", {{"PMI_RANK", "1"}, {"PMI_SIZE", "3"}}, 1, 3, "PMI_RANK"},
      {"srun", {{"SLURM_PROCID", "5"}, {"SLURM_STEP_NUM_TASKS", "6"}}, 5, 6, "SLURM_PROCID"},
      {"sbatch without srun", {{"SLURM_PROCID", "0"}, {"SLURM_NTASKS", "6"}}, 0, 1, ""},
      {"Slurm array 4-10:2",
       {{"SLURM_ARRAY_TASK_ID", "8"},
        {"SLURM_ARRAY_TASK_COUNT", "4"},
        {"SLURM_ARRAY_TASK_MIN", "4"},
        {"SLURM_ARRAY_TASK_STEP", "2"}},
       2,
       4,
       "SLURM_ARRAY_TASK_ID"},
      {"srun in each task of an array",
       {{"SLURM_ARRAY_TASK_ID", "1"},
        {"SLURM_ARRAY_TASK_COUNT", "3"},
        {"SLURM_PROCID", "1"},
        {"SLURM_STEP_NUM_TASKS", "2"}},
       3,
       6,
       "SLURM_ARRAY_TASK_ID and SLURM_PROCID"},
      {"mpirun within srun",
       {{"OMPI_COMM_WORLD_RANK", "3"},
        {"OMPI_COMM_WORLD_SIZE", "4"},
        {"SLURM_PROCID", "0"},
        {"SLURM_STEP_NUM_TASKS", "1"}},
       3,
       4,
       "OMPI_COMM_WORLD_RANK"},
      {"AWS Batch array",
       {{"AWS_BATCH_JOB_ARRAY_INDEX", "7"}, {"AWS_BATCH_JOB_ARRAY_SIZE", "10"}},
       7,
       10,
       "AWS_BATCH_JOB_ARRAY_INDEX"},
      {"Kubernetes indexed job",
       {{"JOB_COMPLETION_INDEX", "3"}, {"TANGERE_WORKERS", "8"}},
       3,
       8,
       "JOB_COMPLETION_INDEX"},
      {"OpenPBS array 0-4",
       {{"PBS_ARRAY_INDEX", "4"}, {"TANGERE_WORKERS", "5"}},
       4,
       5,
       "PBS_ARRAY_INDEX"},
      {"Torque array 0-4", {{"PBS_ARRAYID", "0"}, {"TANGERE_WORKERS", "5"}}, 0, 5, "PBS_ARRAYID"},
      {"Grid Engine -t 1-9:2",
       {{"SGE_TASK_ID", "7"},
        {"SGE_TASK_FIRST", "1"},
        {"SGE_TASK_LAST", "9"},
        {"SGE_TASK_STEPSIZE", "2"}},
       3,
       5,
       "SGE_TASK_ID"},
      {"Grid Engine without an array", {{"SGE_TASK_ID", "undefined"}}, 0, 1, ""},
      {"LSF array [1-6]",
       {{"LSB_JOBINDEX", "6"}, {"LSB_JOBINDEX_END", "6"}, {"LSB_JOBINDEX_STEP", "1"}},
       5,
       6,
       "LSB_JOBINDEX"},
      {"LSF without an array", {{"LSB_JOBINDEX", "0"}}, 0, 1, ""},
      {"own variables before all others",
       {{"TANGERE_WORKER", "0"}, {"TANGERE_WORKERS", "1"}, {"JOB_COMPLETION_INDEX", "3"}},
       0,
       1,
       "TANGERE_WORKER"},
  };
  for (const Row& row : rows) {
    const Environment environment(row.variables);
    const Worker worker = worker_from_environment();
    EXPECT_EQ(worker.index, row.index) << row.launcher;
    EXPECT_EQ(worker.count, row.count) << row.launcher;
    EXPECT_EQ(worker.source, row.source) << row.launcher;
  }
}

TEST(Workers, MistakesNameTheVariable) {
  const std::vector<std::pair<Variables, const char*>> mistakes{
      {{{"JOB_COMPLETION_INDEX", "3"}},
       "JOB_COMPLETION_INDEX=3 without the number of processes; expected TANGERE_WORKERS to be set "
       "to it, or to 1 and TANGERE_WORKER to 0 if this process is alone"},
      {{{"JOB_COMPLETION_INDEX", "8"}, {"TANGERE_WORKERS", "8"}},
       "JOB_COMPLETION_INDEX says number 8 of 8; expected 0 to 7"},
      {{{"PBS_ARRAY_INDEX", "x"}, {"TANGERE_WORKERS", "8"}},
       "PBS_ARRAY_INDEX=x; expected a whole number"},
      {{{"AWS_BATCH_JOB_ARRAY_INDEX", "0"}}, "AWS_BATCH_JOB_ARRAY_SIZE is not set"},
      {{{"SGE_TASK_ID", "2"}}, "SGE_TASK_LAST is not set"},
      {{{"SGE_TASK_ID", "2"}, {"SGE_TASK_FIRST", "1"}, {"SGE_TASK_STEPSIZE", "2"}},
       "SGE_TASK_ID=2 is not SGE_TASK_FIRST=1 and multiples of SGE_TASK_STEPSIZE=2"},
      {{{"LSB_JOBINDEX", "9"}, {"LSB_JOBINDEX_END", "6"}},
       "LSB_JOBINDEX says number 8 of 6; expected 0 to 5"},
      {{{"TANGERE_WORKERS", "4"}}, "TANGERE_WORKERS without TANGERE_WORKER; expected both"},
      {{{"TANGERE_WORKER", "4"}}, "TANGERE_WORKERS is not set"},
  };
  for (const auto& [variables, message] : mistakes) {
    const Environment environment(variables);
    try {
      static_cast<void>(worker_from_environment());
      ADD_FAILURE() << message;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr(message));
    }
  }
}

}  // namespace
}  // namespace tangere
