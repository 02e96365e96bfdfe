// SPDX-License-Identifier: Apache-2.0
// Tests that shards hold what they were given, where docs/datasets.md says, with the same bytes for
// any order of arrival.
#include <gmock/gmock.h>
#include <sys/resource.h>

#include <csignal>
#include <fstream>

#include "io/dataset/dataset_writer.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5.hpp"
#include "tests/files.hpp"
#include "tests/io/synthetic_episodes.hpp"

namespace tangere {
namespace {

using testing::block_steps;
using testing::dataset_layout;
using testing::dataset_number;
using ::testing::ElementsAre;
using testing::failure;
using testing::Folder;
using ::testing::HasSubstr;
using testing::write_block;
using testing::write_piece;

/// The only shard of a data set of 20 episodes, of which 2 and 17 failed.
std::string one_shard(const Folder& folder, const DatasetLayout& l) {
  DatasetWriter writer({folder / "set"}, l);
  write_block(writer, l, 0, {failure(2)});
  EXPECT_THAT(writer.shards(), ::testing::IsEmpty());
  write_block(writer, l, 16, {failure(17)});
  EXPECT_THAT(writer.shards(), ElementsAre(folder / "set/shard-00000.h5"));
  return folder / "set/shard-00000.h5";
}

template <class T>
void expect_dataset(const h5::Id& file, const std::string& path, const h5::Dims& dims,
                    std::int64_t episode, std::size_t name, std::int64_t first_row) {
  const h5::Id dataset = h5::open_dataset(file, path);
  ASSERT_EQ(h5::dimensions(dataset), dims) << path;
  const h5::Id type(H5Dget_type(dataset.get()));
  EXPECT_GT(H5Tequal(type.get(), sizeof(T) == 4 ? H5T_IEEE_F32LE : H5T_IEEE_F64LE), 0) << path;
  std::size_t width = 1;
  for (std::size_t i = 1; i < dims.size(); ++i) width *= dims[i];
  std::vector<T> found(width * dims[0]), expected;
  for (std::int64_t row = 0; row < std::int64_t(dims[0]); ++row)
    for (std::size_t k = 0; k < width; ++k)
      expected.push_back(dataset_number<T>(episode, name, first_row + row, k));
  h5::read_box(dataset, h5::Dims(dims.size(), 0), dims, found.data());
  EXPECT_EQ(found, expected) << path;
}

template <class T>
void expect_demo(const h5::Id& file, std::int64_t episode) {
  const std::string demo = "data/demo_" + std::to_string(episode);
  EXPECT_EQ(h5::read_numbers<std::int64_t>(h5::open_group(file, demo), "num_samples")[0], 3);
  expect_dataset<float>(file, demo + "/actions", {3, 2}, episode, 0, 0);
  expect_dataset<T>(file, demo + "/obs/q", {3, 3}, episode, 1, 0);
  expect_dataset<T>(file, demo + "/obs/v", {3, 2}, episode, 2, 0);
  expect_dataset<T>(file, demo + "/obs/skin", {3, 3, 4, 3}, episode, 3, 0);
  expect_dataset<T>(file, demo + "/final_obs/q", {1, 3}, episode, 1, 3);
  expect_dataset<T>(file, demo + "/final_obs/v", {1, 2}, episode, 2, 3);
  expect_dataset<T>(file, demo + "/final_obs/skin", {1, 3, 4, 3}, episode, 3, 3);
  std::vector<float> rewards(3, 7);
  h5::read_box(h5::open_dataset(file, demo + "/rewards"), {0}, {3}, rewards.data());
  EXPECT_THAT(rewards, ElementsAre(0, 0, 0));
  std::vector<std::int8_t> dones(3, 7);
  const h5::Id flags = h5::open_dataset(file, demo + "/dones");
  h5::read_box(flags, {0}, {3}, dones.data());
  EXPECT_THAT(dones, ElementsAre(0, 0, 1));
  // The type that h5py shows as bool.
  const h5::Id type(H5Dget_type(flags.get()));
  ASSERT_EQ(H5Tget_class(type.get()), H5T_ENUM);
  EXPECT_EQ(H5Tget_member_index(type.get(), "FALSE"), 0);
  EXPECT_EQ(H5Tget_member_index(type.get(), "TRUE"), 1);
}

TEST(Dataset, HoldsEveryNumberWhereThePageSays) {
  for (const bool single : {true, false}) {
    const Folder folder;
    const h5::Id file = h5::open_file(one_shard(folder, dataset_layout(20, single)));
    for (std::int64_t e = 0; e < 20; ++e) {
      const bool failed = e == 2 || e == 17;
      EXPECT_EQ(h5::has_link(h5::open_group(file, "data"), "demo_" + std::to_string(e)), !failed);
      EXPECT_EQ(h5::has_link(h5::open_group(file, "failed"), "episode_" + std::to_string(e)),
                failed);
      if (failed) continue;
      if (single)
        expect_demo<float>(file, e);
      else
        expect_demo<double>(file, e);
    }
    const h5::Id scene = h5::open_group(file, "scene");
    EXPECT_EQ(h5::read_text(scene, "observation_type"), single ? "float32" : "float64");
    EXPECT_EQ(h5::read_text(scene, "precision"), single ? "mixed" : "double");
  }
}

TEST(Dataset, HoldsEndEffectorsAsAnObservation) {
  const Folder folder;
  DatasetLayout l = dataset_layout(20);
  const double bytes = l.episode_bytes();
  l.end_effector_names = {"tip", "heel"};
  EXPECT_EQ(l.episode_bytes() - bytes, 4 * 6 * sizeof(float));
  const std::string path = one_shard(folder, l);
  EXPECT_EQ(check_shard(path).demos, 18);
  const h5::Id file = h5::open_file(path);
  expect_dataset<float>(file, "data/demo_7/obs/variables", {3, 2, 3}, 7, 3, 0);
  expect_dataset<float>(file, "data/demo_7/final_obs/variables", {1, 2, 3}, 7, 3, 3);
  expect_dataset<float>(file, "data/demo_7/obs/skin", {3, 3, 4, 3}, 7, 4, 0);
  const h5::Id scene = h5::open_group(file, "scene");
  EXPECT_THAT(h5::read_texts(scene, "observations"), ElementsAre("q", "v", "variables", "skin"));
  EXPECT_THAT(h5::read_texts(scene, "variable_names"), ElementsAre("tip", "heel"));
  EXPECT_EQ(h5::read_text(scene, "variable_units"), "m");
  EXPECT_EQ(h5::read_text(scene, "variable_frame"), "world");
}

TEST(Dataset, TakesTheNameOfEndEffectorsOnlyWhereThereAreAny) {
  DatasetLayout l = dataset_layout(20);
  l.sensors[0].name = "variables";
  EXPECT_NO_THROW(l.check());
  l.end_effector_names = {"tip"};
  EXPECT_THROW(l.check(), InputError);
}

TEST(Dataset, SaysWhatItsNumbersAre) {
  const Folder folder;
  const h5::Id file = h5::open_file(one_shard(folder, dataset_layout(20)));
  const auto whole = [](const h5::Id& object, const char* name) {
    return h5::read_numbers<std::int64_t>(object, name).at(0);
  };
  EXPECT_EQ(h5::read_text(file, "format"), "tangere dataset");
  EXPECT_EQ(whole(file, "format_version"), 7);
  EXPECT_EQ(whole(file, "first_episode"), 0);
  EXPECT_EQ(whole(file, "episodes"), 20);
  EXPECT_EQ(whole(file, "dataset_episodes"), 20);
  const h5::Id data = h5::open_group(file, "data");
  EXPECT_EQ(whole(data, "total"), 18 * 3);
  EXPECT_EQ(h5::read_text(data, "env_args"),
            R"({"env_name":"syn \"thetic\"","type":2,"env_kwargs":{}})");
  const h5::Id scene = h5::open_group(file, "scene");
  EXPECT_EQ(h5::read_text(scene, "text"), "<tangere/>");
  EXPECT_EQ(h5::read_text(scene, "dataset_id"), "tangere/syn--thetic--v0");
  EXPECT_EQ(h5::read_text(scene, "observation_scale"), "{}");
  EXPECT_EQ(h5::read_text(scene, "privileged"), R"(["q","v"])");
  EXPECT_EQ(h5::read_text(scene, "touch"), R"(["skin"])");
  EXPECT_EQ(h5::read_texts(scene, "action_units"), (std::vector<std::string>{"m", "1"}));
  EXPECT_EQ(h5::read_texts(scene, "observation_units"),
            (std::vector<std::string>{"q_units", "v_units", "N"}));
  EXPECT_EQ(h5::read_numbers<std::uint64_t>(scene, "seed").at(0), 18446744073709551615ULL);
  EXPECT_EQ(whole(scene, "steps"), 6);
  EXPECT_EQ(whole(scene, "every"), 2);
  EXPECT_EQ(h5::read_numbers<double>(scene, "timestep").at(0), 0.01);
  EXPECT_THAT(h5::read_texts(scene, "observations"), ElementsAre("q", "v", "skin"));
  EXPECT_THAT(h5::read_texts(scene, "q_names"), ElementsAre("a.x", "a.y", "b"));
  EXPECT_THAT(h5::read_texts(scene, "q_units"), ElementsAre("m", "m", "rad"));
  EXPECT_THAT(h5::read_texts(scene, "v_names"), ElementsAre("a.vx", "b"));
  EXPECT_THAT(h5::read_texts(scene, "v_units"), ElementsAre("m/s", "rad/s"));
  EXPECT_THAT(h5::read_texts(scene, "action_names"), ElementsAre("a.vx", "b"));
  for (const char* name : {"name", "integrator", "tolerance", "tangere_version", "instruction_set",
                           "quaternion_order"})
    EXPECT_GT(H5Aexists(scene.get(), name), 0) << name;
  const h5::Id skin = h5::open_group(scene, "sensors/skin");
  EXPECT_EQ(whole(skin, "pressure_sign"), -1);
  EXPECT_THAT(h5::read_numbers<std::int64_t>(skin, "resolution"), ElementsAre(3, 4));
  EXPECT_THAT(h5::read_numbers<double>(skin, "corner1"), ElementsAre(0.002, 0.003, 0));
  for (const char* name : {"units", "components", "body", "corner0", "axis0", "axis1"})
    EXPECT_GT(H5Aexists(skin.get(), name), 0) << name;
}

TEST(Dataset, KeepsFailedEpisodesApartWithTheStateBefore) {
  const Folder folder;
  const std::string path = one_shard(folder, dataset_layout(20));
  const h5::Id file = h5::open_file(path), group = h5::open_group(file, "failed/episode_17");
  EXPECT_EQ(h5::read_numbers<std::int64_t>(group, "step").at(0), 3);
  EXPECT_EQ(h5::read_numbers<std::int8_t>(group, "status").at(0), -3);
  EXPECT_EQ(h5::read_text(group, "reason"), to_string(StepStatus::rotation));
  EXPECT_THAT(h5::read_numbers<double>(group, "q"), ElementsAre(1.5, 17, 0.1));
  EXPECT_THAT(h5::read_numbers<double>(group, "v"), ElementsAre(-2, 0.3));
  const ShardContent content = check_shard(path);
  EXPECT_EQ(content.first_episode, 0);
  EXPECT_EQ(content.demos, 18);
  EXPECT_EQ(content.failed, 2);
  EXPECT_EQ(content.rows, 54);
}

TEST(Dataset, BytesDoNotDependOnTheOrderOfBlocksNorOnPieces) {
  const DatasetLayout l = dataset_layout(70);
  const Folder ascending, mixed;
  {
    DatasetWriter writer({ascending / "set"}, l);
    for (const std::int64_t block : {0, 16, 32, 48, 64})
      write_block(
          writer, l, block,
          block == 32 ? std::vector{failure(33), failure(40)} : std::vector<FailedEpisode>{});
  }
  {
    DatasetWriter writer({mixed / "set"}, l);
    write_piece(writer, l, 48, 0, 1);
    write_piece(writer, l, 32, 0, 2);
    write_block(writer, l, 64);
    write_piece(writer, l, 32, 2, 2);
    writer.finish(32, std::vector{failure(33), failure(40)}, block_steps(32));
    write_piece(writer, l, 48, 1, 2);
    write_block(writer, l, 0);
    write_piece(writer, l, 48, 3, 1);  // no action
    writer.finish(48, {}, block_steps(48));
    write_block(writer, l, 16);
  }
  EXPECT_TRUE(file_bytes(ascending / "set/shard-00000.h5") ==
              file_bytes(mixed / "set/shard-00000.h5"));
}

TEST(Dataset, LongOnesAreSeveralShards) {
  DatasetLayout l = dataset_layout(70);
  // An episode: 4 rows of 3 + 2 + 36 floats, 3 actions of 2, rewards, dones.
  EXPECT_EQ(l.episode_bytes(), 4 * 41 * 4 + 3 * (2 * 4 + 4 + 1));
  l.shard_bytes = 33 * l.episode_bytes();
  EXPECT_EQ(l.episodes_per_shard(), 32);
  const Folder one, other;
  const auto shard = [](std::int64_t s) { return "set/shard-0000" + std::to_string(s) + ".h5"; };
  {
    DatasetWriter writer({one / "set"}, l);
    for (const std::int64_t block : {0, 16, 32, 48, 64}) write_block(writer, l, block);
    EXPECT_THAT(writer.shards(), ElementsAre(one / shard(0), one / shard(1), one / shard(2)));
  }
  {
    DatasetWriter writer({other / "set"}, l);
    for (const std::int64_t block : {64, 48, 0, 32, 16}) write_block(writer, l, block);
    EXPECT_THAT(writer.shards(), ElementsAre(other / shard(0), other / shard(1), other / shard(2)));
  }
  for (std::int64_t s = 0; s < 3; ++s) {
    const ShardContent content = check_shard(one / shard(s));
    EXPECT_EQ(content.first_episode, 32 * s);
    EXPECT_EQ(content.demos, s < 2 ? 32 : 6);
    EXPECT_TRUE(file_bytes(one / shard(s)) == file_bytes(other / shard(s))) << shard(s);
  }
  expect_demo<float>(h5::open_file(one / shard(2)), 69);
}

/// Steps whose contacts missed bodies decide exit codes, so a run that keeps shards knows theirs.
TEST(Dataset, KeptShardsBringTheCountsOfTheirSteps) {
  const Folder folder;
  DatasetLayout l = dataset_layout(48);
  l.shards = 3;
  {
    DatasetWriter writer({folder / "set"}, l);
    for (const std::int64_t block : {0, 32}) write_block(writer, l, block);
    EXPECT_EQ(writer.kept_steps(), EpisodeSteps());
  }
  const DatasetOutput resumed{folder / "set", ExistingShards::keep};
  EXPECT_EQ(DatasetWriter(resumed, l).kept_steps(), (EpisodeSteps{192, 1 + 3, 10 + 42}));
  const std::string shard = folder / "set/shard-00002.h5";
  EXPECT_EQ(check_shard(shard).steps, block_steps(32));
  {  // as older versions wrote it
    const h5::Id file(H5Fopen(shard.c_str(), H5F_ACC_RDWR, H5P_DEFAULT));
    ASSERT_GE(H5Adelete(file.get(), "simulation_steps"), 0);
  }
  EXPECT_THROW(check_shard(shard), IoError) << "label_sum counts them";
  try {
    const DatasetWriter writer(resumed, l);
    ADD_FAILURE() << "kept without knowing whether its contacts missed";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::AllOf(HasSubstr(shard), HasSubstr("--overwrite")));
  }
}

