// SPDX-License-Identifier: Apache-2.0
// Tests that HDF5 reads the numbers that were written, after they were shuffled, compressed, cut
// into tiles or left out.
#include "io/dataset/chunk_codec.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <random>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5.hpp"
#include "tests/files.hpp"
#include "tests/io/synthetic_episodes.hpp"

namespace tangere {
namespace {

using ::tangere::testing::Folder;
using ::testing::HasSubstr;

constexpr std::int64_t kRows = 37;

/// Shuffles byte by byte, as the specification of the filter says.
std::vector<unsigned char> shuffled(const std::vector<unsigned char>& data, std::size_t used,
                                    std::size_t width) {
  std::vector<unsigned char> out(data.size(), 0);
  const std::size_t numbers = data.size() / width;
  for (std::size_t k = 0; k < used / width; ++k)
    for (std::size_t b = 0; b < width; ++b) out[b * numbers + k] = data[k * width + b];
  return out;
}

TEST(ChunkCodec, ShufflesAsTheFilterDoes) {
  std::mt19937 random(1);
  for (const std::size_t width : {4UL, 8UL})
    for (const std::size_t numbers : {1UL, 3UL, 16UL, 1023UL, 1024UL, 1025UL, 5000UL})
      for (const std::size_t used : {numbers * width, (numbers + 1) / 2 * width, std::size_t{0}}) {
        std::vector<unsigned char> data(numbers * width), out(numbers * width, 7);
        for (unsigned char& byte : data) byte = static_cast<unsigned char>(random());
        shuffle(data.data(), used, width, out);
        EXPECT_EQ(out, shuffled(data, used, width)) << width << " " << numbers << " " << used;
      }
}

/// An image whose tiles are cut at its edges, and a list of points.
DatasetLayout layout_of(bool single, const std::string& compression, bool sparse) {
  DatasetLayout l = ::tangere::testing::dataset_layout(20, single);
  l.steps = kRows;
  l.every = 1;
  SensorLayout image = l.sensors[0], list = l.sensors[0];
  image.name = "image";
  image.rows = 37;
  image.cols = 50;
  image.points = 37 * 50;
  list.name = "list";
  list.rows = list.cols = 0;
  list.points = 1111;
  l.sensors = {image, list};
  l.compression = compression;
  l.sparse = sparse;
  return l;
}

/// Zeros except for a moving spot. Its noise cannot be compressed.
template <class T>
class Piece {
 public:
  Piece(const DatasetLayout& l, std::int64_t first, int first_row, int rows, bool noise = false) {
    const auto episodes = static_cast<int>(std::min<std::int64_t>(16, l.episodes - first));
    const int with_action = std::min<int>(rows, static_cast<int>(l.rows()) - first_row);
    actions_.resize(static_cast<std::size_t>(episodes * with_action) * l.u_names.size(), 0.5F);
    std::mt19937 random(static_cast<unsigned>(first));
    for (const auto& shape : l.observation_shapes()) {
      std::size_t width = 1;
      for (const std::uint64_t n : shape) width *= n;
      std::vector<T>& all =
          values_.emplace_back(static_cast<std::size_t>(episodes * rows) * width, T{0});
      for (int e = 0; e < episodes; ++e)
        for (int row = 0; row < rows; ++row)
          for (std::size_t k = 0; k < (noise ? width : 30); ++k) {
            const std::size_t at = noise ? k
                                         : (static_cast<std::size_t>(first + e) * 131 +
                                            static_cast<std::size_t>(first_row + row) * 17 + k) %
                                               width;
            const double value =
                noise ? static_cast<double>(random()) : static_cast<double>(first_row + row + 1);
            all[static_cast<std::size_t>(e * rows + row) * width + at] = static_cast<T>(value);
          }
    }
    for (const std::vector<T>& v : values_) observations_.emplace_back(std::span<const T>(v));
    rows_ = {first, episodes, first_row, rows, with_action, actions_, observations_};
  }
  [[nodiscard]] const EpisodeRows& rows() const { return rows_; }

