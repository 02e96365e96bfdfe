// SPDX-License-Identifier: Apache-2.0
// Starts the Python package for the formats of learners.
#include "apps/export_format.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <vector>

#include "apps/arguments.hpp"
#include "engine/base/error.hpp"
#include "io/files/nearest_name.hpp"

namespace tangere::apps {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

const Words kFormats{"lerobot", "zarr", "ftp1", "univtac"};

// argv[1] is the folder of a package beside the program, or empty; argv[2] is the module, argv[3]
// the subcommand that it serves. A missing package is the world's mistake, so the code is 3.
constexpr const char* kStart = R"(
import importlib, importlib.util, json, os, signal, sys
place, module, command, words = sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4:]
sys.argv = [f"tangere {command}", *words]
if place:
    sys.path.insert(0, place)
def missing(name, package):
    what = "--to" if command == "export" else "an export"
    text = f"{what} needs the Python package {name}, which {sys.executable} does not have; "
    text += f"expected it from `{sys.executable} -m pip install {package}`, "
    text += "or another TANGERE_PYTHON"
    if name == "tangere":
        text += ". Run it in the folder of Tangere's sources"
    if "--json" in words:
        print(json.dumps({"command": command, "exit_code": 3, "error": text}))
    print(f"tangere {command}: {text}", file=sys.stderr)
    sys.exit(3)
def stop(*_):
    print(f"tangere {command}: stopped", file=sys.stderr, flush=True)
    os._exit(130)
before = signal.getsignal(signal.SIGINT)
if before != signal.SIG_IGN:
    signal.signal(signal.SIGINT, stop)
if importlib.util.find_spec("tangere") is None:
    missing("tangere", "'.[data]'")
try:
    main = importlib.import_module(module).main
except ModuleNotFoundError as error:
    missing(error.name, {"PIL": "pillow"}.get(error.name, error.name))
signal.signal(signal.SIGINT, before)
sys.exit(main(words, prog=f"tangere {command}"))
)";

/// Where a build and a wheel have the package: build/release/python, and the folder in which the
/// package is whose bin/ has the program. Empty if neither has.
std::string package_beside_program() {
  std::error_code none;
  const fs::path program = fs::read_symlink("/proc/self/exe", none);
  const fs::path folder = program.parent_path();
  for (const fs::path& place : {folder / "python", folder.parent_path().parent_path()})
    if (!program.empty() && fs::exists(place / "tangere" / "export.py", none))
      return place.string();
  return "";
}

void add_words(Words& words, const char* flag, const std::string& value) {
  if (!value.empty()) words.insert(words.end(), {flag, value});
}

void add_words(Words& words, const char* flag, const std::optional<std::int64_t>& value) {
  if (value) words.insert(words.end(), {flag, std::to_string(*value)});
}

void add_words(Words& words, const char* flag, bool given) {
  if (given) words.emplace_back(flag);
}

Words words_of(const FormatOptions& options) {
  Words words;
  add_words(words, "--mask", options.mask);
  add_words(words, "--only-success", options.only_success);
  add_words(words, "--window", options.window);
  add_words(words, "--workers", options.workers);
  add_words(words, "--resume", options.resume);
  add_words(words, "--privileged", options.privileged);
  add_words(words, "--touch", options.touch);
  add_words(words, "--pictures", options.pictures);
  add_words(words, "--task", options.task);
  add_words(words, "--fps", options.fps);
  add_words(words, "--license", options.license);
  add_words(words, "--joints", options.joints);
  add_words(words, "--hand", options.hand);
  add_words(words, "--side", options.side);
  add_words(words, "--sensor", options.sensor);
  return words;
}

}  // namespace

std::string FormatOptions::given() const {
  const Words words = words_of(*this);
  return words.empty() ? "" : words.front();
}

void add_format_options(CLI::App& app, FormatOptions& o) {
  constexpr std::int64_t kMany = 1'000'000;
  start_group(app, "With --to lerobot, zarr, ftp1 or univtac");
  add_text(app, "--mask", o.mask, "NAME", "Write the episodes of this mask alone, such as train");
  add_flag(app, "--only-success", o.only_success, "Write solved episodes alone");
  add_whole_number<std::int64_t>(app, "--window", o.window, 1, kMany,
                                 "Rows of a frame: touch becomes (N, ...), the newest row last "
                                 "[default: 1]");
  add_whole_number<std::int64_t>(app, "--workers", o.workers, 1, kMostThreads,
                                 "Processes; they change no byte [default: one a core]");
  add_flag(app, "--resume", o.resume, "Go on with a run that was stopped or killed");
  add_flag(app, "--privileged", o.privileged, "Also write what a robot could not measure");
  add_text(app, "--touch", o.touch, "FORM",
           "lerobot: fields of sensors as its policies read them: state (numbers of "
           "observation.environment_state) or image (pictures)");
  add_text(app, "--pictures", o.pictures, "FORM",
           "lerobot: pictures in rows (image) or as video (video) [default: image]");
  add_text(app, "--task", o.task, "TEXT", "Text of the task for language policies");
  add_whole_number<std::int64_t>(app, "--fps", o.fps, 1, kMany,
                                 "lerobot: frames a second [default: actions a second, rounded]");
  add_text(app, "--license", o.license, "NAME", "lerobot: of the data, named in README.md");
  add_text(app, "--joints", o.joints, "NAMES",
           "ftp1, univtac: coordinates of the arm, as q_names has them, with commas");
  add_text(
      app, "--hand", o.hand, "NAME=SLOT",
      "ftp1: coordinates of the hand with FTP-1's numbers of joints, with commas; one alone is "
      "a gripper, 28");
  add_text(app, "--side", o.side, "SIDE",
           "ftp1: hand that carries the sensors, left or right [default: right]");
  add_text(app, "--sensor", o.sensor, "NAME",
           "ftp1: name of the sensors in the data [default: tangere]");
}

void export_by_python(const std::string& input, const std::string& output, bool overwrite,
                      const FormatOptions& options, const Console& console) {
  if (std::find(kFormats.begin(), kFormats.end(), options.to) == kFormats.end()) {
    Words known = kFormats;
    known.emplace_back("csv");
    throw InputError(
        fmt::format("unknown format '{}'{}", options.to, suggestion(options.to, known)));
  }
  Words words{input, output, "--to", options.to};
  const Words more = words_of(options);
  words.insert(words.end(), more.begin(), more.end());
  add_words(words, "--overwrite", overwrite);
  run_python("tangere.export", "export", words, console);
}

void run_python(const std::string& module, const std::string& command,
                const std::vector<std::string>& arguments, const Console& console) {
  const char* const chosen = std::getenv("TANGERE_PYTHON");
  const std::string python = chosen != nullptr && *chosen != '\0' ? chosen : "python3";
  Words words{python, "-c", kStart, package_beside_program(), module, command};
  words.insert(words.end(), arguments.begin(), arguments.end());
  add_words(words, "--quiet", console.quiet);
  add_words(words, "--json", console.json);
  std::vector<char*> raw;
  for (std::string& word : words) raw.push_back(word.data());
  raw.push_back(nullptr);
  execvp(python.c_str(), raw.data());
  throw IoError(
      fmt::format("{} needs Python, and '{}' cannot be started: {}; expected it on PATH, or "
                  "TANGERE_PYTHON to name it",
                  command == "export" ? "--to" : "an export", python, std::strerror(errno)));
}

}  // namespace tangere::apps
