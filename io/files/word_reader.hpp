// SPDX-License-Identifier: Apache-2.0
// Reads text files of numbers beside a scene: lines of words, with errors that name the line.
#pragma once

#include <fstream>
#include <string>
#include <string_view>
#include <vector>

namespace tangere {

/// What a backslash at the end of a line means.
enum class LineEnd { plain, joined };

/// Lines of a text file, cut into words at spaces and quotes. A byte order mark of UTF-8 before the
/// first line is no part of it.
class WordReader {
 public:
  /// `line_end`: with `joined`, a line that ends with a backslash goes on in the next one, and
  /// messages name the last of them. Throws IoError if the file cannot be opened. Throws InputError
  /// if it is larger than 256 MiB, UTF-16, or a pointer of Git LFS.
  explicit WordReader(const std::string& path, LineEnd line_end = LineEnd::plain);

  /// Moves to the next line that has words. Returns false at the end. A word that starts with #
  /// ends its line.
  bool next();
  /// "file:line:" of the line.
  [[nodiscard]] std::string place() const;
  /// Throws InputError with file and line.
  [[noreturn]] void fail(const std::string& message) const;

  /// These return word k of the line: as a finite number; as a position, at most a million because
  /// no simulation is accurate beyond that; as an integer, with `expected` for the message. They
  /// fail if the word is not of this kind.
  [[nodiscard]] double number(std::size_t k) const;
  [[nodiscard]] double position(std::size_t k) const;
  [[nodiscard]] long integer(std::string_view word, const char* expected) const;

  std::vector<std::string_view> words;  ///< of the line, valid until next()

 private:
  bool read_line();

  std::string path_, line_;
  std::ifstream file_;
  LineEnd line_end_;
  int number_ = 0;
};

}  // namespace tangere