 private:
  std::vector<float> actions_;
  std::vector<std::vector<T>> values_;
  std::vector<Observation> observations_;
  EpisodeRows rows_;
};

template <class T>
std::string write(const Folder& folder, const std::string& name, const DatasetLayout& l,
                  bool pieces) {
  DatasetWriter writer({folder / name}, l);
  std::vector<std::int64_t> blocks;
  for (std::int64_t first = 0; first < l.episodes; first += 16) blocks.push_back(first);
  if (pieces) std::reverse(blocks.begin(), blocks.end());
  for (const std::int64_t first : blocks) {
    const auto all = static_cast<int>(l.rows()) + 1;
    for (int row = 0; row < all; row += pieces ? 16 : all)
      writer.write(Piece<T>(l, first, row, std::min(pieces ? 16 : all, all - row)).rows());
    writer.finish(first, {}, {});
  }
  return writer.shards().at(0);
}

std::uint64_t sum_of(const std::string& shard) {
  return h5::read_numbers<std::uint64_t>(h5::open_file(shard), "content_sum").at(0);
}

/// `single`: every way of compression, dense and sparse; otherwise these take turns.
template <class T>
void check_every_kind(bool single) {
  const Folder folder;
  const std::string plain = write<T>(folder, "plain", layout_of(single, "none", false), false);
  for (const char* compression : {"none", "deflate", "lz4"})
    for (const bool sparse : {false, true}) {
      if (!single && sparse != (compression == std::string("deflate"))) continue;
      const std::string name = std::string(compression) + (sparse ? "-sparse" : "-dense");
      const DatasetLayout l = layout_of(single, compression, sparse);
      const std::string whole = write<T>(folder, name, l, false);
      EXPECT_EQ(check_shard(whole).demos, 20) << name;
      EXPECT_EQ(sum_of(whole), sum_of(plain)) << name;
      if (sparse || l.compression != "none") {
        EXPECT_LT(std::filesystem::file_size(whole), std::filesystem::file_size(plain) * 2 / 3)
            << name;
      }
      EXPECT_TRUE(file_bytes(write<T>(folder, name + "2", l, true)) == file_bytes(whole))
          << name << " depends on pieces";
    }
}

TEST(ChunkCodec, EveryKindHoldsTheSameNumbersWhateverThePieces) {
  check_every_kind<float>(true);
  check_every_kind<double>(false);
}

TEST(ChunkCodec, TilesOfZerosAreNotThere) {
  const Folder folder;
  const std::string shard = write<float>(folder, "set", layout_of(true, "none", true), false);
  const h5::Id file = h5::open_file(shard), image = h5::open_dataset(file, "data/demo_3/obs/image");
  const h5::Id properties(H5Dget_create_plist(image.get()));
  h5::Dims chunk(4);
  ASSERT_EQ(H5Pget_chunk(properties.get(), 4, chunk.data()), 4);
  EXPECT_EQ(chunk[1], 13U) << "three tiles of 37 points, of at most 16 each";
  EXPECT_EQ(chunk[2], 13U) << "four tiles of 50 points";
  const auto rows =
      (kRows + static_cast<std::int64_t>(chunk[0]) - 1) / static_cast<std::int64_t>(chunk[0]);
  hsize_t there = 0;
  const h5::Id space(H5Dget_space(image.get()));
  ASSERT_GE(H5Dget_num_chunks(image.get(), space.get(), &there), 0);
  EXPECT_GT(there, 0U);
  EXPECT_LT(static_cast<std::int64_t>(there), rows * 3 * 4) << "of 3 by 4 tiles";
}

/// Spill files of this process. They have no name any more.
std::vector<std::filesystem::path> spill_files() {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code gone;
    const std::string target = std::filesystem::read_symlink(entry.path(), gone);
    if (!gone && target.ends_with(".spill.part (deleted)")) files.push_back(entry.path());
  }
  return files;
}

double spilled_bytes() {
  double bytes = 0;
  for (const auto& file : spill_files())
    bytes += static_cast<double>(std::filesystem::file_size(file));
  return bytes;
}

/// Writes blocks in this order, in pieces of 16 rows and the rest. `gradient`: 64 × 64 numbers for
/// each row.
std::string write_blocks(const std::string& place, const DatasetLayout& l,
                         const std::vector<std::int64_t>& order, bool noise, bool gradient,
                         double* most_spilled) {
  const auto all = static_cast<int>(l.rows()) + 1;
  DatasetWriter writer({place}, l);
  for (const std::int64_t first : order) {
    std::vector<double> derivatives(gradient ? 16UL * static_cast<std::size_t>(l.rows()) * 64 * 64
                                             : 0);
    for (std::size_t k = 0; k < derivatives.size(); ++k)
      derivatives[k] = static_cast<double>(first) + 1e-6 * static_cast<double>(k);
    const std::span<const double> all_of_it(derivatives);
    for (const int row : {0, 16}) {
      const Piece<float> piece(l, first, row, row == 0 ? 16 : all - 16, noise);
      EpisodeRows rows = piece.rows();
      if (row > 0 && gradient) rows.gradients = {&all_of_it, 1};
      writer.write(rows);
    }
    *most_spilled = std::max(*most_spilled, spilled_bytes());
    writer.finish(first, {}, {});
  }
  EXPECT_EQ(spilled_bytes(), 0) << "all of it has its place";
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(place), {}), 1) << "one shard";
  EXPECT_EQ(check_shard(writer.shards().at(0)).demos, l.episodes);
  return writer.shards().at(0);
}

/// Blocks that wait for an earlier one keep 64 MiB in memory, and the rest in a file without a
/// name. The order changes no byte.
TEST(ChunkCodec, BlocksThatWaitTakeBoundedMemoryAndChangeNoByte) {
  const std::vector<std::int64_t> ascending{0, 16, 32, 48, 64};
  const std::vector<std::int64_t> descending(ascending.rbegin(), ascending.rend());
  for (const bool sparse : {false, true}) {
    const Folder folder;
    DatasetLayout l = layout_of(true, sparse ? "none" : "lz4", sparse);
    l.episodes = 80;
    double spilled = 0, none = 0;
    // 20 MB each, none of which goes away.
    const std::string waited =
        write_blocks(folder / "waited", l, descending, true, false, &spilled);
    const std::string straight =
        write_blocks(folder / "straight", l, ascending, true, false, &none);
    EXPECT_EQ(none, 0);
    EXPECT_GT(spilled, static_cast<double>(std::filesystem::file_size(waited)) - (66 << 20));
    EXPECT_TRUE(file_bytes(waited) == file_bytes(straight)) << sparse;
  }
}

