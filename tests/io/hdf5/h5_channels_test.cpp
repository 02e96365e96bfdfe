// SPDX-License-Identifier: Apache-2.0
// Rows of channels come back as they were given, whole or in parts, and each compressed chunk is
// written once.
#include "io/hdf5/h5_channels.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

hsize_t chunks_in(const h5::Id& file, const std::string& name) {
  const h5::Id dataset = h5::open_dataset(file, name);
  const h5::Id space(H5Dget_space(dataset.get()));
  hsize_t count = 0;
  EXPECT_GE(H5Dget_num_chunks(dataset.get(), space.get(), &count), 0) << name;
  return count;
}

std::vector<std::int32_t> row_of(std::int64_t row, std::size_t width) {
  std::vector<std::int32_t> numbers(width);
  std::iota(numbers.begin(), numbers.end(), static_cast<std::int32_t>(row) * 1000003);
  return numbers;
}

std::vector<std::int32_t> read_row(const h5::Id& file, const Channel& channel, hsize_t row) {
  const h5::Id dataset = h5::open_dataset(file, channel.name);
  h5::Dims offset(channel.shape.size() + 1, 0), count{1};
  offset[0] = row;
  count.insert(count.end(), channel.shape.begin(), channel.shape.end());
  std::vector<std::int32_t> numbers(channel.width());
  h5::read_box<std::int32_t>(dataset, offset, count, numbers.data());
  return numbers;
}

Channel channel_of(std::vector<std::uint64_t> shape, std::int64_t rows) {
  return {.name = "group/one",
          .type = NumberType::int32,
          .shape = std::move(shape),
          .rows = rows,
          .storage = Channel::Storage::compressed};
}

TEST(Channels, ChunksAreWrittenWholeAndRowsComeBack) {
  const Channel channel = channel_of({2048, 16}, 19);  // 128 KiB a row, 8 rows a chunk of 1 MiB
  const h5::Id file = h5::create_memory_file();
  h5::ChannelWriter writer(file, channel);
  for (std::int64_t row = 0; row < 19; ++row) {
    const std::vector<std::int32_t> numbers = row_of(row, channel.width());
    writer.write(std::span<const std::int32_t>(numbers).first(16 * 5));
    EXPECT_EQ(writer.rows(), row);
    writer.write(std::span<const std::int32_t>(numbers).subspan(16 * 5));
    const hsize_t whole = static_cast<hsize_t>(row + 1) / 8;
    EXPECT_EQ(chunks_in(file, channel.name), row == 18 ? 3 : whole) << "after row " << row;
  }
  EXPECT_EQ(writer.rows(), 19);
  for (const hsize_t row : {0, 7, 8, 17, 18})
    EXPECT_EQ(read_row(file, channel, row), row_of(std::int64_t(row), channel.width())) << row;
}

/// A row of more than a chunk is cut between environments, wherever its parts end.
TEST(Channels, ARowMayTakeSeveralChunks) {
  const Channel channel = channel_of({20000, 16}, 2);
  const h5::Id file = h5::create_memory_file();
  h5::ChannelWriter writer(file, channel);
  for (const std::int64_t row : {0, 1}) {
    const std::vector<std::int32_t> numbers = row_of(row, channel.width());
    for (std::size_t e = 0; e < 20000; e += 3000)
      writer.write(std::span<const std::int32_t>(numbers).subspan(
          16 * e, 16 * std::min<std::size_t>(3000, 20000 - e)));
    EXPECT_EQ(chunks_in(file, channel.name), row == 0 ? 2 : 4);
  }
  for (const std::int64_t row : {0, 1})
    EXPECT_EQ(read_row(file, channel, hsize_t(row)), row_of(row, channel.width()));
}

TEST(Channels, WhatDoesNotFitIsRefused) {
  const h5::Id file = h5::create_memory_file();
  h5::ChannelWriter writer(file, channel_of({2, 3}, 1));
  const std::vector<std::int32_t> numbers(7);
  const std::span<const std::int32_t> all(numbers);
  EXPECT_THROW(writer.write(all), IoError);
  EXPECT_THROW(writer.write(all.first(2)), IoError) << "a part of an environment";
  writer.write(all.first(3));
  EXPECT_THROW(writer.write(all.first(6)), IoError);
  writer.write(all.first(3));
  EXPECT_THROW(writer.write(all.first(6)), IoError) << "a row too many";
}

/// Rows without numbers are counted, as those of controls where there are none.
TEST(Channels, RowsMayBeEmpty) {
  const h5::Id file = h5::create_memory_file();
  h5::ChannelWriter writer(file, channel_of({2, 0}, 3));
  for (int row = 0; row < 3; ++row) writer.write(std::span<const std::int32_t>());
  EXPECT_EQ(writer.rows(), 3);
}

}  // namespace
}  // namespace tangere
