// SPDX-License-Identifier: Apache-2.0
// A multiplication and a rotation spread every bit of a number over the checksum.
#include "tasks/run/checksum.hpp"

#include <array>
#include <bit>

namespace tangere {
namespace {

std::uint64_t mix(std::uint64_t hash, std::uint64_t bits) {
  return std::rotl(hash ^ bits, 29) * 0x9e3779b97f4a7c15U + 0x632be59bd9b4e019U;
}

template <class Bits, class T>
std::uint64_t chain(std::uint64_t checksum, std::span<const T> numbers) {
  // Four independent chains: in a single one each product would wait for the one before.
  std::array<std::uint64_t, 4> chains{checksum, checksum + 1, checksum + 2, checksum + 3};
  for (std::size_t i = 0; i < numbers.size(); ++i)
    chains[i % 4] = mix(chains[i % 4], std::bit_cast<Bits>(numbers[i]));
  for (const std::uint64_t chain : chains) checksum = mix(checksum, chain);
  return checksum;
}

}  // namespace

std::uint64_t chain_bits(std::uint64_t checksum, std::span<const double> numbers) {
  return chain<std::uint64_t>(checksum, numbers);
}
std::uint64_t chain_bits(std::uint64_t checksum, std::span<const float> numbers) {
  return chain<std::uint32_t>(checksum, numbers);
}

}  // namespace tangere
