// SPDX-License-Identifier: Apache-2.0
// A strict reader: if a field is not a number where one is expected, that is an error with its
// place.
#include "io/files/csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string_view>
#include <utility>

#include "engine/base/error.hpp"
#include "io/files/text_file.hpp"

namespace tangere {
namespace {

// Longer lines do not occur in tables of controls. The limit also bounds the memory for input
// without line ends.
constexpr std::streamsize kLongestLine = 1 << 20;

std::string_view trim(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> fields;
  for (std::size_t comma = line.find(','); comma != std::string_view::npos;
       comma = line.find(',')) {
    fields.push_back(trim(line.substr(0, comma)));
    line.remove_prefix(comma + 1);
  }
  fields.push_back(trim(line));
  return fields;
}

/// A word begins with a letter, an underscore or a quote and is not a number. "nan" and "inf" are
/// numbers.
bool is_word(std::string_view field) {
  double number = 0;
  if (field.empty() ||
      std::from_chars(field.data(), field.data() + field.size(), number).ec == std::errc())
    return false;
  const char c = field.front();
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || c == '"' || c == '\'';
}

double parse_number(std::string_view field, const std::string& place) {
  if (field.empty()) throw InputError(place + " is empty; expected a number");
  std::string_view digits = field;
  // The library's parser does not accept a plus sign.
  if (digits.front() == '+' && !digits.starts_with("+-")) digits.remove_prefix(1);
  double number = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  if (error == std::errc::result_out_of_range && end == digits.data() + digits.size())
    throw InputError(fmt::format("{}: '{}' is beyond the range of a double", place, field));
  if (error != std::errc() || end != digits.data() + digits.size())
    throw InputError(fmt::format("{}: '{}' is not a number", place, field.substr(0, 40)));
  if (!std::isfinite(number))
    throw InputError(fmt::format("{}: '{}'; expected a finite number", place, field));
  return number;
}

/// Returns a name of a header without its quotes.
std::string_view unquoted(std::string_view word) {
  if (word.size() > 1 && (word.front() == '"' || word.front() == '\'') &&
      word.back() == word.front())
    return word.substr(1, word.size() - 2);
  return word;
}

void check_header(const std::vector<std::string_view>& header, std::span<const std::string> names,
                  const std::string& place) {
  for (std::size_t column = 0; column < header.size(); ++column) {
    const std::string_view word = unquoted(header[column]);
    const auto named = std::find(names.begin(), names.end(), word);
    if (named != names.end() && *named != names[column])
      throw InputError(fmt::format(
          "{}column {} is headed '{}'; expected '{}' there: columns follow the motors' order",
          place, column + 1, word, names[column]));
  }
}

/// Calls row(fields, place, line number) for every line that is neither empty nor a comment.
template <class Row>
void for_each_row(const std::string& path, const Row& row) {
  require_regular_file(path, "a csv file");
  std::ifstream file(path);
  if (!file) throw IoError(path + ": cannot be opened for reading");
  std::vector<char> buffer(kLongestLine);
  Source source{path, 0};
  while (file.getline(buffer.data(), kLongestLine)) {
    ++source.line;
    std::string_view line(buffer.data(), static_cast<std::size_t>(file.gcount()));
    if (!file.eof()) line.remove_suffix(1);  // the newline counts as read
    if (source.line == 1 && line.starts_with(kByteOrderMark))
      line.remove_prefix(kByteOrderMark.size());
    line = trim(line);
    if (!line.empty() && line.front() != '#') row(split(line), source.prefix(), source.line);
  }
  if (file.bad()) throw IoError(path + ": reading failed");
  if (!file.eof())
    throw InputError(fmt::format("{}:{}: line longer than {} bytes; expected a table of numbers",
                                 path, source.line + 1, kLongestLine));
}

void check_count(std::size_t found, std::size_t expected, const char* each,
                 const std::string& place) {
  if (found != expected)
    throw InputError(fmt::format("{}{} column{}; expected {}, {}", place, found,
                                 found == 1 ? "" : "s", expected, each));
}

std::vector<std::string> column_names(const std::vector<std::string_view>& header,
                                      const std::string& place) {
  if (!std::all_of(header.begin(), header.end(), is_word))
    throw InputError(place + "no names of columns; expected them in the first row");
  std::vector<std::string> names;
  for (const std::string_view word : header) {
    if (std::find(names.begin(), names.end(), unquoted(word)) != names.end())
      throw InputError(
          fmt::format("{}two columns '{}'; expected different names", place, unquoted(word)));
    names.emplace_back(unquoted(word));
  }
  return names;
}

double number_at(const std::vector<std::string_view>& fields, std::size_t column,
                 const std::string& place) {
  return parse_number(fields[column], fmt::format("{}column {}", place, column + 1));
}

[[noreturn]] void fail_empty(const std::string& path) {
  throw InputError(path + ": no rows of numbers; expected at least one");
}

}  // namespace

std::vector<std::vector<double>> read_csv(const std::string& path, std::size_t columns,
                                          std::span<const std::string> names) {
  std::vector<std::vector<double>> rows;
  bool first = true;
  for_each_row(
      path, [&](const std::vector<std::string_view>& fields, const std::string& place, int) {
        check_count(fields.size(), columns, "one per control", place);
        if (std::exchange(first, false) && std::all_of(fields.begin(), fields.end(), is_word)) {
          check_header(fields, names, place);
          return;
        }
        std::vector<double>& row = rows.emplace_back();
        for (std::size_t c = 0; c < columns; ++c) row.push_back(number_at(fields, c, place));
      });
  if (rows.empty()) fail_empty(path);
  return rows;
}

NamedColumns read_named_columns(const std::string& path) {
  NamedColumns out;
  for_each_row(
      path, [&](const std::vector<std::string_view>& fields, const std::string& place, int line) {
        if (out.names.empty()) {
          out.names = column_names(fields, place);
          out.columns.resize(out.names.size());
          out.header = place;
          return;
        }
        check_count(fields.size(), out.names.size(), "as in the header", place);
        out.lines.push_back(line);
        for (std::size_t c = 0; c < fields.size(); ++c)
          out.columns[c].push_back(number_at(fields, c, place));
      });
  if (out.names.empty() || out.columns[0].empty()) fail_empty(path);
  return out;
}

std::optional<std::size_t> NamedFields::find(const std::string& name) const {
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end()) return std::nullopt;
  return static_cast<std::size_t>(found - names.begin());
}

double NamedFields::number(const Row& row, std::size_t column) const {
  return parse_number(row.fields[column], fmt::format("{}{}", row.place, names[column]));
}

NamedFields read_named_fields(const std::string& path) {
  NamedFields out;
  for_each_row(path,
               [&](const std::vector<std::string_view>& fields, const std::string& place, int) {
                 if (out.names.empty()) {
                   out.names = column_names(fields, place);
                   return;
                 }
                 check_count(fields.size(), out.names.size(), "as in the header", place);
                 out.rows.push_back({place, {fields.begin(), fields.end()}});
               });
  if (out.rows.empty()) fail_empty(path);
  return out;
}

}  // namespace tangere
