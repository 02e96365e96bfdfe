// SPDX-License-Identifier: Apache-2.0
// Tests the folder of a data set: one run at a time, no shard removed unless requested, nothing
// half-written kept.
#include "io/dataset/dataset_folder.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <functional>
#include <memory>
#include <optional>

#include "engine/base/error.hpp"
#include "io/files/part_file.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using testing::Folder;
using ::testing::HasSubstr;

void touch(const std::string& path) { std::ofstream(path) << "x"; }

std::vector<std::string> names(const std::string& folder) {
  std::vector<std::string> found;
  for (const auto& entry : fs::directory_iterator(folder)) found.push_back(entry.path().filename());
  std::sort(found.begin(), found.end());
  return found;
}

std::string complaint(const std::string& path, bool overwrite = false) {
  try {
    const DatasetFolder folder(path, overwrite ? ExistingShards::replace : ExistingShards::refuse);
  } catch (const IoError& error) {
    return error.what();
  }
  return "";
}

TEST(DatasetFolder, IsMadeAndRemovedWhenNothingComesIntoIt) {
  const Folder place;
  {
    const DatasetFolder folder(place / "set", ExistingShards::refuse);
    EXPECT_TRUE(fs::is_directory(place / "set"));
    EXPECT_EQ(folder.shard_path(7), place / "set/shard-00007.h5");
    EXPECT_EQ(folder.shard_path(123456), place / "set/shard-123456.h5");
    EXPECT_GT(folder.free_bytes(), 0);
  }
  EXPECT_FALSE(fs::exists(place / "set"));
  {
    const DatasetFolder folder(place / "set", ExistingShards::refuse);
    touch(folder.shard_path(0));
  }
  EXPECT_THAT(names(place / "set"), ElementsAre("shard-00000.h5"));
  fs::create_directory(place / "mine");
  { const DatasetFolder folder(place / "mine", ExistingShards::refuse); }
  EXPECT_TRUE(fs::exists(place / "mine")) << "it was there before";
}

TEST(DatasetFolder, WithShardsNeedsLeave) {
  const Folder place;
  fs::create_directory(place / "set");
  touch(place / "set/shard-00004.h5");
  EXPECT_THAT(complaint(place / "set"), HasSubstr("has shards already; give --overwrite"));
  EXPECT_EQ(complaint(place / "set", true), "");
  EXPECT_THAT(names(place / "set"), ElementsAre("shard-00004.h5")) << "nothing is removed yet";
}

TEST(DatasetFolder, RemovesOldShardsAndNothingElse) {
  const Folder place;
  fs::create_directory(place / "set");
  for (const char* name : {"shard-00000.h5", "shard-00011.h5", "shard-123456.h5", "shard-.h5",
                           "shard-1x.h5", "my-shard-00000.h5", "shard-00000.h5.bak", "notes.txt"})
    touch(place / "set/" + name);
  DatasetFolder folder(place / "set", ExistingShards::replace);
  folder.remove_old_shards(1);
  EXPECT_THAT(names(place / "set"), ElementsAre("my-shard-00000.h5", "notes.txt", "shard-.h5",
                                                "shard-00000.h5.bak", "shard-1x.h5"));
}

TEST(DatasetFolder, RemovesWhatMergingMadeWithItsFolders) {
  const Folder place;
  for (const char* name : {"one-v0", "two-v0", "task/three-v0"}) {
    const std::string data = place / "set/minari/tangere/" + name + "/data";
    fs::create_directories(data);
    for (const char* file : {"/main_data.hdf5", "/metadata.json"}) touch(data + file);
  }
  for (const char* name : {"robomimic.hdf5", "shard-00000.h5", "notes.txt"})
    touch(place / "set/" + name);
  touch(place / "set/minari/tangere/two-v0/mine.txt");
  DatasetFolder folder(place / "set", ExistingShards::replace);
  folder.remove_old_shards(1);
  EXPECT_THAT(names(place / "set"), ElementsAre("minari", "notes.txt"));
  EXPECT_THAT(names(place / "set/minari/tangere"), ElementsAre("two-v0"));
  EXPECT_THAT(names(place / "set/minari/tangere/two-v0"), ElementsAre("mine.txt"));
  fs::remove(place / "set/minari/tangere/two-v0/mine.txt");
  folder.remove_old_shards(1);
  EXPECT_THAT(names(place / "set"), ElementsAre("notes.txt"));
}

TEST(DatasetFolder, CountsShardsThatAreToGoAsFree) {
  const Folder place;
  fs::create_directory(place / "set");
  const DatasetFolder empty(place / "set", ExistingShards::replace);
  const double before = empty.free_bytes();
  touch(place / "set/shard-00000.h5");
  fs::resize_file(place / "set/shard-00000.h5", std::uintmax_t{1} << 40);  // sparse: takes no room
  EXPECT_GT(empty.free_bytes(), before + 0.9 * (std::uintmax_t{1} << 40));
}

TEST(DatasetFolder, CleansWhatAKilledRunLeft) {
  const Folder place;
  fs::create_directory(place / "set");
  for (const char* name : {"shard-00000.h5.part", "shard-00012.h5.part", "other.h5.part"})
    touch(place / "set/" + name);
  EXPECT_EQ(complaint(place / "set"), "");
  EXPECT_THAT(names(place / "set"), ElementsAre("other.h5.part"));
}

