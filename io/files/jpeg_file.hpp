// SPDX-License-Identifier: Apache-2.0
// Photographs as JPEG files, by libjpeg-turbo.
#pragma once

#include <span>
#include <string>

#include "io/files/png_file.hpp"

namespace tangere {

/// Returns the bytes of a JPEG file of a picture (rows, cols, 3), R, G, B. `quality`: 1 to 100. The
/// same picture has the same bytes with one release of libjpeg-turbo. Throws IoError where the
/// library fails.
std::string jpeg_bytes(int rows, int cols, std::span<const std::uint8_t> levels, int quality);
/// Rows and columns of the picture.
struct JpegSize {
  int rows = 0, cols = 0;
  bool operator==(const JpegSize&) const = default;
};
/// Reads the head of a JPEG file alone. Throws as parse_jpeg() does.
JpegSize jpeg_size(std::span<const char> bytes, const std::string& name);
/// Reads the bytes of a JPEG file; grey levels become equal numbers. `name`: for messages. Throws
/// InputError for bytes that are no JPEG, are damaged, or are of a picture that is larger than
/// kLargestPhotograph.
Photograph parse_jpeg(std::span<const char> bytes, const std::string& name);

}  // namespace tangere
