// SPDX-License-Identifier: Apache-2.0
// The checksum so far is the seed of the next hash.
#include "tasks/run/checksum.hpp"

#include "engine/base/hash.hpp"

namespace tangere {

std::uint64_t chain_bits(std::uint64_t checksum, std::span<const double> numbers) {
  return hash_bytes(std::as_bytes(numbers), checksum);
}
std::uint64_t chain_bits(std::uint64_t checksum, std::span<const float> numbers) {
  return hash_bytes(std::as_bytes(numbers), checksum);
}

}  // namespace tangere
