// SPDX-License-Identifier: Apache-2.0
// tangere export: rows of a data set as a table.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/run_options.hpp"
#include "io/dataset/dataset_export.hpp"

namespace tangere::apps {
namespace {

struct ExportArguments {
  std::string input, output;
  ExportOptions what;
};

int export_table(const ExportArguments& options, const Console& console) {
  const ExportResult result = export_csv(find_dataset(options.input), options.output, options.what);
  console.print(
      fmt::format("wrote {}: {} rows of {} columns", options.output, result.rows, result.columns));
  if (!result.left_out.empty())
    console.note(fmt::format("too wide for a table or not in every row, left out: {}",
                             fmt::join(result.left_out, ", ")));
  console.result({{"command", "export"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"input", options.input},
                  {"output", options.output},
                  {"rows", result.rows},
                  {"columns", result.columns},
                  {"left_out", result.left_out}});
  return kDone;
}

}  // namespace

Command add_export(CLI::App& program) {
  const auto options = std::make_shared<ExportArguments>();
  const auto console = std::make_shared<Console>();
  ExportArguments& o = *options;
  CLI::App& app = add_command(program, "export", "Write rows of a data set as a table",
                              "tangere export balls --csv balls.csv --episode 3");
  add_text(app, "DIR", o.input, "", "Folder of shards, or one file of a data set").required();
  add_text(app, "--csv", o.output, "F.csv", "Table to write").required();
  add_whole_number<std::int64_t>(app, "--episode", o.what.episode, 0, 1'000'000'000,
                                 "That episode alone [default: all]");
  add_overwrite_option(app, o.what.overwrite);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return export_table(*options, *console); },
          [] { return true; }};
}

}  // namespace tangere::apps
