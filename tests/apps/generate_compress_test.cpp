// SPDX-License-Identifier: Apache-2.0
// Compressed shards: the same numbers, in chunks that HDF5's own filters read.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5.hpp"
#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using ::testing::HasSubstr;
using testing::IsEmpty;

const std::string kShard = "/shard-00000.h5";

json generate(const Folder& folder, const std::string& what, const std::string& set,
              const Words& more) {
  return run_json(folder, Words{"generate", what, "--output", set, "--seed", "5"} + more);
}

std::uint64_t sum(const Folder& folder, const std::string& set) {
  return h5::read_numbers<std::uint64_t>(h5::open_file(folder.path(set + kShard)), "content_sum")
      .at(0);
}

struct Layout {
  std::vector<hsize_t> chunk;  ///< none: contiguous
  std::vector<H5Z_filter_t> filters;
};

Layout layout_of(const Folder& folder, const std::string& set, const std::string& name) {
  const h5::Id file = h5::open_file(folder.path(set + kShard)),
               dataset = h5::open_dataset(file, name);
  const h5::Id properties(H5Dget_create_plist(dataset.get()));
  Layout layout;
  if (H5Pget_layout(properties.get()) != H5D_CHUNKED) return layout;
  layout.chunk.resize(h5::dimensions(dataset).size());
  H5Pget_chunk(properties.get(), static_cast<int>(layout.chunk.size()), layout.chunk.data());
  for (int i = 0; i < H5Pget_nfilters(properties.get()); ++i) {
    unsigned flags = 0, config = 0;
    std::size_t count = 0;
    layout.filters.push_back(H5Pget_filter2(properties.get(), static_cast<unsigned>(i), &flags,
                                            &count, nullptr, 0, nullptr, &config));
  }
  return layout;
}

TEST(GenerateCompress, KeepsEveryNumberInBothPrecisionsOnAnyThreads) {
  for (const char* precision : {"mixed", "double"}) {
    const Folder folder;
    const std::string small = scene("rolling_ball_small.xml");
    const Words size{"--episodes", "20", "--steps",     "200",
                     "--every",    "5",  "--precision", precision};
    generate(folder, small, "none", size + Words{"--tactile", "dense"});
    const json answer =
        generate(folder, small, "one", size + Words{"--compress", "deflate", "--threads", "1"});
    generate(folder, small, "three", size + Words{"--compress", "deflate", "--threads", "3"});
    EXPECT_EQ(answer.at("compress"), "deflate");
    EXPECT_THAT(answer.at("limited_by").get<std::string>(),
                testing::AnyOf("simulation", "tiles and compression", "writing"));
    EXPECT_EQ(sum(folder, "one"), sum(folder, "none"));
    EXPECT_EQ(sum(folder, "three"), sum(folder, "none"));
    EXPECT_TRUE(folder.read("three" + kShard) == folder.read("one" + kShard));
    EXPECT_EQ(check_shard(folder.path("three" + kShard)).demos,
              20);  // reads through HDF5's own filters
    EXPECT_LT(std::filesystem::file_size(folder.path("one" + kShard)),
              std::filesystem::file_size(folder.path("none" + kShard)) / 2);
  }
}

TEST(GenerateCompress, ChunksAreOfAFewRowsAndSmallRowsStayAsTheyAre) {
  const Folder folder;
  const Words size{"--episodes", "3", "--steps", "200", "--every", "5", "--compress", "deflate"};
  generate(folder, scene("rolling_ball_small.xml"), "tiles", size);
  EXPECT_THAT(layout_of(folder, "tiles", "data/demo_1/obs/pad").chunk,
              ElementsAre(8, 16, 16, 3));  // 24 KiB
  generate(folder, scene("rolling_ball_small.xml"), "set", size + Words{"--tactile", "dense"});
  const Layout pad = layout_of(folder, "set", "data/demo_1/obs/pad");
  EXPECT_THAT(pad.chunk, ElementsAre(4, 32, 32, 3));  // 48 KiB
  EXPECT_THAT(pad.filters, ElementsAre(H5Z_FILTER_SHUFFLE, H5Z_FILTER_DEFLATE));
  EXPECT_THAT(layout_of(folder, "set", "data/demo_1/final_obs/pad").chunk,
              ElementsAre(1, 32, 32, 3));
  for (const char* name : {"obs/q", "obs/v", "actions", "rewards", "final_obs/q"})
    EXPECT_THAT(layout_of(folder, "set", std::string("data/demo_1/") + name).chunk, IsEmpty())
        << name;
}

TEST(GenerateCompress, EpisodesOfATaskShorterThanAChunkAreOneChunk) {
  const Folder folder;
  generate(folder, "box_pushing", "none", {"--episodes", "18"});
  generate(folder, "box_pushing", "deflate", {"--episodes", "18", "--compress", "deflate"});
  EXPECT_EQ(sum(folder, "none"), sum(folder, "deflate"));
  EXPECT_EQ(run(folder, {"validate", "deflate"}).exit_code, 0);
}

