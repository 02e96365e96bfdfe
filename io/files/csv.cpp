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

void check_header(const std::vector<std::string_view>& header, std::span<const std::string> names,
                  const std::string& place) {
  for (std::size_t column = 0; column < header.size(); ++column) {
    std::string_view word = header[column];
    if (word.size() > 1 && (word.front() == '"' || word.front() == '\'') &&
        word.back() == word.front())
      word = word.substr(1, word.size() - 2);
    const auto named = std::find(names.begin(), names.end(), word);
    if (named != names.end() && *named != names[column])
      throw InputError(fmt::format(
          "{}column {} is headed '{}'; expected '{}' there: columns follow the motors' order",
          place, column + 1, word, names[column]));
  }
}

}  // namespace

std::vector<std::vector<double>> read_csv(const std::string& path, std::size_t columns,
                                          std::span<const std::string> names) {
  require_regular_file(path, "a csv file");
  std::ifstream file(path);
  if (!file) throw IoError(path + ": cannot be opened for reading");

  std::vector<std::vector<double>> rows;
  std::vector<char> buffer(kLongestLine);
  bool first = true;
  Source source{path, 0};
  while (file.getline(buffer.data(), kLongestLine)) {
    ++source.line;
    std::string_view line(buffer.data(), static_cast<std::size_t>(file.gcount()));
    if (!file.eof()) line.remove_suffix(1);  // the newline counts as read
    if (source.line == 1 && line.starts_with(kByteOrderMark))
      line.remove_prefix(kByteOrderMark.size());
    line = trim(line);
    if (line.empty() || line.front() == '#') continue;
    const std::vector<std::string_view> fields = split(line);
    if (fields.size() != columns)
      throw InputError(fmt::format("{}{} column{}; expected {}, one per control", source.prefix(),
                                   fields.size(), fields.size() == 1 ? "" : "s", columns));
    if (std::exchange(first, false) && std::all_of(fields.begin(), fields.end(), is_word)) {
      check_header(fields, names, source.prefix());
      continue;
    }
    std::vector<double>& row = rows.emplace_back();
    for (std::size_t c = 0; c < columns; ++c)
      row.push_back(parse_number(fields[c], fmt::format("{}column {}", source.prefix(), c + 1)));
  }
  if (file.bad()) throw IoError(path + ": reading failed");
  if (!file.eof())
    throw InputError(fmt::format("{}:{}: line longer than {} bytes; expected a table of numbers",
                                 path, source.line + 1, kLongestLine));
  if (rows.empty()) throw InputError(path + ": no rows of numbers; expected at least one");
  return rows;
}

}  // namespace tangere
