// SPDX-License-Identifier: Apache-2.0
// tangere view: a page on which a trajectory or a data set moves.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/export_format.hpp"
#include "apps/run_options.hpp"
#include "engine/base/error.hpp"
#include "io/export/exported_set.hpp"
#include "io/files/part_file.hpp"
#include "io/hdf5/reading_note.hpp"
#include "io/view/view_page.hpp"
#include "io/view/view_reader.hpp"

namespace tangere::apps {
namespace {

constexpr int kMostEpisodes = 10'000, kMostFrames = 100'000;

struct ViewArguments {
  std::string input, output;
  ViewOptions what;
  std::optional<int> episodes, frames;
  bool overwrite = false;
};

/// Replaces this process by the Python package, which has the libraries of the formats, if the
/// input is an export.
void view_if_export(const ViewArguments& options, const Console& console) {
  const std::optional<ExportedSet> set = find_export(options.input);
  if (!set) return;
  if (set->format == "csv")
    throw InputError(
        fmt::format("'{}' is a table, which has no scene; expected a data set, or an "
                    "export of another format",
                    options.input));
  std::vector<std::string> words{options.input, "--output", options.output};
  const auto add = [&](const char* name, const auto& value) {
    if (value) words.insert(words.end(), {name, std::to_string(*value)});
  };
  add("--episode", options.what.episode);
  add("--episodes", options.episodes);
  add("--frames", options.frames);
  if (!options.what.scene.empty()) words.insert(words.end(), {"--scene", options.what.scene});
  if (options.overwrite) words.emplace_back("--overwrite");
  const h5::NotReading computing;  // else the timer of calls of HDF5 would end Python
  run_python("tangere._view_export", "view", words, console);
}

int view(const ViewArguments& options, const Console& console) {
  view_if_export(options, console);
  ViewOptions what = options.what;
  what.episodes = options.episodes.value_or(what.episodes);
  what.frames = options.frames.value_or(what.frames);
  const ViewData data = read_view(options.input, what);
  const std::string page = render_view_page(data);
  write_text_atomically(options.output, page, options.overwrite);
  std::size_t frames = 0;
  std::vector<std::string> sensors;
  for (const ViewEpisode& episode : data.episodes) frames += episode.rows.size();
  for (const ViewSensor& sensor : data.sensors) sensors.push_back(sensor.name);
  console.print(fmt::format("wrote {} ({:.1f} MB): {} {}, {} frames; open it in a browser",
                            options.output, static_cast<double>(page.size()) / 1e6,
                            data.episodes.size(),
                            data.kind == "trajectory" ? "environments" : "episodes", frames));
  if (data.stride > 1)
    console.note(fmt::format("one frame for every {} rows of the file", data.stride));
  for (const std::string& note : data.notes) console.note(note);
  console.result({{"command", "view"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"input", options.input},
                  {"output", options.output},
                  {"bytes", page.size()},
                  {"kind", data.kind},
                  {"episodes", data.episodes.size()},
                  {"frames", frames},
                  {"stride", data.stride},
                  {"sensors", sensors},
                  {"notes", data.notes}});
  return kDone;
}

}  // namespace

Command add_view(CLI::App& program) {
  const auto options = std::make_shared<ViewArguments>();
  const auto console = std::make_shared<Console>();
  ViewArguments& o = *options;
  CLI::App& app =
      add_command(program, "view", "Write a page on which a trajectory or data set moves",
                  "tangere view ball.h5 -o ball.html");
  add_text(app, "FILE", o.input, "",
           "HDF5 file of 'tangere simulate', folder or file of a data set, or what 'tangere "
           "export' made of it")
      .required();
  add_text(app, "-o,--output", o.output, "F.html", "Page to write").required();
  const AddedOption episode =
      add_whole_number<std::int64_t>(app, "--episode", o.what.episode, 0, 1'000'000'000,
                                     "That episode alone; of a trajectory, that environment");
  add_whole_number<int>(app, "--episodes", o.episodes, 1, kMostEpisodes,
                        "The first N episodes [default: 16]")
      .excludes(episode);
  add_whole_number<int>(
      app, "--frames", o.frames, 2, kMostFrames,
      "Most frames of an episode; a page has at most 50 MB of them [default: 1000]");
  add_text(app, "--scene", o.what.scene, "SCENE.xml",
           "Scene beside which the files named in it lie [default: the simulated one]");
  add_overwrite_option(app, o.overwrite);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return view(*options, *console); }, [] { return true; }};
}

}  // namespace tangere::apps
