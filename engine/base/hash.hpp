// SPDX-License-Identifier: Apache-2.0
// Hashes of bytes: XXH3, 64 bits.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace tangere {

/// Returns the hash of bytes. Chain pieces by passing the hash of the one before as `seed`.
std::uint64_t hash_bytes(std::span<const std::byte> bytes, std::uint64_t seed = 0);
inline std::uint64_t hash_bytes(std::string_view text, std::uint64_t seed = 0) {
  return hash_bytes(std::as_bytes(std::span(text)), seed);
}

}  // namespace tangere
