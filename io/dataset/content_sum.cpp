// SPDX-License-Identifier: Apache-2.0
// content_sum = Σ over rows of mix(key(episode, dataset, row, bytes of the row), L), modulo 2⁶⁴
// L           = Σ over 32-bit words of the row: B(k / 256) · W(k mod 256) · word k, modulo 2⁶⁴
//
// B and W are odd and pseudorandom. So L differs if one word differs, and L of zeros is 0.
// Compilers vectorise the inner sum if W is kept in halves (io/CMakeLists.txt sets -O3).
#include "io/dataset/content_sum.hpp"

#include <algorithm>
#include <array>
#include <cstring>

namespace tangere {
namespace {

constexpr std::size_t kWord = sizeof(std::uint32_t), kBlock = 256;  // words

constexpr std::uint64_t mix(std::uint64_t hash, std::uint64_t word) {
  hash = (hash ^ word) * 0x9E3779B97F4A7C15ULL;  // odd: invertible, so no bit of a word is lost
  return hash ^ (hash >> 32);
}

/// Odd and pseudorandom. Factors of blocks and of words have numbers of their own.
constexpr std::uint64_t factor(std::uint64_t number) {
  return mix(mix(mix(0x6A09E667F3BCC909ULL, number), number), number) | 1;
}

struct Factors {
  std::array<std::uint32_t, kBlock> low{}, high{};
};

constexpr Factors factors_of_words() {
  Factors factors;
  for (std::size_t k = 0; k < kBlock; ++k) {
    const std::uint64_t whole = factor(k);
    factors.low[k] = static_cast<std::uint32_t>(whole);
    factors.high[k] = static_cast<std::uint32_t>(whole >> 32);
  }
  return factors;
}

constexpr Factors kFactors = factors_of_words();

/// The sum of words within a block, from its word `first` on.
std::uint64_t sum_in_block(const unsigned char* bytes, std::size_t first, std::size_t count) {
  const std::uint32_t* const low = kFactors.low.data() + first;
  const std::uint32_t* const high = kFactors.high.data() + first;
  std::uint64_t low_sum = 0, high_sum = 0;
  for (std::size_t k = 0; k < count; ++k) {
    std::uint32_t word = 0;
    std::memcpy(&word, bytes + k * kWord, kWord);
    low_sum += std::uint64_t{word} * low[k];
    high_sum += std::uint64_t{word} * high[k];
  }
  return low_sum + (high_sum << 32);
}

/// The hash of a row up to format_version 5. It hashes four words side by side.
std::uint64_t hash_of_whole_row(std::uint64_t key, const unsigned char* bytes, std::size_t count) {
  std::array<std::uint64_t, 4> hash{}, words{};
  hash[0] = mix(key, count);  // count: zeros at the end change the hash
  for (std::size_t lane = 1; lane < hash.size(); ++lane) hash[lane] = mix(hash[lane - 1], lane);
  for (; count >= sizeof words; bytes += sizeof words, count -= sizeof words) {
    std::memcpy(words.data(), bytes, sizeof words);
    for (std::size_t lane = 0; lane < hash.size(); ++lane)
      hash[lane] = mix(hash[lane], words[lane]);
  }
  words = {};
  std::memcpy(words.data(), bytes, count);
  for (std::size_t lane = 0; lane < hash.size(); ++lane) hash[lane] = mix(hash[lane], words[lane]);
  return mix(mix(mix(hash[0], hash[1]), hash[2]), hash[3]);
}

std::uint64_t key_of(std::int64_t episode, std::size_t name, std::int64_t row) {
  return mix(mix(mix(0, static_cast<std::uint64_t>(episode)), name),
             static_cast<std::uint64_t>(row));
}

}  // namespace

void RowSum::add(std::size_t offset, std::span<const unsigned char> bytes) {
  if (const std::size_t rest = bytes.size() % kWord; rest > 0) {  // the end of a row of bytes
    std::array<unsigned char, kWord> last{};
    std::copy(bytes.end() - static_cast<std::ptrdiff_t>(rest), bytes.end(), last.begin());
    add(offset + bytes.size() - rest, last);
    bytes = bytes.first(bytes.size() - rest);
  }
  for (std::size_t word = offset / kWord; !bytes.empty();) {
    const std::size_t first = word % kBlock, count = std::min(kBlock - first, bytes.size() / kWord);
    sum_ += factor(kBlock + word / kBlock) * sum_in_block(bytes.data(), first, count);
    word += count;
    bytes = bytes.subspan(count * kWord);
  }
}

void ContentSum::add(std::int64_t episode, std::size_t name, std::int64_t first_row,
                     std::int64_t rows, std::size_t row_bytes, const void* data) {
  const auto* bytes = static_cast<const unsigned char*>(data);
  if (row_bytes == 0) return;
  for (std::int64_t row = first_row; row < first_row + rows; ++row, bytes += row_bytes) {
    if (whole_rows_) {
      sum_ += hash_of_whole_row(key_of(episode, name, row), bytes, row_bytes);
      continue;
    }
    RowSum numbers;
    numbers.add(0, {bytes, row_bytes});
    add(episode, name, row, row_bytes, numbers);
  }
}

void ContentSum::add(std::int64_t episode, std::size_t name, std::int64_t row,
                     std::size_t row_bytes, const RowSum& numbers) {
  sum_ += mix(mix(key_of(episode, name, row), row_bytes), numbers.value());
}

bool any_bit(std::span<const unsigned char> bytes) {
  std::uint64_t all = 0;
  for (; bytes.size() >= sizeof all; bytes = bytes.subspan(sizeof all)) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data(), sizeof word);
    all |= word;
  }
  for (const unsigned char byte : bytes) all |= byte;
  return all != 0;
}

template <class T>
bool any_number(std::span<const T> numbers) {
  constexpr std::size_t kTogether = 256;  // without a branch between them
  while (!numbers.empty()) {
    const std::span<const T> part = numbers.first(std::min(kTogether, numbers.size()));
    int any = 0;
    for (const T x : part) any |= static_cast<int>(x != T{0});
    if (any != 0) return true;
    numbers = numbers.subspan(part.size());
  }
  return false;
}

template bool any_number(std::span<const float>);
template bool any_number(std::span<const double>);
template bool any_number(std::span<const std::uint8_t>);
template bool any_number(std::span<const std::int16_t>);

}  // namespace tangere
