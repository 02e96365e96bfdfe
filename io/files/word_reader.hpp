// SPDX-License-Identifier: Apache-2.0
// Text files of numbers beside a scene: lines of words, errors with the line.
#pragma once

#include <fstream>
#include <string>
#include <string_view>
#include <vector>

namespace tangere {

/// Lines of a text file, cut into words at spaces and quotes.
class WordReader {
 public:
  /// Throws IoError where the file cannot be opened, InputError where it is larger than 256 MiB.
  explicit WordReader(const std::string& path);

  /// The next line that has words; false at the end. A word that starts with # ends its line.
  bool next();
  /// Throws InputError with file and line.
  [[noreturn]] void fail(const std::string& message) const;

  /// Word k of the line as a finite number; as one of at most a million, beyond which nothing is
  /// simulated to any accuracy; as a whole number, where `expected` says what is wanted. Fail
  /// otherwise.
  [[nodiscard]] double number(std::size_t k) const;
  [[nodiscard]] double position(std::size_t k) const;
  [[nodiscard]] long integer(std::string_view word, const char* expected) const;

  std::vector<std::string_view> words;  ///< of the line, valid until the next

 private:
  std::string path_, line_;
  std::ifstream file_;
  int number_ = 0;
};

}  // namespace tangere
