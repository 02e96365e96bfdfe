// SPDX-License-Identifier: Apache-2.0
// Parses numbers itself, because the library's parser accepts 0x10, 010 and nan.
#include "apps/arguments.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <sstream>

#include "engine/base/error.hpp"
#include "io/files/nearest_name.hpp"

namespace tangere::apps {
namespace {

template <class T>
bool parse(const std::string& text, T& number) {
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, number);
  return result.ec == std::errc() && result.ptr == end;
}

/// Returns "--output" for "-o,--output".
std::string long_name(const std::string& flags) { return flags.substr(flags.find("--")); }

/// Uses long names only, because every single letter resembles every other.
std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return names;
}

/// Throws InputError, with the nearest name, when the parser could not place a word; `command` is
/// the chosen subcommand, null when none was recognised.
void check_no_extras(const CLI::App& program, const CLI::App* command) {
  std::vector<std::string> extras = program.remaining();
  const CLI::App* owner = &program;
  if (extras.empty() && command != nullptr) {
    extras = command->remaining();
    owner = command;
  }
  if (extras.empty()) return;
  const std::string word = extras.front();
  if (word.starts_with('-')) {
    const std::string name = word.substr(0, word.find('='));
    throw InputError("unknown option '" + name + "'" + suggestion(name, option_names(*owner)));
  }
  if (command != nullptr)
    throw InputError("unexpected argument '" + word + "' of " + command->get_name());
  std::vector<std::string> commands;
  for (const CLI::App* sub : program.get_subcommands({})) commands.push_back(sub->get_name());
  throw InputError("unknown subcommand '" + word + "'" + suggestion(word, commands));
}

/// Breaks descriptions into lines of at most 100 columns. Two or more spaces stand between a name
/// and its description.
class WrappedHelp : public CLI::Formatter {
 public:
  std::string make_option(const CLI::Option* option, bool is_positional) const override {
    const std::size_t indent = get_column_width();
    const std::string new_line = "\n" + std::string(indent, ' ');
    std::string text = "  " + make_option_name(option, is_positional) + make_option_opts(option);
    text += text.size() + 2 > indent ? new_line : std::string(indent - text.size(), ' ');
    std::size_t column = indent;
    std::istringstream words(option->get_description());
    for (std::string word; words >> word; column += word.size()) {
      if (column > indent) {
        const bool fits = column + 1 + word.size() <= kColumns;
        text += fits ? " " : new_line;
        column = fits ? column + 1 : indent;
      }
      text += word;
    }
    return text + "\n";
  }

 private:
  static constexpr std::size_t kColumns = 100;
};

}  // namespace

Parser::Parser(const std::string& description, const std::string& name, const std::string& footer)
    : root_(std::make_unique<CLI::App>(description, name)) {
  root_->formatter(std::make_shared<WrappedHelp>());
  root_->set_help_flag("-h,--help", "Print this help on stdout and end with code 0");
  root_->footer(footer);
}

Parser::~Parser() = default;

void Parser::add_version(const std::function<std::string()>& text, const std::string& description) {
  root_->set_version_flag("--version", text, description);
}

bool Parser::parse(int argc, char** argv) {
  try {
    root_->parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {  // --help, --version
      root_->exit(error);
      return false;
    }
    check_words();
    const std::string space = chosen() == nullptr ? "" : " ";
    throw InputError(fmt::format("{}; see '{}{}{} --help'", error.what(), root_->get_name(), space,
                                 chosen_name()));
  }
  check_words();
  return true;
}

const CLI::App* Parser::chosen() const {
  for (const CLI::App* command : root_->get_subcommands({}))
    if (command->parsed()) return command;
  return nullptr;
}

std::string Parser::chosen_name() const {
  const CLI::App* command = chosen();
  return command == nullptr ? "" : command->get_name();
}

/// Checks words first: a word out of place explains more than what is missing because of it.
void Parser::check_words() const {
  if (!root_->get_subcommands({}).empty()) check_no_extras(*root_, chosen());
}

CLI::App& add_command(CLI::App& program, const std::string& name, const std::string& description,
                      const std::string& example) {
  // We report what the parser cannot place, with the nearest name. Subcommands inherit that.
  program.require_subcommand(0, 1);
  program.allow_extras();
  CLI::App* command = program.add_subcommand(name, description);
  command->footer("Example:\n  " + example);
  return *command;
}

void AddedOption::required() const { option_->required(); }
void AddedOption::excludes(const AddedOption& other) const { option_->excludes(other.option_); }

template <class T>
AddedOption add_whole_number(CLI::App& command, const std::string& flags, std::optional<T>& value,
                             T low, T high, const std::string& description) {
  const auto read = [&value, low, high, name = long_name(flags)](const std::string& text) {
    T number{};
    if (!parse(text, number) || number < low || number > high)
      throw InputError(
          fmt::format("{} {}: expected a whole number from {} to {}", name, text, low, high));
    value = number;
  };
  return AddedOption(
      *command.add_option_function<std::string>(flags, read, description)->type_name("N"));
}

template AddedOption add_whole_number(CLI::App&, const std::string&, std::optional<int>&, int, int,
                                      const std::string&);
template AddedOption add_whole_number(CLI::App&, const std::string&, std::optional<std::int64_t>&,
                                      std::int64_t, std::int64_t, const std::string&);
