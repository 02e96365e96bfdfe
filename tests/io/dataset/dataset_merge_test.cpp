// SPDX-License-Identifier: Apache-2.0
// What merging makes of data sets with gaps: of failed episodes, and of several shards.
#include "io/dataset/dataset_merge.hpp"

#include <gmock/gmock.h>

#include <array>
#include <filesystem>
#include <functional>
#include <numeric>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_description.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_listing.hpp"
#include "tests/io/older_file.hpp"
#include "tests/io/synthetic_episodes.hpp"

namespace tangere {
namespace {

using ::tangere::testing::dataset_layout;
using ::tangere::testing::failure;
using ::tangere::testing::Folder;
using ::tangere::testing::write_block;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// 40 episodes in three shards; all of the second shard failed, and some of the first.
DatasetFiles write_with_gaps(const Folder& folder, bool single, const std::string& compression) {
  DatasetLayout l = dataset_layout(40, single);
  l.shards = 3;
  l.compression = compression;
  DatasetWriter writer({folder / "set"}, l);
  std::vector<FailedEpisode> all_of_it;
  for (std::int64_t e = 16; e < 32; ++e) all_of_it.push_back(failure(e));
  write_block(writer, l, 0, {failure(0), failure(7)});
  write_block(writer, l, 16, all_of_it);
  write_block(writer, l, 32);
  return find_dataset(folder / "set");
}

std::vector<double> row(const h5::Id& file, const std::string& dataset, hsize_t at) {
  const h5::Id opened = h5::open_dataset(file, dataset);
  h5::Dims dims = h5::dimensions(opened), offset(dims.size(), 0);
  offset[0] = at;
  dims[0] = 1;
  std::vector<double> numbers(
      std::accumulate(dims.begin(), dims.end(), hsize_t{1}, std::multiplies<>()));
  h5::read_box(opened, offset, dims, numbers.data());
  return numbers;
}

std::string complaint(const DatasetFiles& dataset, bool copy) {
  try {
    merge_dataset(dataset, {copy, false});
  } catch (const IoError& error) {
    return error.what();
  }
  return "";
}

void change(const std::string& file, const std::function<void(hid_t)>& by) {
  const hid_t opened = H5Fopen(file.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  by(opened);
  H5Fclose(opened);
}

TEST(DatasetMerge, ThatIsStoppedLeavesTheShardsAlone) {
  for (const bool copy : {false, true}) {
    const Folder folder;
    const DatasetFiles dataset = write_with_gaps(folder, true, "none");
    std::vector<std::string> before = dataset.files, after;
    for (const int asked : {0, 1, 21}) {
      int questions = 0;
      const MergeResult result =
          merge_dataset(dataset, {copy, false, [&] { return questions++ >= asked; }});
      EXPECT_TRUE(result.stopped) << asked;
      EXPECT_TRUE(result.file.empty());
      after.clear();
      for (const auto& entry : std::filesystem::recursive_directory_iterator(dataset.folder))
        if (entry.is_regular_file()) after.push_back(entry.path().string());
      std::sort(after.begin(), after.end());
      EXPECT_EQ(after, before) << asked;
    }
    EXPECT_FALSE(merge_dataset(dataset, {copy, false, [] { return false; }}).stopped);
  }
}

TEST(DatasetMerge, LeavesOutWhatFailedAndNumbersEpisodesForMinari) {
  for (const bool single : {true, false})
    for (const bool copy : {false, true}) {
      const Folder folder;
      const DatasetFiles dataset = write_with_gaps(folder, single, single ? "none" : "deflate");
      const MergeResult result = merge_dataset(dataset, {copy, false});
      EXPECT_EQ(result.demos, 22);
      EXPECT_EQ(result.failed, 18);
      EXPECT_EQ(result.steps, (EpisodeSteps{288, 1 + 2 + 3, 10 + 26 + 42}));
      EXPECT_EQ(stored_steps(h5::open_file(result.file)), result.steps);
      EXPECT_EQ(summarise(dataset).steps, result.steps);
      EXPECT_EQ(examine_dataset(dataset).steps, result.steps);
      EXPECT_EQ(result.train + result.valid, 22);
      EXPECT_THAT(examine_shard(result.file).problems, IsEmpty());
      const h5::Id merged = h5::open_file(result.file), data = h5::open_group(merged, "data");
      EXPECT_EQ(h5::link_count(data), 22U);
      EXPECT_FALSE(h5::has_link(data, "demo_7"));
      EXPECT_EQ(h5::read_numbers<double>(h5::open_group(merged, "failed/episode_20"), "q").at(1),
                20);
      // Three rows: 1 and 2 of obs, then final_obs, which is row 3.
      for (hsize_t j = 0; j < 3; ++j)
        for (std::size_t k = 0; k < 2; ++k)
          EXPECT_EQ(
              row(merged, "data/demo_33/next_obs/v", j)[k],
              tangere::testing::dataset_number<double>(33, 2, static_cast<std::int64_t>(j) + 1, k));
      const h5::Id view = h5::open_file(result.minari + "/data/main_data.hdf5");
      EXPECT_EQ(h5::link_count(view), 22U);
      std::vector<std::int64_t> demos;
      for (int j = 0; j < 22; ++j) {
        const h5::Id episode = h5::open_group(view, "episode_" + std::to_string(j));
        EXPECT_EQ(h5::read_numbers<std::int64_t>(episode, "id").at(0), j);
        demos.push_back(h5::read_numbers<std::int64_t>(episode, "demo").at(0));
      }
      EXPECT_THAT(demos, ElementsAre(1, 2, 3, 4, 5, 6, 8, 9, 10, 11, 12, 13, 14, 15, 32, 33, 34, 35,
                                     36, 37, 38, 39));
    }
}

/// Unknown is not 0.
TEST(DatasetMerge, HasNoCountsOfStepsWhereAShardHasNone) {
  const Folder folder;
  const std::vector<std::string> files = write_with_gaps(folder, true, "none").files;
  for (const std::string& file : files) tangere::testing::make_older(file, 6);
  change(files[1], [](hid_t file) { H5Adelete(file, "simulation_steps"); });
  const DatasetFiles dataset = find_dataset(folder / "set");
  const MergeResult result = merge_dataset(dataset, {});
  EXPECT_EQ(result.steps, std::nullopt);
  EXPECT_EQ(stored_steps(h5::open_file(result.file)), std::nullopt);
  EXPECT_EQ(summarise(dataset).steps, std::nullopt);
  const DatasetReport report = examine_dataset(dataset);
  EXPECT_EQ(report.steps, std::nullopt);
  EXPECT_FALSE(report.has_label_sums);
  EXPECT_THAT(report.problems, IsEmpty());
}

/// The view of a data set with a name of its own is one folder deeper.
TEST(DatasetMerge, ShowsNumbersFromAFolderOfItsOwnName) {
  for (const bool copy : {false, true}) {
    const Folder folder;
    DatasetLayout l = dataset_layout(16);
    l.scene_name = "ball";
    l.set_name = "own";
    {
      DatasetWriter writer({folder / "set"}, l);
      write_block(writer, l, 0);
    }
    const MergeResult result = merge_dataset(find_dataset(folder / "set"), {copy, false});
    EXPECT_EQ(result.minari_id, "tangere/ball/own-v0");
    EXPECT_EQ(result.minari, folder / "set/minari/tangere/ball/own-v0");
    EXPECT_EQ(result.successes, std::nullopt);
    const h5::Id view = h5::open_file(result.minari + "/data/main_data.hdf5");
    for (hsize_t j = 0; j < 4; ++j)
      EXPECT_EQ(row(view, "episode_9/observations/v", j)[1],
                tangere::testing::dataset_number<double>(9, 2, static_cast<std::int64_t>(j), 1));
    EXPECT_EQ(row(view, "episode_9/actions", 2)[1],
              tangere::testing::dataset_number<float>(9, 0, 2, 1));
  }
}

/// The id becomes a path.
TEST(DatasetMerge, RefusesAnIdThatIsNone) {
  for (const std::string id : {"tangere/../../x-v0", "elsewhere/x-v0", "tangere/x", "tangere/-v0",
                               "tangere/a/b/c-v0", "/tangere/x-v0", "tangere//x-v0", ""}) {
    const Folder folder;
    DatasetLayout l = dataset_layout(16);
    {
      DatasetWriter writer({folder / "set"}, l);
      write_block(writer, l, 0);
    }
    change(folder / "set/shard-00000.h5", [&](hid_t file) {
      const hid_t scene = H5Gopen2(file, "scene", H5P_DEFAULT);
      EXPECT_GE(H5Adelete(scene, "dataset_id"), 0);
      const hid_t type = H5Tcopy(H5T_C_S1), space = H5Screate(H5S_SCALAR);
      H5Tset_size(type, H5T_VARIABLE);
      const hid_t said = H5Acreate2(scene, "dataset_id", type, space, H5P_DEFAULT, H5P_DEFAULT);
      const char* const text = id.c_str();
      EXPECT_GE(H5Awrite(said, type, &text), 0);
      H5Aclose(said);
      H5Sclose(space);
      H5Tclose(type);
      H5Gclose(scene);
    });
    EXPECT_THAT(complaint(find_dataset(folder / "set"), false),
                HasSubstr("'dataset_id' of its shards is '" + id + "'; expected tangere/NAME-v0"));
    EXPECT_FALSE(std::filesystem::exists(folder / "set/minari")) << id;
  }
}

/// Minari needs both bounds of every number in nested lists: its metadata must not grow with a pad.
TEST(DatasetMerge, LeavesFieldsTooLargeForMinariOutOfItsSpaces) {
  for (const int rows : {256, 512}) {
    const Folder folder;
    DatasetLayout l = dataset_layout(1);
    SensorLayout& pad = l.sensors[0];
    pad.rows = rows;
    pad.cols = 341;  // 256 × 341 × 3 numbers are the most that go in
    pad.points = rows * pad.cols;
    {
      DatasetWriter writer({folder / "set"}, l);
      write_block(writer, l, 0);
    }
    const MergeResult result = merge_dataset(find_dataset(folder / "set"), {false, false});
    const auto bytes = std::filesystem::file_size(result.minari + "/data/metadata.json");
    if (rows == 256) {
      EXPECT_THAT(result.minari_left_out, IsEmpty());
      EXPECT_GT(bytes, 1'000'000U);
    } else {
      EXPECT_THAT(result.minari_left_out, ElementsAre("skin"));
      EXPECT_LT(bytes, 10'000U);
    }
    EXPECT_THAT(examine_shard(result.file).problems, IsEmpty());
  }
}

/// 20 episodes in two shards, of a sensor with this name.
DatasetFiles write_named(const Folder& folder, const std::string& sensor) {
  DatasetLayout l = dataset_layout(20);
  l.shards = 2;
  l.sensors[0].name = sensor;
  DatasetWriter writer({folder / "set"}, l);
  write_block(writer, l, 0);
  write_block(writer, l, 16);
  return find_dataset(folder / "set");
}

/// HDF5 takes the sources of virtual datasets for patterns.
TEST(DatasetMerge, ShowsSensorsWhosePercentSignsAreNoPattern) {
  for (const std::string sensor : {"p%c", "p%%c", "%b", "100%"})
    for (const bool copy : {false, true}) {
      const Folder folder;
      const MergeResult result = merge_dataset(write_named(folder, sensor), {copy, false});
      EXPECT_THAT(examine_shard(result.file).problems, IsEmpty()) << sensor;
      {
        const h5::Id merged = h5::open_file(result.file);
        EXPECT_EQ(row(merged, "data/demo_17/next_obs/" + sensor, 2),
                  row(merged, "data/demo_17/final_obs/" + sensor, 0))
            << sensor;
      }
      const h5::Id view = h5::open_file(result.minari + "/data/main_data.hdf5");
      for (hsize_t j = 0; j < 4; ++j)
        EXPECT_EQ(row(view, "episode_17/observations/" + sensor, j)[5],
                  tangere::testing::dataset_number<double>(17, 3, static_cast<std::int64_t>(j), 5));
    }
}

TEST(DatasetMerge, NamesTheShardAndTheMemberThatCannotBeOpened) {
  for (const bool copy : {false, true}) {
    const Folder folder;
    const DatasetFiles dataset = write_named(folder, "skin");
    change(folder / "set/shard-00000.h5", [](hid_t file) {
      EXPECT_GE(H5Ldelete(file, "data/demo_9/final_obs/skin", H5P_DEFAULT), 0);
    });
    EXPECT_THAT(complaint(dataset, copy),
                AllOf(HasSubstr("shard-00000.h5' is damaged: demo_9: "), HasSubstr("skin")));
    EXPECT_FALSE(std::filesystem::exists(folder / "set/robomimic.hdf5"));
  }
}

TEST(DatasetMerge, NamesTheShardThatHasNotAllItsEpisodes) {
  const Folder folder;
  const DatasetFiles dataset = write_named(folder, "skin");
  change(folder / "set/shard-00000.h5",
         [](hid_t file) { EXPECT_GE(H5Ldelete(file, "data/demo_9", H5P_DEFAULT), 0); });
  EXPECT_THAT(
      complaint(dataset, false),
      HasSubstr("shard-00000.h5' is damaged: it has 15 demos and 0 failed episodes; expected 16"));
}

/// Links show what is in the shards, and validate says what is wrong with it; a copy is not made of
/// it.
TEST(DatasetMerge, CopiesNoNumbersThatAreNotThoseWritten) {
  const Folder folder;
  const DatasetFiles dataset = write_named(folder, "skin");
  change(folder / "set/shard-00001.h5", [](hid_t file) {
    const hid_t actions = H5Dopen2(file, "data/demo_18/actions", H5P_DEFAULT);
    const std::array<float, 6> others{0.25F, 0, 0, 0, 0, 0};
    EXPECT_GE(H5Dwrite(actions, H5T_NATIVE_FLOAT, H5S_ALL, H5S_ALL, H5P_DEFAULT, others.data()), 0);
    H5Dclose(actions);
  });
  EXPECT_THAT(complaint(dataset, true),
              HasSubstr("shard-00001.h5' is damaged: the checksum of its numbers is "));
  EXPECT_FALSE(std::filesystem::exists(folder / "set/robomimic.hdf5"));
  EXPECT_FALSE(std::filesystem::exists(folder / "set/robomimic.hdf5.part"));
}

/// A run that was killed between the two leaves the view alone.
TEST(DatasetMerge, ReplacesAViewWithoutItsFile) {
  const Folder folder;
  const DatasetFiles dataset = write_named(folder, "skin");
  const MergeResult first = merge_dataset(dataset, {});
  EXPECT_THAT(complaint(dataset, false), HasSubstr("robomimic.hdf5' exists already"));
  std::filesystem::remove(first.file);
  EXPECT_EQ(complaint(dataset, false), "");
  EXPECT_TRUE(std::filesystem::exists(first.file));
}

}  // namespace
}  // namespace tangere