TEST(Dataset, ShardsHaveRoomForAtLeastABlockAndAtMost4096Episodes) {
  DatasetLayout l = dataset_layout(1000000);
  EXPECT_EQ(l.episodes_per_shard(), 4096);  // short episodes
  l.sensors[0].rows = l.sensors[0].cols = 200;
  l.sensors[0].points = 40000;
  l.steps = 20;  // 11 rows of 480 kB: 203 episodes are a gigabyte
  EXPECT_EQ(l.episodes_per_shard(), 192);
  l.steps = 1000000;
  EXPECT_EQ(l.episodes_per_shard(), 16);
}

TEST(Dataset, WhatIsNotCompleteLeavesNothing) {
  DatasetLayout l = dataset_layout(70);
  l.shard_bytes = 33 * l.episode_bytes();
  const Folder folder;
  {
    DatasetWriter writer({folder / "set"}, l);
    write_block(writer, l, 32);  // of the second shard
    write_piece(writer, l, 0, 0, 2);
    EXPECT_TRUE(std::filesystem::exists(folder / "set/shard-00001.h5.part"));
  }
  EXPECT_EQ(folder.entries(), 0U) << "the folder was made for it and nothing came";
  {
    DatasetWriter writer({folder / "set"}, l);
    write_block(writer, l, 64);  // the whole third shard
    write_block(writer, l, 32);
    EXPECT_THAT(writer.shards(), ElementsAre(folder / "set/shard-00002.h5"));
  }
  EXPECT_TRUE(std::filesystem::exists(folder / "set/shard-00002.h5"));
  EXPECT_FALSE(std::filesystem::exists(folder / "set/shard-00001.h5.part"));
}

