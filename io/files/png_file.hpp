// SPDX-License-Identifier: Apache-2.0
// Photographs as PNG files, by libpng.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tangere {

/// A picture of bytes.
struct Photograph {
  int rows = 0, cols = 0;
  std::vector<std::uint8_t> levels;  ///< (rows, cols, 3), R, G, B
};

inline constexpr int kLargestPhotograph = 8192;  ///< pixels along a side

/// Reads a PNG file: RGB, or grey levels, which become equal numbers. Palettes are converted, and
/// 16 bits to the nearest of 8. Throws IoError as require_regular_file() does; InputError for a
/// file that is no PNG, is damaged, is larger, or has transparency.
Photograph read_png(const std::string& path);
/// The same of the bytes of a file. `name`: for messages.
Photograph parse_png(const std::string& bytes, const std::string& name);
/// Returns the bytes of a PNG file. Throws IoError where libpng fails.
std::string png_bytes(const Photograph& photograph);

}  // namespace tangere
