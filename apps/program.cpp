// SPDX-License-Identifier: Apache-2.0
// The command `tangere`: chooses a subcommand and turns exceptions into messages and exit codes.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>
#include <nlohmann/json.hpp>
#include <vector>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/program.hpp"
#include "apps/reader_process.hpp"
#include "apps/stop_signals.hpp"
#include "engine/base/error.hpp"
#include "io/files/input_files.hpp"
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
    "With the Python package (docs/python.md): python -m tangere.lerobot DIR OUT writes a data\n"
    "set for lerobot, python -m tangere.robomimic MODEL.pth plays what robomimic has trained.\n"
    "Example:\n"
    "  tangere simulate scenes/rolling_ball.xml --output ball.h5 --envs 4";

/// The program's command line and its subcommands. Made once; the callbacks point into it.
struct Program {
  Parser parser{"Batched, differentiable tactile simulation on CPUs.", "tangere", kFooter};
  std::vector<Command> commands;

  Program() {
    parser.add_version(
        [] {
          return fmt::format("tangere {} ({}, {})", TANGERE_VERSION, kernels::active_isa_name(),
                             kCompiler);
        },
        "Print version, instruction set and compiler");
    for (const auto add :
         {add_inspect, add_import, add_simulate, add_generate, add_validate, add_info, add_merge,
          add_export, add_plot, add_view, add_bench, add_gradcheck, add_identify, add_calibrate,
          add_accuracy, add_stress, add_skin})
      commands.push_back(add(parser.root()));
  }
};

const Command& chosen_command(const Program& program) {
  const auto command =
      std::find_if(program.commands.begin(), program.commands.end(),
                   [&](const Command& c) { return c.app == program.parser.chosen(); });
  if (command == program.commands.end())
    throw InputError("no subcommand given; see 'tangere --help'");
  return *command;
}

bool requests_json(int argc, char** argv) {
  return std::any_of(argv, argv + argc, [](const std::string& a) { return a == "--json"; });
}

Json error_object(const std::string& command, ExitCode code, const std::string& what) {
  return {{"command", command.empty() ? Json() : Json(command)},
          {"exit_code", static_cast<int>(code)},
          {"error", what}};
}

int run(const Command& command, const std::string& name, int argc, char** argv) {
  keep_inputs();
  const bool json = requests_json(argc, argv);
  end_by_signals(
      [&](ExitCode code, const std::string& what) {
        return json ? error_object(name, code, what).dump(2) + "\n" : std::string();
      },
      command.reads_files && command.reads_files());
  if (*kernels::isa_error() != '\0') throw InputError(kernels::isa_error());
  ProgramInfo info{TANGERE_VERSION, {}};
  for (int i = 0; i < argc; ++i) info.command_line += (i > 0 ? " " : "") + std::string(argv[i]);
  const int code = command.run(info);
  ignore_signals();
  return code;
}

/// Prints the message on stderr and, with --json, the error object. The arguments are searched for
/// --json, because the parser may have stopped before it.
int report(const Program& program, int argc, char** argv, ExitCode code, const std::string& what) {
  Console console;
  console.json = requests_json(argc, argv);
  console.fail("tangere: " + what);
  console.result(error_object(program.parser.chosen_name(), code, what));
  return code;
}

/// Turns what `body` throws into a message and an exit code.
int guarded(const Program& program, int argc, char** argv, const std::function<int()>& body) {
  try {
    return body();
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

/// Reports uncaught exceptions: allocation failures during error reporting, or failures in threads
/// of a library. Does not allocate.
[[noreturn]] void end_uncaught() noexcept {
  const char* reason = "a failure that it could not handle";
  int code = kInputOutput;
  try {
    // Not std::rethrow_exception: it allocates, and ends in this handler again where it cannot.
    if (std::current_exception() != nullptr) throw;
  } catch (const std::bad_alloc&) {
    reason = "out of memory; ask for fewer environments";
    code = kUsage;
  } catch (const std::exception& error) {
    reason = error.what();
  } catch (...) {
  }
  std::fputs("tangere: ", stderr);
  std::fputs(reason, stderr);
  std::fputs("\n", stderr);
  _exit(code);
}

bool came_to_its_end = false;

/// HDF5 calls exit(-1) without a message after some allocation failures.
void end_by_library() {
  if (came_to_its_end) return;
  std::fputs("tangere: a library ended the program; most likely memory ran out\n", stderr);
  _exit(kUsage);
}

/// Set before other objects of the program are made: they allocate, too.
struct LastResort {
  LastResort() { std::set_terminate(end_uncaught); }
};
[[gnu::init_priority(101)]] const LastResort last_resort;

int start(int argc, char** argv) {
  Program program;
  return guarded(program, argc, argv, [&]() -> int {
    if (!program.parser.parse(argc, argv)) return kDone;
    const Command& command = chosen_command(program);
    const auto body = [&] {
      return guarded(program, argc, argv,
                     [&] { return run(command, program.parser.chosen_name(), argc, argv); });
    };
    return command.reads_files && command.reads_files() ? run_in_child(body) : body();
  });
}

}  // namespace
}  // namespace tangere::apps

namespace tangere {

int run_program(int argc, char** argv) {
  std::atexit(apps::end_by_library);  // what is registered last runs first
  const int code = apps::start(argc, argv);
  apps::came_to_its_end = true;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  std::fputs("tangere: writing to stdout failed\n", stderr);
  return apps::kInputOutput;
}

}  // namespace tangere
