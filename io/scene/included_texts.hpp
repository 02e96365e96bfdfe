// SPDX-License-Identifier: Apache-2.0
// The files that a scene brings in by <include>, as texts, so that a data set has its whole scene.
#pragma once

#include <cstddef>
#include <map>
#include <string>

namespace tangere {

inline constexpr std::size_t kLargestInclude = std::size_t{64} << 20;  ///< [bytes]

/// Place of a file, as <include> names it beside the scene's file → its text.
using IncludedTexts = std::map<std::string, std::string>;

/// Place of the file that `named` leads to from a file at `place`; "" is the place of the scene.
std::string place_from(const std::string& place, const std::string& named);

/// Texts of all files that a scene at `path` includes, and those include. The scene has been read
/// before. Throws IoError for a file that has gone since.
IncludedTexts included_texts(const std::string& path, const std::string& text);

}  // namespace tangere
