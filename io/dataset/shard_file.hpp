// SPDX-License-Identifier: Apache-2.0
// One HDF5 file of a data set. Its bytes do not depend on the order in which blocks finish. The
// library writes the metadata; the bytes of the demos are laid out here.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "engine/rows/episode_sink.hpp"
#include "io/dataset/dataset_layout.hpp"
#include "io/dataset/demo_format.hpp"
#include "io/dataset/label_sum.hpp"
#include "io/dataset/placed_file.hpp"
#include "io/dataset/prepared_piece.hpp"
#include "io/files/part_file.hpp"
#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_trees.hpp"

namespace tangere {

class ShardFile {
 public:
  /// Creates `<path>.part`. Throws IoError, also when `path` exists and `overwrite` is false.
  /// `layout`, `format` and `held_bytes` must outlive this object. `held_bytes` counts what all
  /// shards of a data set together keep in memory.
  ShardFile(const std::string& path, const DatasetLayout& layout, const DemoFormat& format,
            EpisodeRange range, bool overwrite, std::size_t& held_bytes);
  ShardFile(const ShardFile&) = delete;
  ShardFile& operator=(const ShardFile&) = delete;

  /// `prepared` belongs to the same piece.
  void write(const EpisodeRows& rows, PreparedPiece prepared);
  void finish(std::int64_t first_episode, std::span<const FailedEpisode> failures,
              const EpisodeSteps& steps);
  /// Whether every block has finished.
  [[nodiscard]] bool complete() const { return unfinished_ == 0; }
  /// Names the demos that did not fail, reads everything back, syncs and renames.
  void commit();

 private:
  /// Bytes whose place in the file is not known before their block has its turn. They are in
  /// memory, or in the spill file if memory is full.
  struct Held {
    std::vector<unsigned char> bytes;
    std::uint64_t spilled = h5::kNowhere;  // address in the spill file
    std::size_t size = 0;
  };
  struct Chunk {
    h5::FileChunk place;
    Held held;
  };
  struct Picture {
    std::int64_t row;
    Held held;
  };
  struct Demo {
    DemoFacts facts;
    bool failed = false;
    ContentSum sum;
    std::vector<std::uint64_t> addresses;        // per dataset, once known
    std::vector<std::vector<Held>> rows;         // per contiguous dataset, in order
    std::vector<std::vector<Chunk>> chunks;      // per dataset
    std::vector<std::vector<Picture>> pictures;  // per dataset
    std::vector<std::uint32_t> widths;           // per dataset: bytes of a row of JPEG files
  };
  struct Block {
    std::vector<Demo> demos;
    std::uint64_t base = 0;
    bool finished = false;
  };

  void describe();
  void complete_description(std::uint64_t data);
  [[nodiscard]] bool waits() const { return sizes_vary_; }  // sizes are known when a block ends
  Block& block_of(const EpisodeRows& rows);
  void give_place(Block& block, std::int64_t first_episode);
  void write_slices(Block& block, const EpisodeRows& rows, int episode);
  [[nodiscard]] std::span<const unsigned char> constant(std::size_t dataset,
                                                        std::int64_t rows) const;
  void hold(Block& block, std::int64_t first_episode, PreparedPiece& prepared);
  [[nodiscard]] Held hold(std::vector<unsigned char> bytes, const BytesOf& what);
  void place(std::uint64_t address, Held& held, const BytesOf& what);
  void give_place_to_held(Block& block);
  void write_pictures(Demo& demo, std::size_t dataset, const BytesOf& what);
  void write_held(Block& block, std::int64_t first_episode);
  void close_block(Block& block, std::int64_t first_episode, const h5::Bytes& indexes);
  void record_failures();

  const DatasetLayout& layout_;
  const DemoFormat& format_;
  std::int64_t first_episode_, end_, unfinished_,
      next_;                 // unfinished blocks; the first one without a place
  bool sizes_vary_;          // chunks or JPEG files
  std::size_t& held_bytes_;  // in memory, of all shards
  PartFile part_;
  std::optional<PartFile> spill_;  // has no name
  std::uint64_t spilled_bytes_ = 0;
  std::vector<std::vector<unsigned char>> read_back_;  // from the spill file, until flush()
  PlacedFile placed_;
  h5::Id file_;
  std::uint64_t texts_ = 0, begin_ = 0;   // addresses of the texts of demos and of the first block
  std::uint64_t free_ = 0;                // address behind the last used byte
  std::map<std::int64_t, Block> blocks_;  // by their first episode
  std::vector<float> no_rewards_;
  std::vector<std::int8_t> dones_;
  std::vector<h5::FileMember> members_;
  std::vector<FailedEpisode> failures_;
  std::map<std::int64_t, DemoFacts> facts_of_failures_;  // by episode
  std::int64_t rows_ = 0;                                // in demos, without failed ones
  ContentSum sum_;
  LabelSum labels_;
  EpisodeSteps steps_;
};

}  // namespace tangere
