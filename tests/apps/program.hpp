// SPDX-License-Identifier: Apache-2.0
// Runs the built program in a folder of its own, as a user would: arguments in; exit code, output
// and files out.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

namespace tangere::apps {

using Words = std::vector<std::string>;
inline Words operator+(Words first, const Words& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

/// Words that a subcommand refuses, with what it ends and says.
struct Refusal {
  const char* name;
  Words words;
  int exit_code;
  const char* message;
};
inline void PrintTo(const Refusal& refusal, std::ostream* out) { *out << refusal.name; }

/// A folder for one test, deleted at its end. `path("a.h5")` is the path of a file in it.
class Folder {
 public:
  Folder();
  ~Folder();
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  [[nodiscard]] std::string path(const std::string& name = "") const { return root_ / name; }
  /// Names of the files in the folder, sorted.
  [[nodiscard]] std::vector<std::string> files() const;
  std::string write(const std::string& name, const std::string& text) const;
  [[nodiscard]] std::string read(const std::string& name) const;

 private:
  std::filesystem::path root_;
};

struct Outcome {
  int exit_code = -1;  ///< -1: ended by a signal
  int signal = 0;      ///< that ended it
  std::string out, err;
};

/// Destinations of the program's streams; "": the outcome.
struct Streams {
  std::string out, err;
};

/// A limit of the program alone (setrlimit).
struct Limit {
  int resource;  ///< RLIMIT_…
  std::uintmax_t value;
};

/// Runs `tangere ARGUMENTS` with the folder as its current one.
class Program {
 public:
  /// Starts it. `environment`: "NAME=value", added to this process's own. `limit`: of the program.
  Program(const Folder& folder, const Words& arguments,
          const std::vector<std::string>& environment = {}, const Streams& streams = {},
          const std::optional<Limit>& limit = {});
  ~Program();
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  void send(int signal) const;
  [[nodiscard]] Outcome wait();

 private:
  std::filesystem::path scratch_;  // for stdout and stderr, outside the folder that tests inspect
  pid_t process_ = -1;
};

/// Returns the text of docs/command.md about a subcommand, with what all of them share.
const std::string& page_of(const std::string& subcommand);

/// Runs it to its end.
Outcome run(const Folder& folder, const Words& arguments,
            const std::vector<std::string>& environment = {}, const Streams& streams = {},
            const std::optional<Limit>& limit = {});

/// The subcommands that `tangere --help` lists.
Words subcommands();

/// Names of an object's keys that docs/command.md does not mention, nested ones included.
std::vector<std::string> undocumented_keys(const nlohmann::json& object);

/// Runs `tangere WORDS --json` and returns the object that it prints. Expects it to name the
/// subcommand and the exit code, and to have only documented keys.
nlohmann::json run_json(const Folder& folder, const Words& words, int exit_code = 0);

/// Largest memory of any program that this one has started [bytes].
double peak_memory();

/// Path of a scene of the project.
std::string scene(const std::string& name);

}  // namespace tangere::apps
