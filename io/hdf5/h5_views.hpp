// SPDX-License-Identifier: Apache-2.0
// Describes what virtual datasets show, as bytes, without the library.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tangere::h5 {

/// Rows [first, first + rows) of a dataset of another file. The dataset has the rank and row shape
/// of the virtual one.
struct ShownRows {
  std::string_view file;  ///< relative to the folder of the file with the virtual dataset
  std::string_view path;  ///< in that file
  std::uint64_t first = 0, rows = 0;
  std::uint64_t of = 0;  ///< rows that the dataset has
};

/// Returns the name of a file or dataset as the source of a virtual dataset. Readers take such
/// names for printf patterns, so '%' is doubled. Links take names as they are.
std::string view_source(std::string_view name);

/// Returns the text that a FileView refers to. The parts follow each other and together fill a
/// dataset of `dims`, none of which is 0.
std::string shown_rows(std::span<const ShownRows> parts, const std::vector<std::uint64_t>& dims);

}  // namespace tangere::h5
