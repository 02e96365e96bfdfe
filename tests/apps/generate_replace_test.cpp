// SPDX-License-Identifier: Apache-2.0
// Tests a shared folder whose shards are replaced one by one. The merged files never mix two runs,
// and are not made while shards change.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "io/files/folder_lock.hpp"
#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;

/// 80 episodes, five blocks.
Words generate(const std::string& seed, const Words& more) {
  return Words{"generate",   scene("rolling_ball_small.xml"),
               "--output",   "set",
               "--episodes", "80",
               "--steps",    "10",
               "--seed",     seed} +
         more;
}

class GenerateReplace : public testing::Test {
 protected:
  [[nodiscard]] json make(const std::string& seed, const Words& more) const {
    return run_json(folder_, generate(seed, more));
  }
  [[nodiscard]] bool merged() const {
    const bool robomimic = fs::exists(folder_.path("set/robomimic.hdf5"));
    EXPECT_EQ(
        fs::exists(folder_.path("set/minari/tangere/rolling_ball_small-v0/data/main_data.hdf5")),
        robomimic);
    return robomimic;
  }

  const Folder folder_;
};

TEST_F(GenerateReplace, WhatShowsShardsAsOneGoesWithTheFirstThatIsReplaced) {
  EXPECT_TRUE(make("1", {"--shards", "3"}).at("not_merged").is_null());
  ASSERT_TRUE(merged());
  const json first = make("2", {"--shard", "0/3", "--overwrite"});
  EXPECT_TRUE(first.at("merged").is_null());
  EXPECT_THAT(first.at("not_merged").get<std::string>(),
              HasSubstr("'set/shard-00001.h5' belongs to another run: seed: 1 there, 2 here"));
  EXPECT_FALSE(merged()) << "it would show the shard of seed 2 with those of seed 1";
  const Outcome second = run(folder_, generate("2", {"--shard", "1/3", "--overwrite"}));
  EXPECT_EQ(second.exit_code, 0) << second.err;
  EXPECT_THAT(second.out, HasSubstr("not merged: 'set/shard-00002.h5' belongs to another run"));
  EXPECT_EQ(make("2", {"--shard", "2/3", "--overwrite"}).at("merged"), "set/robomimic.hdf5");
  EXPECT_TRUE(merged());
  EXPECT_EQ(run(folder_, {"validate", "set/robomimic.hdf5"}).exit_code, 0);
}

TEST_F(GenerateReplace, ShardsOfHigherNumbersGoToo) {
  EXPECT_EQ(make("1", {"--shards", "5"}).at("shards").size(), 5U);
  EXPECT_TRUE(merged());
  for (const char* shard : {"0/3", "1/3"}) {
    EXPECT_TRUE(make("1", {"--shard", shard, "--overwrite"}).at("merged").is_null());
    EXPECT_FALSE(merged());
    EXPECT_FALSE(fs::exists(folder_.path("set/shard-00003.h5")));
    EXPECT_FALSE(fs::exists(folder_.path("set/shard-00004.h5")));
  }
  EXPECT_EQ(make("1", {"--shard", "2/3", "--overwrite"}).at("merged"), "set/robomimic.hdf5");
  EXPECT_EQ(run(folder_, {"validate", "set"}).exit_code, 0);
}

TEST_F(GenerateReplace, AWorkerWaitsForTheOneThatLooksWhetherAllIsThere) {
  ASSERT_EQ(run(folder_, generate("1", {"--shard", "0/3"})).exit_code, 0);
  FolderLock looking(folder_.path("set"));
  ASSERT_TRUE(looking.take(FolderLock::Kind::alone));
  Program worker(folder_, generate("1", {"--shard", "1/3"}));
  looking.let_go();
  const Outcome outcome = worker.wait();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
}

TEST_F(GenerateReplace, NothingIsMergedByHandWhileShardsAreWritten) {
  ASSERT_EQ(run(folder_, generate("1", {"--shards", "3", "--no-merge"})).exit_code, 0);
  {
    FolderLock writing(folder_.path("set"));
    ASSERT_TRUE(writing.take(FolderLock::Kind::shared));
    const Outcome refused = run(folder_, {"merge", "set"});
    EXPECT_EQ(refused.exit_code, 3);
    EXPECT_THAT(
        refused.err,
        HasSubstr(
            "cannot merge 'set': another process writes shards there or merges them; expected"));
    EXPECT_FALSE(merged());
  }
  EXPECT_EQ(run(folder_, {"merge", "set"}).exit_code, 0);
  EXPECT_TRUE(merged());
}

TEST_F(GenerateReplace, WhatAKilledMergeLeftGoesWithoutMerging) {
  ASSERT_EQ(run(folder_, generate("1", {"--shards", "3"})).exit_code, 0);
  for (const char* more : {"--overwrite", "--resume"}) {
    folder_.write("set/robomimic.hdf5.part", "begun");
    ASSERT_EQ(run(folder_, generate("1", {"--shards", "3", "--no-merge", more})).exit_code, 0);
    EXPECT_FALSE(fs::exists(folder_.path("set/robomimic.hdf5.part"))) << more;
  }
}

}  // namespace
}  // namespace tangere::apps
