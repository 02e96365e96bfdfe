// SPDX-License-Identifier: Apache-2.0
// Which numbers a tactile field is computed with. The state of a batch is always in double.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace tangere {

enum class Precision : std::uint8_t {
  f64,    ///< "double"
  mixed,  ///< "mixed": poses and what cancels in double, points in float; 1e-6 of the field's peak (docs/contact.md)
};

inline const char* to_string(Precision value) { return value == Precision::f64 ? "double" : "mixed"; }

/// Nothing for other names.
inline std::optional<Precision> parse_precision(std::string_view name) {
  for (const Precision p : {Precision::f64, Precision::mixed})
    if (name == to_string(p)) return p;
  return std::nullopt;
}

}  // namespace tangere
