// SPDX-License-Identifier: Apache-2.0
// What a subcommand is: a corner of the parser and a function. One file for each.
#pragma once

#include <functional>
#include <string>

namespace CLI {
class App;
}

namespace tangere::apps {

/// Name, version and build of the program.
struct ProgramInfo {
  std::string version;       ///< "0.1.0"
  std::string command_line;  ///< as typed
};

struct Command {
  const CLI::App* app = nullptr;
  std::function<int(const ProgramInfo&)> run;  ///< returns an ExitCode; throws InputError, IoError
  /// Whether it reads HDF5 files, as its options are; never if empty.
  std::function<bool()> reads_files = {};
};

Command add_inspect(CLI::App& program);
Command add_import(CLI::App& program);
Command add_simulate(CLI::App& program);
Command add_generate(CLI::App& program);
Command add_validate(CLI::App& program);
Command add_info(CLI::App& program);
Command add_merge(CLI::App& program);
Command add_export(CLI::App& program);
Command add_plot(CLI::App& program);
Command add_bench(CLI::App& program);
Command add_gradcheck(CLI::App& program);
Command add_identify(CLI::App& program);
Command add_calibrate(CLI::App& program);
Command add_accuracy(CLI::App& program);
Command add_stress(CLI::App& program);
Command add_skin(CLI::App& program);
Command add_view(CLI::App& program);

}  // namespace tangere::apps
