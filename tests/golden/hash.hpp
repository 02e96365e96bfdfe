// SPDX-License-Identifier: Apache-2.0
// XXH3 of the bits of numbers and of texts.
#pragma once

#include <fmt/format.h>
#include <xxhash.h>

#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace tangere::testing {

/// Hash of everything that was added, in its order. +0 and -0 differ.
class Hash {
 public:
  void add(std::span<const double> numbers) { add(numbers.data(), numbers.size_bytes()); }
  void add(std::string_view text) { add(text.data(), text.size()); }
  /// Returns 16 hexadecimal digits.
  [[nodiscard]] std::string text() const { return fmt::format("{:016x}", value_); }

 private:
  void add(const void* bytes, std::size_t count) {
    value_ = XXH3_64bits_withSeed(bytes, count, value_);
  }

  XXH64_hash_t value_ = 0;
};

/// Name of the rounding of a·b + c: "fused" (once, AVX2 and AVX-512) or "plain" (twice, SSE2 and
/// scalar). Instruction sets of one rounding have the same bits.
inline const char* rounding(std::string_view instruction_set) {
  return instruction_set.starts_with("avx") ? "fused" : "plain";
}

}  // namespace tangere::testing
