// SPDX-License-Identifier: Apache-2.0
// Facts of the arrays of a file, for readers that need nothing else of the library.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace tangere::h5 {

struct ArrayFacts {
  std::string name;                 ///< path in the file
  std::string type;                 ///< type_text()
  std::vector<std::uint64_t> dims;  ///< rows first
};

/// Describes arrays of a file. Throws IoError if the file or one of them is missing.
std::vector<ArrayFacts> arrays_of(const std::string& path, const std::vector<std::string>& names);

}  // namespace tangere::h5
