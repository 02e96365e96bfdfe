// SPDX-License-Identifier: Apache-2.0
// Hashes of the bits of numbers and of texts.
#pragma once

#include <fmt/format.h>

#include <span>
#include <string>
#include <string_view>

#include "engine/base/hash.hpp"

namespace tangere::testing {

/// Hash of everything that was added, in its order. +0 and -0 differ.
class Hash {
 public:
  void add(std::span<const double> numbers) { value_ = hash_bytes(std::as_bytes(numbers), value_); }
  void add(std::string_view text) { value_ = hash_bytes(text, value_); }
  /// Returns 16 hexadecimal digits.
  [[nodiscard]] std::string text() const { return fmt::format("{:016x}", value_); }

 private:
  std::uint64_t value_ = 0;
};

/// Name of the rounding of a·b + c: "fused" (once, AVX2 and AVX-512) or "plain" (twice, SSE2 and
/// scalar). Instruction sets of one rounding have the same bits.
inline const char* rounding(std::string_view instruction_set) {
  return instruction_set.starts_with("avx") ? "fused" : "plain";
}

}  // namespace tangere::testing
