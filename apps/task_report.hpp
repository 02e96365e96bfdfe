// SPDX-License-Identifier: Apache-2.0
// Output of commands that write a file about the task of the run.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/console.hpp"
#include "tasks/run/policy.hpp"

namespace tangere::apps {

/// Keys of the JSON object and a line for people.
struct TaskReport {
  Json keys{{"task", nullptr}};
  std::string line = "no task: every reward is 0";
};

/// How a task went.
struct TaskResult {
  std::int64_t played = 0;  ///< episodes that did not fail
  std::int64_t successes = 0;
  double mean_return = 0;  ///< over those played
};

/// `player`: the policy for people. Without an episode played, rate and return are null.
TaskReport report_of(const Task& task, PolicyKind kind, const std::string& player,
                     const TaskResult& result);

}  // namespace tangere::apps
