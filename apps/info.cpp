// SPDX-License-Identifier: Apache-2.0
// tangere info: describes a data set or a trajectory without reading its numbers.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/scene_run.hpp"
#include "io/dataset/dataset_files.hpp"
#include "io/export/exported_set.hpp"
#include "io/trajectory/trajectory_reader.hpp"

namespace tangere::apps {
namespace {

constexpr std::size_t kLongValue = 200;  // bytes; only --json shows longer settings

/// A trajectory: its channels.
int info_of_run(const std::string& path, const TrajectorySummary& run, const Console& console) {
  Json settings = Json::object(), channels = Json::array();
  std::string text = "settings\n";
  for (const auto& [name, value] : run.settings) {
    settings[name] = value;
    if (value.size() <= kLongValue) text += fmt::format("  {}: {}\n", name, value);
  }
  text += "channels: rows, then the shape of a row\n";
  for (const Channel& channel : run.channels) {
    const std::string shape = fmt::format("{}", fmt::join(channel.shape, ", ")),
                      units = fmt::format("{}", fmt::join(channel.units, ", "));
    text += fmt::format("  {} {} ({}){}\n", channel.name, channel.rows, shape,
                        units.empty() || units.size() > kLongValue ? "" : " [" + units + "]");
    channels.push_back({{"name", channel.name},
                        {"rows", channel.rows},
                        {"shape", channel.shape},
                        {"names", channel.names},
                        {"units", channel.units},
                        {"frame", channel.frame},
                        {"meaning", channel.meaning}});
  }
  console.print(text + fmt::format("{} bytes", std::filesystem::file_size(path)));
  console.result({{"command", "info"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"input", path},
                  {"settings", settings},
                  {"channels", channels}});
  return kDone;
}

/// An export: its arrays.
int info_of_export(const std::string& path, const ExportedSet& set, const Console& console) {
  Json arrays = Json::array();
  std::string text = fmt::format("{}: {}\n", set.format, set.title);
  if (!set.command.empty())
    text += fmt::format("made of: {}\nby Tangere {}\n", set.command, set.tangere_version);
  if (set.seconds_per_frame > 0) text += fmt::format("a frame lasts {} s\n", set.seconds_per_frame);
  text += "arrays: the shape of a frame\n";
  for (const ExportedArray& array : set.arrays) {
    text += fmt::format("  {} ({}) {}{}\n", array.name, fmt::join(array.shape, ", "), array.type,
                        array.unit.empty() ? "" : " [" + array.unit + "]");
    arrays.push_back(
        {{"name", array.name}, {"type", array.type}, {"shape", array.shape}, {"unit", array.unit}});
  }
  console.print(text + fmt::format("episodes: {}, frames: {}, files: {}, {} bytes", set.episodes,
                                   set.frames, set.files, set.bytes));
  console.result({{"command", "info"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"input", path},
                  {"format", set.format},
                  {"title", set.title},
                  {"made_of", set.command},
                  {"tangere_version", set.tangere_version},
                  {"episodes", set.episodes},
                  {"frames", set.frames},
                  {"seconds_per_frame", set.seconds_per_frame},
                  {"files", set.files},
                  {"bytes", set.bytes},
                  {"arrays", arrays}});
  return kDone;
}

int info(const std::string& path, const Console& console) {
  if (const std::optional<ExportedSet> set = find_export(path))
    return info_of_export(path, *set, console);
  if (std::filesystem::is_regular_file(path))
    if (const std::optional<TrajectorySummary> run = summarise_trajectory(path))
      return info_of_run(path, *run, console);
  const DatasetFiles dataset = find_dataset(path);
  const DatasetSummary summary = summarise(dataset);
  Json settings = Json::object(), shapes = Json::object();
  std::string text;
  for (const Setting& setting : dataset.settings) {
    settings[setting.name] = setting.value;
    if (setting.value.size() <= kLongValue && setting.name.find('/') == std::string::npos)
      text += fmt::format("  {}: {}\n", setting.name, setting.value);
  }
  text += "datasets of a demo\n";
  for (const auto& [name, shape] : summary.shapes) {
    shapes[name] = shape;
    text += fmt::format("  {} {}\n", name, shape);
  }
  text +=
      fmt::format("files: {}, demos: {}, failed episodes: {}, rows: {}, {} bytes",
                  dataset.files.size(), summary.demos, summary.failed, summary.rows, summary.bytes);
  if (summary.has_success) text += fmt::format(", episodes solved: {}", summary.successes);
  text += missed_text(summary.steps);
  console.print("settings\n" + text);
  for (const std::string& file : dataset.missing) console.note("missing: " + file);
  Json result{{"command", "info"},
              {"exit_code", static_cast<int>(kDone)},
              {"input", path},
              {"files", dataset.files},
              {"missing", dataset.missing},
              {"demos", summary.demos},
              {"failed_episodes", summary.failed},
              {"rows", summary.rows},
              {"bytes", summary.bytes},
              {"successes", summary.has_success ? Json(summary.successes) : Json()}};
  result.update(steps_json(summary.steps));
  result.update({{"settings", settings}, {"datasets", shapes}});
  console.result(result);
  return kDone;
}

}  // namespace

Command add_info(CLI::App& program) {
  const auto input = std::make_shared<std::string>();
  const auto console = std::make_shared<Console>();
  CLI::App& app = add_command(program, "info",
                              "Say what a data set, an export or a trajectory holds: settings, "
                              "shapes, counts",
                              "tangere info balls");
  add_text(app, "DIR", *input, "",
           "Folder of shards, one file of a data set, what 'tangere export' made of it, or a file "
           "of 'tangere simulate'")
      .required();
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return info(*input, *console); }, [] { return true; }};
}

}  // namespace tangere::apps
