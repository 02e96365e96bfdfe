// SPDX-License-Identifier: Apache-2.0
// The command line: options as numbers, and what to say about words that are no option. The
// parser's library is slow to compile, so its headers stay behind this one (arguments.cpp).
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

/// Of one run: more is a mistyped number.
inline constexpr int kMostThreads = 4096;

/// A program's command line: its options and, if it has any, its subcommands. Made once; options
/// point into their variables.
class Parser {
 public:
  Parser(const std::string& description, const std::string& name, const std::string& footer);
  ~Parser();
  Parser(const Parser&) = delete;
  Parser& operator=(const Parser&) = delete;

  /// What functions below add options and subcommands to.
  [[nodiscard]] CLI::App& root() { return *root_; }
  /// --version prints the text.
  void add_version(const std::function<std::string()>& text, const std::string& description);

  /// False when --help or --version was answered, on stdout. Throws InputError for everything that
  /// does not belong, with the nearest name where a word is unknown.
  bool parse(int argc, char** argv);

  /// The chosen subcommand; null when there is none.
  [[nodiscard]] const CLI::App* chosen() const;
  /// "simulate" of `tangere simulate`; "" when there is none.
  [[nodiscard]] std::string chosen_name() const;

 private:
  void check_words() const;

  std::unique_ptr<CLI::App> root_;
};

/// Adds the subcommand `name`. `example`: a command line that works, shown below its options.
CLI::App& add_command(CLI::App& program, const std::string& name, const std::string& description,
                      const std::string& example);

/// An option or argument that was added: what else holds for it.
class AddedOption {
 public:
  explicit AddedOption(CLI::Option& option) : option_(&option) {}
  void required() const;
  void excludes(const AddedOption& other) const;

 private:
  CLI::Option* option_;
};

/// Adds `flags` whose value is a whole number from `low` to `high`; `value` stays as it is when the
/// option is not given. Parsing throws InputError naming the option, what was found and the range.
template <class T>
AddedOption add_whole_number(CLI::App& command, const std::string& flags, std::optional<T>& value,
                             T low, T high, const std::string& description);

/// The same for a list of different numbers separated by commas, "1,2,4".
void add_whole_numbers(CLI::App& command, const std::string& flags, std::vector<int>& values,
                       int low, int high, const std::string& description);

/// The same for one positive finite number.
void add_positive_number(CLI::App& command, const std::string& flags, std::optional<double>& value,
                         const std::string& description);

/// The same for an amount of memory in bytes: a positive number and B, kB, MB, GB, TB (powers of
/// 1000) or KiB, MiB, GiB, TiB (of 1024).
void add_memory_size(CLI::App& command, const std::string& flags, std::optional<double>& bytes,
                     const std::string& description);

/// Adds an argument (`flags` without dashes) or option that takes text. Empty text is an error,
/// because it is mostly a shell variable that was not set.
AddedOption add_text(CLI::App& command, const std::string& flags, std::string& value,
                     const std::string& type, const std::string& description);

/// An option without a value: true when it is given.
AddedOption add_flag(CLI::App& command, const std::string& flags, bool& value,
                     const std::string& description);

/// Adds --json, -q and -v, which all subcommands share.
void add_console_options(CLI::App& command, Console& console);

/// Throws InputError when writing `output` would replace `input`, --overwrite or not.
void check_not_same_file(const std::string& output, const std::string& input);

}  // namespace tangere::apps