TEST(Dataset, NamesThatNoFileCanHoldAreRefused) {
  const Folder folder;
  const auto complaint = [&](const std::string& name, const std::string& second) {
    DatasetLayout l = dataset_layout(1);
    l.sensors.push_back(l.sensors[0]);
    l.sensors[0].name = name;
    l.sensors[1].name = second;
    try {
      const DatasetWriter writer({folder / "set"}, l);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string("nothing");
  };
  EXPECT_EQ(complaint("a", "b"), "nothing");
  EXPECT_THAT(complaint("a/b", "c"), HasSubstr("expected one without '/'"));
  EXPECT_THAT(complaint("", "c"), HasSubstr("cannot have this name"));
  EXPECT_THAT(complaint(".", "c"), HasSubstr("cannot have this name"));
  EXPECT_THAT(complaint("q", "c"), HasSubstr("another observation has this name"));
  EXPECT_THAT(complaint("c", "c"), HasSubstr("another observation has this name"));
  EXPECT_EQ(complaint(std::string(200, 'a'), std::string(254, 'b')), "nothing");
  EXPECT_THAT(complaint(std::string(300, 'p'), "c"),
              HasSubstr("'" + std::string(32, 'p') +
                        "…': the name has 300 bytes; the name of a dataset has at most 255"));
  EXPECT_EQ(folder.entries(), 0U);
}

TEST(Dataset, MoreThanTheDiskHoldsIsRefusedBeforeAnythingIsWritten) {
  const Folder folder;
  DatasetLayout endless = dataset_layout(16);
  endless.steps = std::int64_t{1} << 40;
  EXPECT_THROW(DatasetWriter({folder / "set"}, endless), IoError);
  EXPECT_EQ(folder.entries(), 0U);
  // No data set has so many shards, whatever the disk holds.
  EXPECT_THROW(DatasetWriter({folder / "set"}, dataset_layout(std::int64_t{1} << 50)), InputError);
  EXPECT_EQ(folder.entries(), 0U);
}

/// A limit on the size of files stands for a disk that fills up.
class FullDisk {
 public:
  explicit FullDisk(rlim_t file_bytes) : handler_(std::signal(SIGXFSZ, SIG_IGN)) {
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit small = before_;
    small.rlim_cur = file_bytes;
    setrlimit(RLIMIT_FSIZE, &small);
  }
  ~FullDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }
  FullDisk(const FullDisk&) = delete;
  FullDisk& operator=(const FullDisk&) = delete;

 private:
  void (*handler_)(int);
  rlimit before_{};
};

