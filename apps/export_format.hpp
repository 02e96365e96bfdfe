// SPDX-License-Identifier: Apache-2.0
// Hands `tangere export --to FORMAT` over to the Python package, which has the libraries of the
// formats.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/command.hpp"
#include "apps/console.hpp"

namespace CLI {
class App;
}

namespace tangere::apps {

/// Options of formats. Text is empty and numbers are absent if an option is not given.
struct FormatOptions {
  std::string to, mask, touch, pictures, task, license, joints, hand, side, sensor;
  bool only_success = false, resume = false, privileged = false;
  std::optional<std::int64_t> window, workers, fps;

  /// The first option that is given, but for `to`; empty if none is.
  [[nodiscard]] std::string given() const;
};

void add_format_options(CLI::App& app, FormatOptions& options);

/// Replaces this process by `python -m tangere.export`: the Python of TANGERE_PYTHON, else python3.
/// A package beside the program comes first. Returns only by throwing: InputError for an unknown
/// format, IoError if there is no Python.
[[noreturn]] void export_by_python(const std::string& input, const std::string& output,
                                   bool overwrite, const FormatOptions& options,
                                   const Console& console);

/// Replaces this process by the function main() of a module of the Python package, for a subcommand
/// of this program. Returns only by throwing IoError if there is no Python.
[[noreturn]] void run_python(const std::string& module, const std::string& command,
                             const std::vector<std::string>& arguments, const Console& console);

}  // namespace tangere::apps
