// SPDX-License-Identifier: Apache-2.0
// The exceptions of the whole program, one per exit code. A message reaches the user once and
// unchanged.
#pragma once

#include <stdexcept>
#include <string>

namespace tangere {

/// A scene or a request that cannot be carried out as written (exit code 2). The message names
/// file:line:column where there is one, the value found, what was expected, and the nearest valid
/// name.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Reading or writing failed for a reason outside the request: full disk, no permission, damaged
/// file (exit code 3).
class IoError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Where a piece of a scene was written, for messages of later stages. line 0: made by code, not
/// read from a file.
struct Source {
  std::string file;
  int line = 0;

  /// Returns "file:line: ", or "" when there is no file.
  [[nodiscard]] std::string prefix() const {
    return line > 0 ? file + ":" + std::to_string(line) + ": " : std::string();
  }
};

}  // namespace tangere
