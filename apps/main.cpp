// SPDX-License-Identifier: Apache-2.0
// The command `tangere`: chooses a subcommand and turns exceptions into messages and exit codes.
#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <new>
#include <vector>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "engine/base/error.hpp"
#include "kernels/table/isa.hpp"

namespace tangere::apps {
namespace {

#ifdef __clang__
constexpr const char* kCompiler = "Clang " __clang_version__;
#else
constexpr const char* kCompiler = "GCC " __VERSION__;
#endif

constexpr const char* kFooter =
    "Exit codes: 0 done; 1 finished, some environments failed; 2 usage or scene error;\n"
    "3 input or output failed; 75 stopped by SIGTERM; 130 stopped by SIGINT.\n"
    "Example:\n"
    "  tangere simulate scenes/rolling_ball.xml --output ball.h5 --envs 4";

/// The program's parser and its subcommands. Made once; the callbacks point into it.
struct Program {
  CLI::App parser{"Batched, differentiable tactile simulation on CPUs.", "tangere"};
  std::vector<Command> commands;

  Program() {
    parser.set_version_flag(
        "--version",
        [] {
          return fmt::format("tangere {} ({}, {})", TANGERE_VERSION, kernels::active_isa_name(),
                             kCompiler);
        },
        "Print version, instruction set and compiler");
    parser.footer(kFooter);
    // What the parser cannot place is reported by us, with the nearest name.
    parser.require_subcommand(0, 1);
    parser.allow_extras();
    commands = {add_inspect(parser),  add_simulate(parser), add_generate(parser),
                add_validate(parser), add_info(parser),     add_merge(parser),
                add_export(parser),   add_plot(parser),     add_bench(parser),
                add_gradcheck(parser)};
  }

  [[nodiscard]] const Command* chosen() const {
    for (const Command& command : commands)
      if (command.app->parsed()) return &command;
    return nullptr;
  }

  /// "tangere" or "tangere simulate".
  [[nodiscard]] std::string name() const {
    const Command* command = chosen();
    return command == nullptr ? "tangere" : "tangere " + command->app->get_name();
  }

  /// A word out of place says more than what is missing because of it.
  void check_words() const {
    const Command* command = chosen();
    check_no_extras(parser, command == nullptr ? nullptr : command->app);
  }
};

int run(Program& program, int argc, char** argv) {
  try {
    program.parser.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.parser.exit(error);  // --help, --version
    program.check_words();
    throw InputError(std::string(error.what()) + "; see '" + program.name() + " --help'");
  }
  program.check_words();
  const Command* command = program.chosen();
  if (command == nullptr) throw InputError("no subcommand given; see 'tangere --help'");
  if (*kernels::forced_isa_error() != '\0') throw InputError(kernels::forced_isa_error());
  ProgramInfo info{TANGERE_VERSION, {}};
  for (int i = 0; i < argc; ++i) info.command_line += (i > 0 ? " " : "") + std::string(argv[i]);
  return command->run(info);
}

/// The message for people on stderr and, where JSON was asked for, the object that a program waits
/// for: the parser may have stopped before it came to --json.
int report(const Program& program, int argc, char** argv, ExitCode code, const std::string& what) {
  Console console;
  console.json = std::any_of(argv, argv + argc, [](const std::string& a) { return a == "--json"; });
  console.fail("tangere: " + what);
  const Command* command = program.chosen();
  console.result({{"command", command == nullptr ? Json() : Json(command->app->get_name())},
                  {"exit_code", static_cast<int>(code)},
                  {"error", what}});
  return code;
}

int guarded(int argc, char** argv) {
  Program program;
  try {
    return run(program, argc, argv);
  } catch (const InputError& error) {
    return report(program, argc, argv, kUsage, error.what());
  } catch (const IoError& error) {
    return report(program, argc, argv, kInputOutput, error.what());
  } catch (const std::filesystem::filesystem_error& error) {
    return report(program, argc, argv, kInputOutput, error.what());
  } catch (const std::bad_alloc&) {
    return report(program, argc, argv, kUsage, "out of memory; ask for fewer environments");
  } catch (const std::exception& error) {
    return report(program, argc, argv, kInputOutput,
                  fmt::format("{}; this is a mistake in tangere itself: please report it with the "
                              "command and its files",
                              error.what()));
  }
}

}  // namespace
}  // namespace tangere::apps

int main(int argc, char** argv) {
  const int code = tangere::apps::guarded(argc, argv);
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  std::fputs("tangere: writing to stdout failed\n", stderr);
  return tangere::apps::kInputOutput;
}