TEST(ChunkCodec, MoreContiguousNumbersBesideChunksThanTheDiskHoldsAreRefused) {
  const Folder folder;
  for (const bool sparse : {false, true}) {
    DatasetLayout l = layout_of(true, sparse ? "none" : "deflate", sparse);
    l.steps = std::int64_t{1} << 40;
    EXPECT_THROW(DatasetWriter({folder / "set"}, l), IoError);
    EXPECT_EQ(folder.entries(), 0U);
  }
}

TEST(ChunkCodec, WhatTheDiskChangesWhileBlocksWaitIsFound) {
  const Folder folder;
  DatasetLayout l = layout_of(true, "none", true);
  l.episodes = 80;
  const auto all = static_cast<int>(l.rows()) + 1;
  {
    DatasetWriter writer({folder / "set"}, l);
    for (const std::int64_t first : {64, 48, 32, 16}) {
      writer.write(Piece<float>(l, first, 0, all, true).rows());
      writer.finish(first, {}, {});
    }
    writer.write(Piece<float>(l, 0, 0, all, true).rows());
    ASSERT_EQ(spill_files().size(), 1U);
    std::fstream(spill_files()[0], std::ios::binary | std::ios::in | std::ios::out)
        .seekp(1000)
        .put('x');
    try {
      writer.finish(0, {}, {});
      FAIL() << "a byte of a chunk was changed";
    } catch (const IoError& error) {
      EXPECT_THAT(error.what(), HasSubstr(".spill.part' is damaged: bytes "));
    }
  }
  EXPECT_FALSE(std::filesystem::exists(folder / "set")) << "no half shard";
}

TEST(ChunkCodec, RowsThatWaitBesideChunksAreBoundedAsWell) {
  const Folder folder;
  DatasetLayout l = layout_of(true, "deflate", false);
  l.episodes = 80;
  l.gradients_of = "jacobians";
  l.gradients = {{"grad_wide", {64, 64}, true, "numbers that are not compressed", {}, {}}};
  for (int k = 0; k < 64; ++k) {
    l.gradients[0].wrt_names.push_back(std::to_string(k));
    l.gradients[0].wrt_units.emplace_back("1");
  }
  double spilled = 0;
  const std::string shard =
      write_blocks(folder / "set", l, {64, 48, 32, 16, 0}, false, true, &spilled);
  EXPECT_GT(spilled, static_cast<double>(std::filesystem::file_size(shard)) - (66 << 20));
  const h5::Id file = h5::open_file(shard);
  for (const int demo : {0, 20, 67}) {
    double number = 0;
    h5::read_box(h5::open_dataset(file, "data/demo_" + std::to_string(demo) + "/grad_wide"),
                 {2, 3, 5}, {1, 1, 1}, &number);
    const int first = demo / 16 * 16;
    EXPECT_EQ(number, first + 1e-6 * (((demo - first) * static_cast<double>(l.rows()) + 2) * 4096 +
                                      3 * 64 + 5))
        << demo;
  }
}

TEST(ChunkCodec, DamagedLz4IsAnErrorOrChangesNothing) {
  const Folder folder;
  DatasetLayout small = layout_of(true, "lz4", false);
  small.episodes = 4;
  const std::string shard = write<float>(folder, "set", small, false);
  const h5::Id file = h5::open_file(shard), image = h5::open_dataset(file, "data/demo_3/obs/image");
  haddr_t address = 0;
  hsize_t size = 0;
  unsigned filters = 0;
  const h5::Id space(H5Dget_space(image.get()));
  ASSERT_GE(H5Dget_chunk_info(image.get(), space.get(), 0, nullptr, &filters, &address, &size), 0);
  const std::string whole = file_bytes(shard);
  std::mt19937 random(3);
  int found = 0;
  for (int trial = 0; trial < 100; ++trial) {
    std::string damaged = whole;
    const std::size_t at = trial < 32 ? static_cast<std::size_t>(trial) / 2 : random() % size;
    damaged[address + at] = static_cast<char>(
        trial % 2 == 0 ? 0xFF : damaged[address + at] + 1 + static_cast<int>(random() % 254));
    if (damaged == whole) continue;
    const std::string path = folder / "damaged.h5";
    std::ofstream(path, std::ios::binary) << damaged;
    try {
      check_shard(path);  // bytes may change but numbers may not: a zero may be a copy
    } catch (const IoError&) {
      ++found;
    }
  }
  EXPECT_GT(found, 40);
}

}  // namespace
}  // namespace tangere
