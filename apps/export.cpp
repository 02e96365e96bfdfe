// SPDX-License-Identifier: Apache-2.0
// tangere export: a data set in a format of learners, or its rows as a table.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/export_format.hpp"
#include "apps/run_options.hpp"
#include "engine/base/error.hpp"
#include "io/dataset/dataset_export.hpp"

namespace tangere::apps {
namespace {

struct ExportArguments {
  std::string input, folder, table;  ///< OUT, F.csv
  ExportOptions what;
  FormatOptions format;
};

/// The table to write; empty if a format is to be written. Reports options that do not go together.
std::string table_of(const ExportArguments& options) {
  const FormatOptions& format = options.format;
  if (options.table.empty() == options.folder.empty())
    throw InputError("expected OUT with --to FORMAT, or --csv F.csv");
  if (!options.folder.empty() && format.to.empty())
    throw InputError(fmt::format(
        "{} without --to; expected --to lerobot, zarr, ftp1, univtac or csv", options.folder));
  if (!options.table.empty() && !format.to.empty())
    throw InputError(fmt::format("--to {} with --csv; expected one of them", format.to));
  const bool is_table = !options.table.empty() || format.to == "csv";
  if (is_table && !format.given().empty())
    throw InputError(fmt::format("{} of a table; expected another format", format.given()));
  if (!is_table && options.what.episode)
    throw InputError(fmt::format("--episode {} with --to {}; expected --mask or all episodes",
                                 *options.what.episode, format.to));
  return is_table ? options.table + options.folder : "";
}

int export_table(const ExportArguments& options, const std::string& output,
                 const Console& console) {
  const ExportResult result = export_csv(find_dataset(options.input), output, options.what);
  console.print(
      fmt::format("wrote {}: {} rows of {} columns", output, result.rows, result.columns));
  if (!result.left_out.empty())
    console.note(fmt::format("too wide for a table or not in every row, left out: {}",
                             fmt::join(result.left_out, ", ")));
  console.result({{"command", "export"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"input", options.input},
                  {"output", output},
                  {"rows", result.rows},
                  {"columns", result.columns},
                  {"left_out", result.left_out}});
  return kDone;
}

int export_data(const ExportArguments& options, const Console& console) {
  const std::string table = table_of(options);
  if (!table.empty()) return export_table(options, table, console);
  export_by_python(options.input, options.folder, options.what.overwrite, options.format, console);
}

}  // namespace

Command add_export(CLI::App& program) {
  const auto options = std::make_shared<ExportArguments>();
  const auto console = std::make_shared<Console>();
  ExportArguments& o = *options;
  CLI::App& app =
      add_command(program, "export", "Write a data set in a format of learners, or as a table",
                  "tangere export balls --csv balls.csv --episode 3");
  add_text(app, "DIR", o.input, "", "Folder of shards, or one file of a data set").required();
  add_text(app, "OUT", o.folder, "", "Folder to write with --to");
  add_text(app, "--to", o.format.to, "FORMAT",
           "Format of OUT: lerobot, zarr, ftp1, univtac, or csv, which is --csv OUT");
  add_text(app, "--csv", o.table, "F.csv", "Table to write");
  add_whole_number<std::int64_t>(app, "--episode", o.what.episode, 0, 1'000'000'000,
                                 "Of a table: that episode alone [default: all]");
  add_overwrite_option(app, o.what.overwrite);
  add_format_options(app, o.format);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return export_data(*options, *console); },
          [options] { return options->format.to.empty() || options->format.to == "csv"; }};
}

}  // namespace tangere::apps