template AddedOption add_whole_number(CLI::App&, const std::string&, std::optional<std::uint64_t>&,
                                      std::uint64_t, std::uint64_t, const std::string&);

void add_whole_numbers(CLI::App& command, const std::string& flags, std::vector<int>& values,
                       int low, int high, const std::string& description) {
  const auto read = [&values, low, high, name = long_name(flags)](const std::string& text) {
    std::istringstream words(text + ',');  // a comma ends a word: "1," has an empty second one
    for (std::string word; std::getline(words, word, ',');) {
      int number = 0;
      if (!parse(word, number) || number < low || number > high)
        throw InputError(
            fmt::format("{} {}: '{}'; expected whole numbers from {} to {} separated by commas",
                        name, text, word, low, high));
      if (std::find(values.begin(), values.end(), number) != values.end())
        throw InputError(fmt::format("{} {}: {} is given twice", name, text, number));
      values.push_back(number);
    }
  };
  command.add_option_function<std::string>(flags, read, description)->type_name("N,N,...");
}

void add_positive_number(CLI::App& command, const std::string& flags, std::optional<double>& value,
                         const std::string& description) {
  const auto read = [&value, name = long_name(flags)](const std::string& text) {
    double number = 0;
    if (!parse(text, number) || !(number > 0) || !std::isfinite(number))
      throw InputError(fmt::format("{} {}: expected a positive number", name, text));
    value = number;
  };
  command.add_option_function<std::string>(flags, read, description)->type_name("X");
}

void add_number(CLI::App& command, const std::string& flags, double& value,
                const std::string& description) {
  const auto read = [&value, name = long_name(flags)](const std::string& text) {
    if (!parse(text, value) || !std::isfinite(value))
      throw InputError(fmt::format("{} {}: expected a number", name, text));
  };
  command.add_option_function<std::string>(flags, read, description)->type_name("X");
}

void add_positive_numbers(CLI::App& command, const std::string& flags, std::vector<double>& values,
                          std::size_t count, const std::string& description) {
  const auto read = [&values, count, name = long_name(flags)](const std::string& text) {
    std::istringstream words(text + ',');
    for (std::string word; std::getline(words, word, ',');) {
      double number = 0;
      const bool positive = parse(word, number) && number > 0 && std::isfinite(number);
      values.push_back(positive ? number : 0);
    }
    if (values.size() != count || std::ranges::count(values, 0.0) > 0)
      throw InputError(fmt::format("{} {}: expected {} positive numbers separated by commas", name,
                                   text, count));
  };
  std::string type = "X";
  for (std::size_t k = 1; k < count; ++k) type += ",X";
  command.add_option_function<std::string>(flags, read, description)->type_name(type);
}

void add_memory_size(CLI::App& command, const std::string& flags, std::optional<double>& bytes,
                     const std::string& description) {
  static const std::map<std::string, double> units{
      {"B", 1},        {"kB", 1e3},     {"MB", 1e6},     {"GB", 1e9},    {"TB", 1e12},
      {"KiB", 0x1p10}, {"MiB", 0x1p20}, {"GiB", 0x1p30}, {"TiB", 0x1p40}};
  const auto read = [&bytes, name = long_name(flags)](const std::string& text) {
    const std::size_t end = std::min(text.find_first_not_of("0123456789."), text.size());
    const auto unit = units.find(text.substr(end));
    double number = 0;
    if (unit == units.end() || !parse(text.substr(0, end), number) || !(number > 0))
      throw InputError(
          fmt::format("{} {}: expected a positive number and its unit, B, kB, MB, GB, TB, KiB, "
                      "MiB, GiB or TiB, "
                      "as in 2GiB",
                      name, text));
    bytes = number * unit->second;
  };
  command.add_option_function<std::string>(flags, read, description)->type_name("SIZE");
}

namespace {
std::string fault_of_text(const std::string& text) {
  return text.empty() ? std::string("expected text, found none") : std::string();
}
}  // namespace

AddedOption add_text(CLI::App& command, const std::string& flags, std::string& value,
                     const std::string& type, const std::string& description) {
  return AddedOption(
      *command.add_option(flags, value, description)->check(fault_of_text)->type_name(type));
}

void add_texts(CLI::App& command, const std::string& flags, std::vector<std::string>& values,
               const std::string& type, const std::string& description) {
  command.add_option(flags, values, description)
      ->check(fault_of_text)
      ->type_name(type)
      ->allow_extra_args(false);
}

AddedOption add_flag(CLI::App& command, const std::string& flags, bool& value,
                     const std::string& description) {
  return AddedOption(*command.add_flag(flags, value, description));
}

void start_group(CLI::App& command, const std::string& title) {
  command.option_defaults()->group(title);
}

void add_console_options(CLI::App& command, Console& console) {
  start_group(command, "Options");
  add_flag(command, "--json", console.json,
           "Print one JSON object on stdout, whatever happens; text for people goes to stderr");
  const AddedOption quiet = add_flag(command, "-q,--quiet", console.quiet,
                                     "Print errors only, and the JSON object if requested");
  add_flag(command, "-v,--verbose", console.verbose,
           "Print details, and where stderr is no terminal a line of progress every ten seconds")
      .excludes(quiet);
}

}  // namespace tangere::apps