TEST(DatasetFolder, IsHeldByOneAtATime) {
  const Folder place;
  {
    const DatasetFolder first(place / "set", ExistingShards::refuse);
    EXPECT_THAT(complaint(place / "set"), HasSubstr("another process is writing shards there"));
    EXPECT_THAT(complaint(place / "set", true),
                HasSubstr("another process is writing shards there"));
    EXPECT_TRUE(fs::is_directory(place / "set"))
        << "the second must not remove the first one's folder";
  }
  EXPECT_EQ(complaint(place / "set"), "");
}

/// A number of tries, and what is done between them instead of waiting.
LockPatience tries(int count, std::function<void()> between) { return {count, std::move(between)}; }

TEST(DatasetFolder, IsSharedOnceTheOneThatMergesHasEnded) {
  const Folder place;
  fs::create_directory(place / "set");
  std::optional<FolderLock> merging(place / "set");
  ASSERT_TRUE(merging->take(FolderLock::Kind::alone));
  int pauses = 0;
  const auto share = [&](std::function<void()> between) {
    const DatasetFolder folder(place / "set", ExistingShards::keep, true,
                               {tries(3, std::move(between)), {}});
  };
  try {
    share([&] { ++pauses; });
    FAIL() << "it is held";
  } catch (const IoError& error) {
    EXPECT_THAT(
        error.what(),
        HasSubstr("/set': another process is writing shards there and does not share the folder"));
  }
  EXPECT_EQ(pauses, 2);
  EXPECT_NO_THROW(share([&] { merging.reset(); }));
}

TEST(DatasetFolder, IsHeldAloneOnceOthersHaveLetGo) {
  const Folder place;
  std::optional<DatasetFolder> other;
  int pauses = 0;
  DatasetFolder waits(place / "set", ExistingShards::keep, true, {{}, tries(4, [&] {
                                                                    if (++pauses == 5)
                                                                      other->let_go();
                                                                  })});
  other.emplace(place / "set", ExistingShards::keep, true);
  EXPECT_FALSE(waits.hold_alone());
  EXPECT_EQ(pauses, 3);
  EXPECT_TRUE(waits.hold_alone()) << "in its third try the other one has let go";
  EXPECT_EQ(pauses, 5);
  EXPECT_FALSE(other->hold_alone());
  // Those that failed hold no lock.
  waits.let_go();
  EXPECT_TRUE(other->hold_alone());
}

TEST(DatasetFolder, CleansWhatAKilledMergeLeft) {
  for (const bool shared : {false, true}) {
    const Folder place;
    const std::string data = place / "set/minari/tangere/x-v0/data";
    fs::create_directories(data);
    for (const std::string& part :
         {place / "set/robomimic.hdf5.part", data + "/main_data.hdf5.part",
          data + "/metadata.json.part", place / "set/shard-00003.h5.part"})
      touch(part);
    touch(place / "set/robomimic.hdf5");
    { const DatasetFolder folder(place / "set", ExistingShards::keep, shared); }
    EXPECT_TRUE(fs::is_empty(data));
    EXPECT_TRUE(fs::exists(place / "set/robomimic.hdf5"));
    EXPECT_FALSE(fs::exists(place / "set/robomimic.hdf5.part"));
    EXPECT_EQ(fs::exists(place / "set/shard-00003.h5.part"), shared)
        << "another process may be writing it";
    if (!shared) continue;
    const PartFile cleaned_by_another(place / "set/robomimic.hdf5", true);
    EXPECT_NO_THROW(DatasetFolder(place / "set", ExistingShards::keep, true));
    EXPECT_TRUE(fs::exists(place / "set/robomimic.hdf5.part"));
  }
}

TEST(DatasetFolder, SharedLosesWhatIsNoneOfItsShardsAndWhatShowsThemAsOne) {
  const Folder place;
  fs::create_directories(place / "set/minari/tangere/x-v0/data");
  for (const char* name : {"shard-00000.h5", "shard-00002.h5", "shard-00003.h5", "shard-000001.h5",
                           "shard-99999999999999999999.h5", "robomimic.hdf5",
                           "minari/tangere/x-v0/data/main_data.hdf5", "notes.txt"})
    touch(place / "set/" + name);
  DatasetFolder(place / "set", ExistingShards::keep, true).remove_old_shards(3);
  EXPECT_THAT(names(place / "set"), ::testing::SizeIs(8)) << "they are to be kept";
  DatasetFolder(place / "set", ExistingShards::replace, true).remove_old_shards(3);
  EXPECT_THAT(names(place / "set"), ElementsAre("notes.txt", "shard-00000.h5", "shard-00002.h5"));
}

TEST(DatasetFolder, ThatIsNoneIsNamed) {
  const Folder place;
  touch(place / "file");
  EXPECT_THAT(complaint(place / "file"), HasSubstr("exists and is not a folder"));
  EXPECT_THAT(complaint(place / "no/set"),
              HasSubstr("No such file or directory; expected its parent folder to be there"));
  EXPECT_THAT(complaint(""), HasSubstr("folder"));
  EXPECT_THAT(names(place / ""), ElementsAre("file"));
}

TEST(DatasetFolder, ThatCannotBeWrittenIsNamed) {
  EXPECT_THAT(complaint("/proc/set"), HasSubstr("/proc/set"));
  if (geteuid() == 0) GTEST_SKIP() << "nothing is forbidden to root";
  const Folder place;
  fs::create_directory(place / "set");
  fs::permissions(place / "set", fs::perms::owner_read | fs::perms::owner_exec);
  EXPECT_THAT(complaint(place / "set"), HasSubstr("cannot write into"));
  fs::permissions(place / "set", fs::perms::owner_all);
}

}  // namespace
}  // namespace tangere
