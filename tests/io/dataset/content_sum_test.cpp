// SPDX-License-Identifier: Apache-2.0
// Tests which changes of numbers and places change the checksum of a data set.
#include "io/dataset/content_sum.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <vector>

namespace tangere {
namespace {

using Bytes = std::vector<unsigned char>;

/// Rows of `row_bytes` each from row 4 of dataset 1 of episode 1 on.
std::uint64_t sum_of(const Bytes& bytes, std::size_t row_bytes, bool whole_rows = false) {
  ContentSum sum(whole_rows);
  sum.add(1, 1, 4, std::int64_t(bytes.size() / row_bytes), row_bytes, bytes.data());
  return sum.value();
}

Bytes random_bytes(std::size_t count) {
  std::mt19937 random(5);
  Bytes bytes(count);
  for (unsigned char& byte : bytes) byte = static_cast<unsigned char>(random());
  return bytes;
}

TEST(ContentSum, DependsOnPlacesAndBytesButNotOnOrder) {
  const Bytes bytes = random_bytes(40);
  for (const bool whole_rows : {false, true}) {
    const auto sum = [&](std::int64_t episode, std::size_t name, std::int64_t row,
                         std::size_t width) {
      ContentSum s(whole_rows);
      s.add(episode, name, row, 1, width, bytes.data());
      return s.value();
    };
    const std::uint64_t plain = sum(1, 1, 1, 40);
    EXPECT_NE(sum(2, 1, 1, 40), plain);
    EXPECT_NE(sum(1, 2, 1, 40), plain);
    EXPECT_NE(sum(1, 1, 2, 40), plain);
    EXPECT_NE(sum(1, 1, 1, 36), plain);
    ContentSum one_by_one(whole_rows), second(whole_rows);
    second.add(1, 1, 5, 1, 20, bytes.data() + 20);
    one_by_one.add(second);
    one_by_one.add(1, 1, 4, 1, 20, bytes.data());
    EXPECT_EQ(sum_of(bytes, 20, whole_rows), one_by_one.value());
  }
}

/// Every bit counts, and so does the place of every word: in its block of 256 and among blocks.
TEST(ContentSum, ChangesWithEveryBitAndWithWordsThatChangePlaces) {
  const std::size_t row = 4 * 700;  // two blocks and a part of one
  const Bytes bytes = random_bytes(row);
  const std::uint64_t whole = sum_of(bytes, row);
  for (std::size_t bit = 0; bit < 8 * row; ++bit) {
    Bytes damaged = bytes;
    damaged[bit / 8] = static_cast<unsigned char>(damaged[bit / 8] ^ (1 << bit % 8));
    ASSERT_NE(sum_of(damaged, row), whole) << "bit " << bit;
  }
  for (std::size_t word = 0; word + 1 < 700; ++word)
    for (const std::size_t other : {word + 1, (word + 256) % 700, (word + 350) % 700}) {
      Bytes damaged = bytes;
      std::swap_ranges(damaged.begin() + long(4 * word), damaged.begin() + long(4 * word + 4),
                       damaged.begin() + long(4 * other));
      ASSERT_NE(sum_of(damaged, row), whole) << word << " and " << other;
    }
}

/// Zeros change the checksum only by the size of the row: a row of zeros is not one that is
/// missing, and not a shorter one.
TEST(ContentSum, LeavesOutZerosOfARowButNoRow) {
  const std::size_t row = 4 * 700;
  Bytes bytes = random_bytes(row);
  std::fill(bytes.begin() + 4 * 100, bytes.begin() + 4 * 530, static_cast<unsigned char>(0));
  RowSum parts;  // in another order, without the zeros
  parts.add(4 * 530, std::span(bytes).subspan(4 * 530));
  parts.add(0, std::span(bytes).first(4 * 7));
  parts.add(4 * 7, std::span(bytes).subspan(4 * 7, 4 * 93));
  ContentSum sum;
  sum.add(1, 1, 4, row, parts);
  EXPECT_EQ(sum.value(), sum_of(bytes, row));

  EXPECT_EQ(RowSum().value(), 0U);
  const Bytes zeros(2 * row, 0);
  EXPECT_NE(sum_of(zeros, row), 0U);
  EXPECT_NE(sum_of(zeros, row), sum_of(zeros, 2 * row));
  ContentSum of_nothing;
  for (const std::int64_t k : {4, 5}) of_nothing.add(1, 1, k, row, RowSum());
  EXPECT_EQ(of_nothing.value(), sum_of(zeros, row));
}

/// Compares with a program in Python that hashes as format_version 5 did.
TEST(ContentSum, OfWholeRowsIsThatOfTheFormatBefore) {
  Bytes bytes;
  for (int k = 0; k < 80; ++k) bytes.push_back(static_cast<unsigned char>(7 * k + 3));
  ContentSum sum(true);
  sum.add(3, 2, 5, 2, 40, bytes.data());
  EXPECT_EQ(sum.value(), 0x399EF4996D695742ULL);
}

/// Rows of bytes may have any size, such as those of a picture of 5 × 5 pixels.
TEST(ContentSum, ARowOfBytesEndsWithZeros) {
  const std::array<unsigned char, 8> row{1, 2, 3, 4, 5, 6, 7, 0};
  for (const std::size_t size : {1U, 2U, 3U, 5U, 6U, 7U}) {
    std::array<unsigned char, 8> padded{};
    std::copy_n(row.begin(), size, padded.begin());
    RowSum sum, expected;
    sum.add(4, std::span(row).first(size));
    expected.add(4, padded);
    EXPECT_EQ(sum.value(), expected.value()) << size;
    EXPECT_NE(sum.value(), 0U);
  }
}

TEST(ContentSum, FindsWhatIsNotZero) {
  for (const std::size_t count : {1UL, 7UL, 8UL, 63UL, 64UL, 600UL}) {
    Bytes bytes(count, 0);
    EXPECT_FALSE(any_bit(bytes));
    for (std::size_t k = 0; k < count; ++k) {
      bytes[k] = 128;
      EXPECT_TRUE(any_bit(bytes)) << k << " of " << count;
      bytes[k] = 0;
    }
    std::vector<float> numbers(count, -0.0F);
    EXPECT_FALSE(any_number(std::span<const float>(numbers)));
    for (float& x : numbers) {
      x = 1e-45F;
      EXPECT_TRUE(any_number(std::span<const float>(numbers)));
      x = -0.0F;
    }
  }
}

}  // namespace
}  // namespace tangere