TEST(Dataset, AFullDiskIsAnErrorAndLeavesWholeShardsOnly) {
  DatasetLayout l = dataset_layout(96);
  l.shard_bytes = 33 * l.episode_bytes();
  std::uintmax_t size = 0;
  {
    const Folder measured;
    DatasetWriter writer({measured / "set"}, l);
    write_block(writer, l, 0);
    write_block(writer, l, 16);
    size = std::filesystem::file_size(measured / "set/shard-00000.h5");
  }
  // From no room at all, through room for data and descriptions, to room for all but the last
  // bytes.
  for (const double part : {0.0, 0.01, 0.2, 0.5, 0.8, 0.95, 0.999}) {
    const Folder folder;
    {
      DatasetWriter writer({folder / "set"}, l);
      write_block(writer, l, 0);
      write_block(writer, l, 16);
      write_block(writer, l, 32);  // half of the second shard
      const FullDisk full(static_cast<rlim_t>(part * static_cast<double>(size)));
      EXPECT_THROW(
          {
            write_block(writer, l, 64);
            write_block(writer, l, 48);
          },
          IoError)
          << part;
    }
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder / "set"), {}), 1) << part;
    EXPECT_EQ(check_shard(folder / "set/shard-00000.h5").demos, 32) << part;
  }
}

