// SPDX-License-Identifier: Apache-2.0
// Tables of numbers from a spreadsheet, a script or an editor: controls, one row per step, and
// recordings with named columns.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace tangere {

/// Reads comma-separated finite numbers, `columns` in every row. Skips empty lines and lines that
/// start with `#`. The first row may be a header: words, as many as there are columns. If `names`
/// are given, a header that puts one of them over another column is an error, because the numbers
/// would drive the wrong joint. Throws IoError when the file cannot be read, InputError
/// ("file:line: …") for any other mistake in it, including a table without rows.
std::vector<std::vector<double>> read_csv(const std::string& path, std::size_t columns,
                                          std::span<const std::string> names = {});

struct NamedColumns {
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;  ///< parallel to names, all of one length
  std::vector<int> lines;                    ///< of the rows, in the file
  std::string header;                        ///< "file:line: " of the names, for messages
};
/// Reads a table whose first row has a different name for each column. Otherwise as read_csv().
NamedColumns read_named_columns(const std::string& path);

/// A table of words and numbers with named columns.
struct NamedFields {
  struct Row {
    std::string place;  ///< "file:line: ", for messages
    std::vector<std::string> fields;
  };
  std::vector<std::string> names;
  std::vector<Row> rows;

  /// Returns the index of a column; none if there is none of this name.
  [[nodiscard]] std::optional<std::size_t> find(const std::string& name) const;
  /// Returns a field as a number. Throws InputError ("file:line: …") if it is none.
  [[nodiscard]] double number(const Row& row, std::size_t column) const;
};
/// Reads a table whose first row has a different name for each column; fields are any texts.
/// Otherwise as read_csv().
NamedFields read_named_fields(const std::string& path);

}  // namespace tangere
