// SPDX-License-Identifier: Apache-2.0
// tangere validate: reports everything that is wrong with a data set or an export.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/scene_run.hpp"
#include "engine/base/error.hpp"
#include "io/dataset/dataset_files.hpp"
#include "io/export/exported_set.hpp"

namespace tangere::apps {
namespace {

/// An export: the sums of its files.
int validate_export(const std::string& path, const ExportedSet& set, const Console& console) {
  if (set.stored.empty() && set.format != "csv")
    throw IoError(
        fmt::format("'{}' has no checksums of its files: an older version wrote it; "
                    "export the data set again",
                    path));
  std::vector<std::string> problems = damaged_files(set.folder, set.stored);
  if (set.format != "csv")
    for (std::string& problem : foreign_files(set.folder, set.stored))
      problems.push_back(std::move(problem));
  const ExitCode code = problems.empty() ? kDone : kInputOutput;
  for (const std::string& problem : problems) console.fail("tangere: " + problem);
  if (set.stored.empty())
    console.note(
        fmt::format("'{}.json' is missing, so nothing is known of the table's sums and "
                    "units",
                    path));
  console.print(
      fmt::format("{}, episodes: {}, frames: {}, files: {}, {} bytes: {}", set.title, set.episodes,
                  set.frames, set.files, set.bytes,
                  problems.empty() ? "whole" : fmt::format("{} problems", problems.size())));
  Json result{{"command", "validate"}, {"exit_code", static_cast<int>(code)},
              {"input", path},         {"format", set.format},
              {"problems", problems},  {"episodes", set.episodes},
              {"frames", set.frames},  {"files", set.files},
              {"bytes", set.bytes}};
  if (code != kDone) result["error"] = problems.front();
  console.result(result);
  return code;
}

int validate(const std::string& path, const Console& console) {
  if (const std::optional<ExportedSet> set = find_export(path))
    return validate_export(path, *set, console);
  const DatasetReport report = examine_dataset(find_dataset(path));
  const ExitCode code = report.problems.empty() ? kDone : kInputOutput;
  for (const std::string& problem : report.problems) console.fail("tangere: " + problem);
  console.print(fmt::format(
      "shards: {}, demos: {}, failed episodes: {}, rows: {}{}, {} bytes: {}", report.shards,
      report.demos, report.failed, report.rows, missed_text(report.steps), report.bytes,
      report.problems.empty() ? "whole" : fmt::format("{} problems", report.problems.size())));
  if (!report.has_label_sums)
    console.note(
        "an older version wrote it: labels of its episodes (return, success, randomized …) have no "
        "checksum");
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
  add_text(app, "DIR", *input, "",
           "Folder of shards, one file of a data set, or what 'tangere export' made of it")
      .required();
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return validate(*input, *console); },
          [] { return true; }};
}

}  // namespace tangere::apps
