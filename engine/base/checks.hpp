// SPDX-License-Identifier: Apache-2.0
// Checks of the arguments of public functions: one comparison each, the message out of line.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "engine/base/as_size.hpp"
#include "engine/base/error.hpp"

namespace tangere {

[[noreturn, gnu::cold, gnu::noinline]] inline void refuse_index(const char* what,
                                                                std::int64_t index,
                                                                std::int64_t count) {
  throw InputError(std::string(what) + ' ' + std::to_string(index) +
                   " does not exist; expected a number from 0 to " + std::to_string(count - 1));
}
[[noreturn, gnu::cold, gnu::noinline]] inline void refuse_size(const char* what, std::size_t size,
                                                               std::size_t expected) {
  throw InputError(std::string(what) + ": " + std::to_string(size) + " numbers; expected " +
                   std::to_string(expected));
}

/// Returns the index in the type of containers. Throws InputError unless it is in [0, count).
/// `what` names it, such as "environment".
inline std::size_t checked_index(const char* what, std::int64_t index, std::int64_t count) {
  if (index < 0 || index >= count) refuse_index(what, index, count);
  return as_size(index);
}
/// Throws InputError unless an array has as many numbers as expected.
inline void check_size(const char* what, std::size_t size, std::size_t expected) {
  if (size != expected) refuse_size(what, size, expected);
}

}  // namespace tangere
