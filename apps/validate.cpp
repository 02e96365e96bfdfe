// SPDX-License-Identifier: Apache-2.0
// tangere validate: reports everything that is wrong with a data set.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/scene_run.hpp"
#include "io/dataset/dataset_files.hpp"

namespace tangere::apps {
namespace {

int validate(const std::string& path, const Console& console) {
  const DatasetReport report = examine_dataset(find_dataset(path));
  const ExitCode code = report.problems.empty() ? kDone : kInputOutput;
  for (const std::string& problem : report.problems) console.fail("tangere: " + problem);
  console.print(fmt::format(
      "shards: {}, demos: {}, failed episodes: {}, rows: {}{}, {} bytes: {}", report.shards,
      report.demos, report.failed, report.rows, missed_text(report.steps), report.bytes,
      report.problems.empty() ? "whole" : fmt::format("{} problems", report.problems.size())));
  Json result{{"command", "validate"},
              {"exit_code", static_cast<int>(code)},
              {"input", path},
              {"problems", report.problems},
              {"shards_read", report.shards},
              {"demos", report.demos},
              {"failed_episodes", report.failed},
              {"rows", report.rows},
              {"bytes", report.bytes}};
  result.update(steps_json(report.steps));
  if (code != kDone) result["error"] = report.problems.front();
  console.result(result);
  return code;
}

}  // namespace

Command add_validate(CLI::App& program) {
  const auto input = std::make_shared<std::string>();
  const auto console = std::make_shared<Console>();
  CLI::App& app =
      add_command(program, "validate", "Read a data set whole and name all that is wrong with it",
                  "tangere validate balls");
  add_text(app, "DIR", *input, "", "Folder of shards, or one file of a data set").required();
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return validate(*input, *console); },
          [] { return true; }};
}

}  // namespace tangere::apps
