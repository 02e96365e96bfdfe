// SPDX-License-Identifier: Apache-2.0
// The number type in which a tactile field is computed. The state of a batch is always in double.
#pragma once

#include <cstdint>

namespace tangere {

enum class Precision : std::uint8_t {
  f64,    ///< "double"
  mixed,  ///< "mixed": double for poses and whatever cancels, float for points; error 1e-6 of the
          ///< field's peak (docs/contact.md)
};

inline const char* to_string(Precision value) {
  return value == Precision::f64 ? "double" : "mixed";
}

}  // namespace tangere
