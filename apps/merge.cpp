// SPDX-License-Identifier: Apache-2.0
// tangere merge: one file for a folder of shards, and the view that Minari reads.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/run_options.hpp"
#include "apps/scene_run.hpp"
#include "apps/stop_signals.hpp"
#include "engine/base/error.hpp"
#include "io/dataset/dataset_merge.hpp"
#include "io/files/folder_lock.hpp"

namespace tangere::apps {
namespace {

int merge(const std::string& path, MergeOptions options, const Console& console) {
  const StopSignals signals;  // before anything is written and until it is gone or complete
  // Alone: processes that replace shards share the folder, and would mix them in meanwhile.
  std::optional<FolderLock> lock;
  if (std::filesystem::is_directory(path)) lock.emplace(path);
  if (lock && !lock->take(FolderLock::Kind::alone))
    throw IoError(
        fmt::format("cannot merge '{}': another process writes shards there or merges them; "
                    "expected a folder that "
                    "nobody writes into, merge when it has ended",
                    path));
  options.stop = [&] { return signals.received() != 0; };
  const MergeResult result = merge_dataset(find_dataset(path), options);
  if (result.stopped) return report_stop(console, "merge", signals.received(), "while it merged");
  console.print(fmt::format(
      "wrote {} ({} bytes, {}): {} demos, {} to train on and {} to validate{}; failed episodes: "
      "{}{}",
      result.file, result.bytes, options.copy ? "a copy of all numbers" : "links to the shards",
      result.demos, result.train, result.valid,
      result.touching ? fmt::format(", {} that feel something", *result.touching) : "",
      result.failed, missed_text(result.steps)));
  if (!result.minari.empty())
    console.print(fmt::format("wrote {}: {} for Minari", result.minari, result.minari_id));
  if (!result.minari_left_out.empty())
    console.note(fmt::format("too large for Minari, or JPEG files, so it does not show them: {}",
                             fmt::join(result.minari_left_out, ", ")));
  Json keys{{"command", "merge"},
            {"exit_code", static_cast<int>(kDone)},
            {"input", path},
            {"output", result.file},
            {"bytes", result.bytes},
            {"copy", options.copy},
            {"minari", result.minari.empty() ? Json() : Json(result.minari)},
            {"minari_id", result.minari.empty() ? Json() : Json(result.minari_id)},
            {"demos", result.demos},
            {"train", result.train},
            {"valid", result.valid},
            {"successes", result.successes ? Json(*result.successes) : Json()},
            {"touching", result.touching ? Json(*result.touching) : Json()},
            {"failed_episodes", result.failed}};
  keys.update(steps_json(result.steps));
  console.result(keys);
  return kDone;
}

}  // namespace

Command add_merge(CLI::App& program) {
  const auto input = std::make_shared<std::string>();
  const auto options = std::make_shared<MergeOptions>();
  const auto console = std::make_shared<Console>();
  CLI::App& app =
      add_command(program, "merge", "Show a folder of shards as one file, and to Minari",
                  "tangere merge balls --overwrite");
  add_text(app, "DIR", *input, "", "Folder with all shards of a data set").required();
  add_flag(app, "--copy", options->copy,
           "Copy all numbers into the file, which then needs no shards beside it [default: links]");
  add_overwrite_option(app, options->overwrite, "Replace what an earlier merge wrote");
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return merge(*input, *options, *console); },
          [] { return true; }};
}

}  // namespace tangere::apps
