// SPDX-License-Identifier: Apache-2.0
// Rates are over episodes that did not fail.
#include "apps/task_report.hpp"

#include <fmt/format.h>

namespace tangere::apps {

TaskReport report_of(const Task& task, PolicyKind kind, const std::string& player,
                     const TaskResult& result) {
  const bool any = result.played > 0;
  TaskReport report;
  report.keys = {{"task", task.spec().name},
                 {"policy", to_string(kind)},
                 {"successes", result.successes},
                 {"success_rate", any ? Json(static_cast<double>(result.successes) /
                                             static_cast<double>(result.played))
                                      : Json()},
                 {"mean_return", any ? Json(result.mean_return) : Json()}};
  report.line =
      fmt::format("task {}, policy {}: {} of {} episodes solved, mean return {:.4g}",
                  task.spec().name, player, result.successes, result.played, result.mean_return);
  return report;
}

}  // namespace tangere::apps
