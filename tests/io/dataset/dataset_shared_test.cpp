// SPDX-License-Identifier: Apache-2.0
// Tests several writers of one folder. The last one reports that the set is complete and of one
// run, and none keeps another out.
#include <gmock/gmock.h>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_files.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/files/folder_lock.hpp"
#include "tests/io/synthetic_episodes.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using testing::dataset_layout;
using ::testing::ElementsAre;
using testing::Folder;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::write_block;

/// 48 episodes, one shard for each block of 16.
DatasetLayout three_shards(std::uint64_t seed = 1) {
  DatasetLayout l = dataset_layout(48);
  l.shards = 3;
  l.seed = seed;
  return l;
}

DatasetOutput one(const Folder& folder, std::int64_t shard,
                  ExistingShards existing = ExistingShards::refuse) {
  return {folder / "set", existing, std::vector{shard}};
}

bool may_be_held_alone(const Folder& folder) {
  return FolderLock(folder / "set").take(FolderLock::Kind::alone);
}

TEST(DatasetShared, IsLetGoOfByWhoeverEndsAndHeldByWhoeverSeesAll) {
  const Folder folder;
  const DatasetLayout l = three_shards();
  DatasetWriter first(one(folder, 0), l);
  write_block(first, l, 0);
  EXPECT_FALSE(may_be_held_alone(folder));
  EXPECT_FALSE(first.complete());
  EXPECT_THAT(first.obstacle(), IsEmpty()) << "shards are missing: nothing is wrong";
  EXPECT_TRUE(may_be_held_alone(folder)) << "the first one still lives, and keeps nobody out";
  DatasetWriter second(one(folder, 1), l), third(one(folder, 2), l);
  write_block(second, l, 16);
  write_block(third, l, 32);
  // Both have finished their shards. The second writer is not alone yet; the third is.
  EXPECT_FALSE(second.complete());
  EXPECT_THAT(second.obstacle(), HasSubstr("other processes hold '" + folder / "set'"));
  EXPECT_TRUE(third.complete());
  EXPECT_THAT(third.obstacle(), IsEmpty());
  EXPECT_FALSE(may_be_held_alone(folder)) << "it merges";
}

TEST(DatasetShared, IsNotCompleteWithShardsOfAnotherRun) {
  const Folder folder;
  const DatasetLayout old = three_shards(1), l = three_shards(2);
  {
    DatasetWriter alone({folder / "set"}, old);
    for (const std::int64_t episode : {0, 16, 32}) write_block(alone, old, episode);
    EXPECT_TRUE(alone.complete());
  }
  for (const std::int64_t shard : {0, 1}) {
    DatasetWriter writer(one(folder, shard, ExistingShards::replace), l);
    write_block(writer, l, 16 * shard);
    EXPECT_FALSE(writer.complete());
    EXPECT_THAT(
        writer.obstacle(),
        HasSubstr(shard == 0 ? "shard-00001.h5' belongs to another run: seed: 1 there, 2 here"
                             : "shard-00002.h5' belongs to another run: seed: 1 there, 2 here"));
    EXPECT_TRUE(may_be_held_alone(folder));
  }
  DatasetWriter last(one(folder, 2, ExistingShards::replace), l);
  write_block(last, l, 32);
  EXPECT_TRUE(last.complete());
}

TEST(DatasetShared, IsNotCompleteWithAFileThatIsNoneOfItsShards) {
  const Folder folder;
  const DatasetLayout l = three_shards();
  {
    DatasetWriter alone({folder / "set"}, l);
    for (const std::int64_t episode : {0, 16, 32}) write_block(alone, l, episode);
  }
  fs::copy_file(folder / "set/shard-00000.h5", folder / "set/shard-00007.h5");
  DatasetWriter again({folder / "set", ExistingShards::keep}, l);
  EXPECT_FALSE(again.complete());
  EXPECT_THAT(again.obstacle(),
              HasSubstr("shard-00007.h5' is not one of the 3 shards of this run"));
  // Readers and merges of the folder report it as well.
  const DatasetFiles files = find_dataset(folder / "set");
  EXPECT_THAT(files.missing, IsEmpty());
  EXPECT_THAT(files.surplus, ElementsAre(folder / "set/shard-00007.h5"));
  EXPECT_THAT(examine_dataset(files).problems,
              ElementsAre(HasSubstr("shard-00007.h5: not one of the shards that are counted")));
  try {
    check_complete(files);
    FAIL() << "one is too many";
  } catch (const IoError& error) {
    EXPECT_THAT(error.what(), HasSubstr("shard-00007.h5' is not one of the 3 shards that '"));
  }
}

/// 80 episodes in shards of 48 and 32, shared out by size, or of 32 and 48, by number.
DatasetLayout two_shards(bool by_size) {
  DatasetLayout l = dataset_layout(80);
  if (by_size)
    l.shard_bytes = 3.5 * kShardBlock * l.episode_bytes();
  else
    l.shards = 2;
  return l;
}

TEST(DatasetShared, ACopyOfAnotherShardIsNoneOfItsEpisodes) {
  for (const bool by_size : {false, true}) {
    const Folder folder;
    const DatasetLayout l = two_shards(by_size);
    {
      DatasetWriter alone({folder / "set"}, l);
      for (std::int64_t episode = 0; episode < 80; episode += 16) write_block(alone, l, episode);
    }
    const DatasetFiles files = find_dataset(folder / "set");
    check_complete(files);
    EXPECT_THAT(examine_dataset(files).problems, IsEmpty());
    fs::copy_file(folder / "set/shard-00000.h5", folder / "set/shard-00001.h5",
                  fs::copy_options::overwrite_existing);
    const char* const message = by_size ? "holds episodes 0 to 47; expected 48 to 79"
                                        : "holds episodes 0 to 31; expected 32 to 79";
    EXPECT_THAT(examine_dataset(files).problems,
                ElementsAre(AllOf(HasSubstr("shard-00001.h5: "), HasSubstr(message))));
    try {
      check_complete(files);
      FAIL() << "episodes are missing";
    } catch (const IoError& error) {
      EXPECT_THAT(error.what(), AllOf(HasSubstr("shard-00001.h5' "), HasSubstr(message)));
    }
  }
}

}  // namespace
}  // namespace tangere
