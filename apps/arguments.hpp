// SPDX-License-Identifier: Apache-2.0
// The command line: turns options into numbers and explains words that are no option. The parser's
// library is slow to compile, so only arguments.cpp includes its headers.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/console.hpp"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace tangere::apps {

/// Limit for one run; a larger number is a typing mistake.
inline constexpr int kMostThreads = 4096;

/// A program's command line: its options and, if it has any, its subcommands. Made once, because
/// options point into their variables.
class Parser {
 public:
  Parser(const std::string& description, const std::string& name, const std::string& footer);
  ~Parser();
  Parser(const Parser&) = delete;
  Parser& operator=(const Parser&) = delete;

  /// The object to which the functions below add options and subcommands.
  [[nodiscard]] CLI::App& root() { return *root_; }
  /// Makes --version print the text.
  void add_version(const std::function<std::string()>& text, const std::string& description);

  /// Returns false if --help or --version was answered on stdout. Throws InputError for everything
  /// that does not belong, with the nearest name for an unknown word.
  bool parse(int argc, char** argv);

  /// The chosen subcommand; null when there is none.
  [[nodiscard]] const CLI::App* chosen() const;
  /// "simulate" of `tangere simulate`; "" when there is none.
  [[nodiscard]] std::string chosen_name() const;

 private:
  void check_words() const;

  std::unique_ptr<CLI::App> root_;
};

/// Adds the subcommand `name`. `example`: a working command line, shown below its options.
CLI::App& add_command(CLI::App& program, const std::string& name, const std::string& description,
                      const std::string& example);

/// An added option or argument, to set what else holds for it.
class AddedOption {
 public:
  explicit AddedOption(CLI::Option& option) : option_(&option) {}
  void required() const;
  void excludes(const AddedOption& other) const;

 private:
  CLI::Option* option_;
};

/// Adds `flags` with a whole number from `low` to `high` as value. `value` keeps its content if the
/// option is not given. Parsing throws InputError naming the option, the value found and the range.
template <class T>
AddedOption add_whole_number(CLI::App& command, const std::string& flags, std::optional<T>& value,
                             T low, T high, const std::string& description);

/// Does the same for a list of different numbers separated by commas, "1,2,4".
void add_whole_numbers(CLI::App& command, const std::string& flags, std::vector<int>& values,
                       int low, int high, const std::string& description);

/// Does the same for one positive finite number.
void add_positive_number(CLI::App& command, const std::string& flags, std::optional<double>& value,
                         const std::string& description);

/// The same for one finite number of either sign.
void add_number(CLI::App& command, const std::string& flags, double& value,
                const std::string& description);

/// The same for `count` positive finite numbers separated by commas, "0.01,0.02".
void add_positive_numbers(CLI::App& command, const std::string& flags, std::vector<double>& values,
                          std::size_t count, const std::string& description);

/// The same for a size in bytes: a positive number and B, kB, MB, GB, TB (powers of 1000) or KiB,
/// MiB, GiB, TiB (of 1024).
void add_memory_size(CLI::App& command, const std::string& flags, std::optional<double>& bytes,
                     const std::string& description);

/// Adds an argument (`flags` without dashes) or option with text as value. Empty text is an error,
/// because it usually comes from a shell variable that was not set.
AddedOption add_text(CLI::App& command, const std::string& flags, std::string& value,
                     const std::string& type, const std::string& description);

/// Adds an option that may be given several times, each time with one text.
void add_texts(CLI::App& command, const std::string& flags, std::vector<std::string>& values,
               const std::string& type, const std::string& description);

/// Adds an option without a value; `value` becomes true when it is given.
AddedOption add_flag(CLI::App& command, const std::string& flags, bool& value,
                     const std::string& description);

/// Options that are added from here on stand below this title in --help.
void start_group(CLI::App& command, const std::string& title);

/// Adds --json, -q and -v, which all subcommands share.
void add_console_options(CLI::App& command, Console& console);

}  // namespace tangere::apps