TEST(GenerateCompress, EveryKindHoldsTheSameNumbers) {
  const Folder folder;
  const Words size{"--episodes", "20", "--steps", "100", "--every", "5"};
  const std::string small = scene("rolling_ball_small.xml");
  generate(folder, small, "plain", size + Words{"--tactile", "dense"});
  for (const char* compress : {"none", "deflate", "lz4"}) {
    const std::string set = std::string("tiles-") + compress;
    const json answer =
        generate(folder, small, set, size + Words{"--compress", compress, "--threads", "1"});
    EXPECT_EQ(answer.at("tactile"), "sparse");
    EXPECT_EQ(sum(folder, set), sum(folder, "plain"));
    EXPECT_EQ(run(folder, {"validate", set}).exit_code, 0);
    EXPECT_THAT(layout_of(folder, set, "data/demo_1/obs/pad").chunk,
                ElementsAre(testing::_, 16, 16, 3));
    generate(folder, small, set + "2", size + Words{"--compress", compress, "--threads", "3"});
    EXPECT_TRUE(folder.read(set + kShard) == folder.read(set + "2" + kShard)) << compress;
    EXPECT_LT(std::filesystem::file_size(folder.path(set + kShard)),
              std::filesystem::file_size(folder.path("plain" + kShard)));
  }
  const Outcome lz4 = run(folder, {"generate", small, "--output", "lz4", "--episodes", "3",
                                   "--steps", "20", "--compress", "lz4"});
  EXPECT_THAT(lz4.err, HasSubstr("plug-in"));
  EXPECT_THAT(layout_of(folder, "lz4", "data/demo_1/obs/pad").filters,
              ElementsAre(H5Z_FILTER_SHUFFLE, 32004));
  // Copied unchanged, and read through links.
  EXPECT_EQ(run(folder, {"merge", "tiles-lz4", "--copy", "--overwrite"}).exit_code, 0);
  EXPECT_EQ(run(folder, {"validate", "tiles-lz4/robomimic.hdf5"}).exit_code, 0);
  EXPECT_EQ(run(folder, {"merge", "tiles-none", "--overwrite"}).exit_code, 0);
  EXPECT_EQ(run(folder, {"validate", "tiles-none/robomimic.hdf5"}).exit_code, 0);
}

TEST(GenerateCompress, RecordsWhatWasAskedFor) {
  const Folder folder;
  const Words size{"--episodes", "20"};
  generate(folder, "box_pushing", "some", {"--episodes", "20", "--record", "goal,q"});
  generate(folder, "box_pushing", "all", size);
  const h5::Id some = h5::open_file(folder.path("some" + kShard)),
               all = h5::open_file(folder.path("all" + kShard));
  EXPECT_THAT(h5::read_texts(h5::open_group(some, "scene"), "observations"),
              ElementsAre("q", "goal"));
  EXPECT_EQ(h5::read_texts(h5::open_group(some, "scene"), "observation_units").size(), 2U);
  EXPECT_FALSE(h5::has_link(h5::open_group(some, "data/demo_7/obs"), "tactile"));
  for (const char* name : {"data/demo_7/obs/goal", "data/demo_7/obs/q", "data/demo_7/final_obs/q",
                           "data/demo_7/rewards"}) {
    const h5::Id a = h5::open_dataset(some, name), b = h5::open_dataset(all, name);
    const h5::Dims dims = h5::dimensions(a);
    ASSERT_EQ(dims, h5::dimensions(b)) << name;
    std::size_t count = 1;
    for (const hsize_t n : dims) count *= n;
    std::vector<float> of_a(count), of_b(count);
    h5::read_box(a, h5::Dims(dims.size(), 0), dims, of_a.data());
    h5::read_box(b, h5::Dims(dims.size(), 0), dims, of_b.data());
    EXPECT_EQ(of_a, of_b) << name;
  }
  EXPECT_EQ(run(folder, {"validate", "some"}).exit_code, 0);
  for (const auto& [list, message] : std::vector<std::pair<std::string, std::string>>{
           {"q,tactil", "did you mean 'tactile'?"},
           {"q,,v", "expected names separated by commas"}}) {
    const Outcome wrong = run(
        folder, {"generate", "box_pushing", "--output", "x", "--episodes", "3", "--record", list});
    EXPECT_EQ(wrong.exit_code, 2) << list;
    EXPECT_THAT(wrong.err, HasSubstr(message));
  }
}

TEST(GenerateCompress, IsASettingOfItsOwn) {
  const Folder folder;
  const Words size{"--episodes", "3", "--steps", "20"};
  generate(folder, scene("rolling_ball_small.xml"), "set", size);
  const Outcome other =
      run(folder, {"generate", scene("rolling_ball_small.xml"), "--output", "set", "--episodes",
                   "3", "--steps", "20", "--seed", "5", "--resume", "--compress", "deflate"});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("compression: none there, deflate here"));
  const Outcome wrong = run(folder, {"generate", scene("rolling_ball_small.xml"), "--output", "x",
                                     "--episodes", "3", "--compress", "defalte"});
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, HasSubstr("unknown compression 'defalte'; did you mean 'deflate'?"));
}

}  // namespace
}  // namespace tangere::apps
