// SPDX-License-Identifier: Apache-2.0
// Reads numbers in the same way in every locale.
#include "io/files/word_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>

#include "engine/base/error.hpp"
#include "io/files/text_file.hpp"

namespace tangere {
namespace {

constexpr std::uintmax_t kLargestFile = 256U << 20;
constexpr double kLargestPosition = 1e6;  // [file's unit]
constexpr const char* kExpected = "a surface or a list of points";

/// Returns NaN if the word is not a number.
double parse(std::string_view word) {
  double x = 0;
  if (word.size() > 1 && word[0] == '+' && word[1] != '-')
    word.remove_prefix(1);  // the library does not accept a plus sign
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), x);
  return error == std::errc() && end == word.data() + word.size() ? x : NAN;
}

}  // namespace

WordReader::WordReader(const std::string& path, LineEnd line_end)
    : path_(path), line_end_(line_end) {
  std::error_code error;
  require_regular_file(path, kExpected);
  file_.open(path, std::ios::binary);
  if (!file_) throw IoError(path + ": cannot be opened for reading");
  if (std::filesystem::file_size(path, error) > kLargestFile && !error)
    throw InputError(path + ": larger than 256 MiB; expected " + kExpected);
  std::string head(kByteOrderMark.size(), '\0');
  file_.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<std::size_t>(file_.gcount()));
  if (head.starts_with("\xFF\xFE") || head.starts_with("\xFE\xFF"))
    throw InputError(path + ":1: text in UTF-16; expected UTF-8");
  file_.clear();
  file_.seekg(head.starts_with(kByteOrderMark) ? std::streamoff(kByteOrderMark.size()) : 0);
}

bool WordReader::read_line() {
  if (!std::getline(file_, line_)) return false;
  ++number_;
  if (line_end_ == LineEnd::plain) return true;
  for (std::string next;;) {
    const std::size_t last = line_.find_last_not_of(" \t\r");
    const bool goes_on = last != std::string::npos && line_[last] == '\\' &&
                         line_.find('#') == std::string::npos;  // not in a remark
    if (!goes_on) return true;
    line_[last] = ' ';
    if (!std::getline(file_, next)) return true;
    ++number_;
    line_ += next;
  }
}

bool WordReader::next() {
  while (read_line()) {
    std::replace(line_.begin(), line_.end(), '"', ' ');
    words.clear();
    std::string_view rest = line_;
    for (;;) {
      const std::size_t begin = rest.find_first_not_of(" \t\r");
      if (begin == std::string_view::npos || rest[begin] == '#') break;
      const std::size_t end = std::min(rest.find_first_of(" \t\r", begin), rest.size());
      words.push_back(rest.substr(begin, end - begin));
      rest.remove_prefix(end);
    }
    if (!words.empty()) return true;
  }
  if (file_.bad()) throw IoError(path_ + ": reading failed");
  return false;
}

std::string WordReader::place() const { return fmt::format("{}:{}:", path_, number_); }

void WordReader::fail(const std::string& message) const {
  throw InputError(place() + " " + message);
}

double WordReader::number(std::size_t k) const {
  const double x = parse(words[k]);
  if (!std::isfinite(x))
    fail(fmt::format("'{}'; expected a finite number", words[k].substr(0, 40)));
  return x;
}

double WordReader::position(std::size_t k) const {
  const double x = parse(words[k]);
  if (!(std::abs(x) <= kLargestPosition))
    fail(fmt::format("'{}'; expected a number of at most {:g}", words[k].substr(0, 40),
                     kLargestPosition));
  return x;
}

long WordReader::integer(std::string_view word, const char* expected) const {
  long n = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), n);
  if (error != std::errc() || end != word.data() + word.size())
    fail(fmt::format("'{}'; expected {}", word.substr(0, 40), expected));
  return n;
}

}  // namespace tangere
