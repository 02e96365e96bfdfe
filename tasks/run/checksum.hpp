// SPDX-License-Identifier: Apache-2.0
// Checksums of the bits of numbers.
#pragma once

#include <cstdint>
#include <span>

namespace tangere {

/// Continues a checksum with the bits of numbers, so +0 and -0 differ. The checksum of an
/// environment begins with the number of its episode.
std::uint64_t chain_bits(std::uint64_t checksum, std::span<const double> numbers);
std::uint64_t chain_bits(std::uint64_t checksum, std::span<const float> numbers);

}  // namespace tangere
