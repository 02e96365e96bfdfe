// SPDX-License-Identifier: Apache-2.0
// Options of the command line as numbers, and what to say about words that are no option.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "apps/console.hpp"

namespace tangere::apps {

/// Adds `flags` whose value is a whole number from `low` to `high`; `value` stays as it is when the
/// option is not given. Parsing throws InputError naming the option, what was found and the range.
template <class T>
CLI::Option* add_whole_number(CLI::App& command, const std::string& flags, std::optional<T>& value,
                              T low, T high, const std::string& description);

/// The same for a list of different numbers separated by commas, "1,2,4".
CLI::Option* add_whole_numbers(CLI::App& command, const std::string& flags,
                               std::vector<int>& values, int low, int high,
                               const std::string& description);

/// One positive finite number.
CLI::Option* add_positive_number(CLI::App& command, const std::string& flags,
                                 std::optional<double>& value, const std::string& description);

/// An amount of memory in bytes: a positive number and B, kB, MB, GB, TB (powers of 1000) or KiB,
/// MiB, GiB, TiB (of 1024).
CLI::Option* add_memory_size(CLI::App& command, const std::string& flags,
                             std::optional<double>& bytes, const std::string& description);

/// An argument (`flags` without dashes) or option that takes text; empty text is an error, because
/// it mostly is a shell variable that was not set.
CLI::Option* add_text(CLI::App& command, const std::string& flags, std::string& value,
                      const std::string& type, const std::string& description);

/// --json, -q, -v: the same for every subcommand.
void add_console_options(CLI::App& command, Console& console);

/// Throws InputError, with the nearest name, when the parser could not place a word; `command` is
/// the chosen subcommand, null when none was recognised.
void check_no_extras(const CLI::App& program, const CLI::App* command);

/// Throws InputError when writing `output` would replace `input`, --overwrite or not.
void check_not_same_file(const std::string& output, const std::string& input);

}  // namespace tangere::apps