TEST(Dataset, AShardThatTheDiskChangedDoesNotGetItsName) {
  const Folder folder;
  const DatasetLayout l = dataset_layout(20);
  {
    DatasetWriter writer({folder / "set"}, l);
    write_block(writer, l, 0);
    std::vector<float> row;
    for (std::size_t k = 0; k < 36; ++k) row.push_back(dataset_number<float>(5, 3, 1, k));
    const std::string part = folder / "set/shard-00000.h5.part";
    const std::size_t at = file_bytes(part).find(
        std::string(reinterpret_cast<const char*>(row.data()), sizeof(float) * 36));
    ASSERT_NE(at, std::string::npos) << "not on the disk yet: nothing is tested";
    std::fstream(part, std::ios::in | std::ios::out | std::ios::binary)
        .seekp(std::streamoff(at))
        .put('x');
    try {
      write_block(writer, l, 16);
      ADD_FAILURE() << "nobody read it back";
    } catch (const IoError& error) {
      EXPECT_THAT(error.what(), HasSubstr("(obs/skin of demo_5) are not what was written"));
    }
    EXPECT_THAT(writer.shards(), ::testing::IsEmpty());
  }
  EXPECT_EQ(folder.entries(), 0U);
}

TEST(Dataset, AShardThatAppearsMeanwhileIsLeftAsItIs) {
  const Folder folder;
  const DatasetLayout l = dataset_layout(4);
  {
    DatasetWriter writer({folder / "set"}, l);
    write_piece(writer, l, 0, 0, 4);
    std::ofstream(folder / "set/shard-00000.h5") << "somebody's";
    EXPECT_THROW(writer.finish(0, {}, {}), IoError);
  }
  EXPECT_EQ(file_bytes(folder / "set/shard-00000.h5"), "somebody's");
  EXPECT_FALSE(std::filesystem::exists(folder / "set/shard-00000.h5.part"));
}

}  // namespace
}  // namespace tangere
