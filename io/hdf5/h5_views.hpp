// SPDX-License-Identifier: Apache-2.0
// What virtual datasets show, as bytes, without the library.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tangere::h5 {

/// Rows [first, first + rows) of a dataset of another file. Its shape is like that of the dataset
/// that shows them.
struct ShownRows {
  std::string_view file;  ///< relative to the folder of the file with the virtual dataset
  std::string_view path;  ///< in that file
  std::uint64_t first = 0, rows = 0;
  std::uint64_t of = 0;  ///< rows that the dataset has
};

/// The name of a file or dataset as the source of a virtual dataset: readers take these for printf
/// patterns, so '%' is doubled. Links take names as they are.
std::string view_source(std::string_view name);

/// The text that a FileView refers to: rows one behind the other, together those of a dataset of
/// `dims`, none of which is 0.
std::string shown_rows(std::span<const ShownRows> parts, const std::vector<std::uint64_t>& dims);

}  // namespace tangere::h5
