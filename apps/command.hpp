// SPDX-License-Identifier: Apache-2.0
// What a subcommand is: a parser's corner and a function. One file for each.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>

namespace tangere::apps {

/// What the program knows about itself, for files and people.
struct ProgramInfo {
  std::string version;       ///< "0.1.0"
  std::string command_line;  ///< as typed
};

struct Command {
  CLI::App* app = nullptr;
  std::function<int(const ProgramInfo&)> run;  ///< returns an ExitCode; throws InputError, IoError
};

Command add_inspect(CLI::App& program);
Command add_simulate(CLI::App& program);
Command add_generate(CLI::App& program);
Command add_validate(CLI::App& program);
Command add_info(CLI::App& program);
Command add_merge(CLI::App& program);
Command add_export(CLI::App& program);
Command add_plot(CLI::App& program);
Command add_bench(CLI::App& program);
Command add_gradcheck(CLI::App& program);

}  // namespace tangere::apps
