// SPDX-License-Identifier: Apache-2.0
// Tests which observations count as touch, the rows of each demo in which something is felt, and
// the masks that follow from them.
#include <gmock/gmock.h>
#include <hdf5.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_merge.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/dataset/learner_notes.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5.hpp"
#include "tests/io/synthetic_episodes.hpp"

namespace tangere {
namespace {

using nlohmann::json;
using ::tangere::testing::dataset_layout;
using ::tangere::testing::Folder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

json touch_of(const DatasetLayout& layout) { return json::parse(touch_observations(layout)); }

TEST(Touch, IsEveryReadingOfASensorWithoutImperfections) {
  DatasetLayout l = dataset_layout(20);
  const std::vector<TimedName> all = {{"q"}, {"v"}, {"skin"}, {"skin.shear"}, {"skin.ideal"}};
  l.record = all;
  EXPECT_EQ(touch_of(l), json({"skin", "skin.shear", "skin.ideal"}));
  l.record = {{"q"}, {"skin.shear"}};
  EXPECT_EQ(touch_of(l), json({"skin.shear"}));
  EXPECT_THAT(l.touch(), ElementsAre(1)) << "the second of those that are stored";
  l.record = all;
  l.sensors[0].imperfections = "noise=\"0.002\"";
  EXPECT_EQ(touch_of(l), json({"skin.ideal"}));
}

TEST(Touch, IsWhatATaskDeclares) {
  DatasetLayout l = dataset_layout(20);
  TaskSpec task;
  task.action = {"u", {2}, "1", "controls", {}};
  // A place may have the name of a sensor.
  task.observations = {{"skin", {3}, "m", "where it is", {}},
                       {"goal", {3}, "m m rad", "goal", {}},
                       {"flow", {2}, "1", "flow", {}}};
  task.observations.back().touch = true;
  l.task = task;
  EXPECT_EQ(touch_of(l), json({"flow"}));
  l.record = {{"goal"}};
  EXPECT_EQ(touch_of(l), json::array());
  l.record.clear();
  l.sensors[0].imperfections = "noise=\"0.002\"";
  EXPECT_EQ(touch_of(l), json::array()) << "a noisy pad always feels something";
}

TEST(Touch, ListsOfNamesAreReadAsTheyWereWritten) {
  EXPECT_EQ(names_in(touch_observations(dataset_layout(20))), std::vector<std::string>{"skin"});
  EXPECT_EQ(names_in("[]"), std::vector<std::string>{});
  for (const char* text : {"", "[", "skin", "[1]", "{\"skin\":1}"})
    EXPECT_EQ(names_in(text), std::nullopt) << text;
}

/// Every fourth episode feels something in its last state alone, which is no row of obs.
bool feels(std::int64_t episode, std::int64_t row) {
  return episode % 4 == 0 ? row == 3 : (episode * 5 + row) % 3 == 0;
}

std::int64_t rows_that_feel(std::int64_t episode) {
  std::int64_t count = 0;
  for (int row = 0; row < 3; ++row) count += feels(episode, row);
  return count;
}

/// Writes rows of one block. What is felt is the last number of a row; the zeros are negative.
template <class T>
void write_rows(EpisodeSink& sink, const DatasetLayout& l, std::int64_t block, int first,
                int count) {
  const tangere::testing::SyntheticPiece<T> piece(l, block, first, count);
  EpisodeRows rows = piece.rows();
  std::vector<T> skin;
  for (int e = 0; e < rows.episodes; ++e)
    for (int row = first; row < first + count; ++row) {
      skin.resize(skin.size() + 3 * static_cast<std::size_t>(l.sensors[0].points), T{-0.0});
      if (feels(block + e, row)) skin.back() = std::numeric_limits<T>::denorm_min();
    }
  std::vector<Observation> observations(rows.observations.begin(), rows.observations.end());
  observations.back() = std::span<const T>(skin);
  rows.observations = observations;
  sink.write(rows);
}

void write_set(const std::string& folder, const DatasetLayout& l) {
  DatasetWriter writer({folder}, l);
  for (const std::int64_t block : {0, 16}) {
    const bool whole = l.compression != "none";  // a piece must not begin within a chunk
    for (const auto& [first, count] :
         whole ? std::vector{std::pair{0, 4}} : std::vector{std::pair{0, 2}, {2, 2}})
      if (l.single)
        write_rows<float>(writer, l, block, first, count);
      else
        write_rows<double>(writer, l, block, first, count);
    writer.finish(
        block,
        block == 0 ? std::vector{tangere::testing::failure(2)} : std::vector<FailedEpisode>{}, {});
  }
}

/// The demos that a mask of a merged file names, as numbers.
std::vector<std::int64_t> mask(const h5::Id& file, const std::string& name) {
  const h5::Id dataset = h5::open_dataset(file, "mask/" + name);
  const hsize_t count = h5::dimensions(dataset).at(0);
  const h5::Id type(H5Dget_type(dataset.get()));
  const std::size_t width = H5Tget_size(type.get());
  std::string names(count * width, '\0');
  EXPECT_GE(H5Dread(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, names.data()), 0);
  std::vector<std::int64_t> numbers;
  for (std::size_t k = 0; k < count; ++k)
    numbers.push_back(std::stoll(names.substr(k * width + std::string("demo_").size(), width)));
  return numbers;
}

/// Sets the attribute "touching" of a demo.
void set_touching(const std::string& shard, const char* demo, std::int64_t value) {
  const hid_t file = H5Fopen(shard.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  ASSERT_GE(file, 0);
  const hid_t owner = H5Oopen(file, demo, H5P_DEFAULT),
              attribute = H5Aopen(owner, "touching", H5P_DEFAULT);
  EXPECT_GE(H5Awrite(attribute, H5T_NATIVE_INT64, &value), 0);
  H5Aclose(attribute);
  H5Oclose(owner);
  H5Fclose(file);
}

class TouchOf : public ::testing::TestWithParam<std::tuple<bool, const char*>> {};

TEST_P(TouchOf, RowsIsCountedInEveryDemoAndNamesTheMasks) {
  const Folder folder;
  DatasetLayout l = dataset_layout(20, std::get<0>(GetParam()));
  l.compression = std::get<1>(GetParam());
  write_set(folder / "set", l);
  const MergeResult merged = merge_dataset(find_dataset(folder / "set"), {});
  EXPECT_THAT(examine_shard(folder / "set/shard-00000.h5").problems, IsEmpty());
  EXPECT_THAT(examine_shard(merged.file).problems, IsEmpty());
  const h5::Id file = h5::open_file(merged.file);
  std::vector<std::int64_t> expected;
  for (std::int64_t e = 0; e < 20; ++e) {
    if (e == 2) continue;  // it failed
    const h5::Id demo = h5::open_group(file, "data/demo_" + std::to_string(e));
    EXPECT_EQ(h5::read_number<std::int64_t>(demo, "touching"), rows_that_feel(e)) << e;
    if (rows_that_feel(e) > 0) expected.push_back(e);
  }
  ASSERT_EQ(expected.size(), 14);
  EXPECT_EQ(merged.touching, 14);
  EXPECT_EQ(mask(file, "touching"), expected);
  std::vector<std::int64_t> parts = mask(file, "train_touching");
  const std::vector<std::int64_t> valid = mask(file, "valid_touching"), all = mask(file, "valid");
  EXPECT_TRUE(std::includes(all.begin(), all.end(), valid.begin(), valid.end()));
  parts.insert(parts.end(), valid.begin(), valid.end());
  std::sort(parts.begin(), parts.end());
  EXPECT_EQ(parts, expected);
}

INSTANTIATE_TEST_SUITE_P(Files, TouchOf,
                         ::testing::Values(std::tuple{true, "none"}, std::tuple{false, "none"},
                                           std::tuple{true, "lz4"}, std::tuple{false, "deflate"}));

TEST(Touch, HasNoMaskWhereNoneIsStored) {
  const Folder folder;
  DatasetLayout l = dataset_layout(20);
  l.sensors[0].imperfections = "noise=\"0.002\"";
  write_set(folder / "set", l);
  const MergeResult merged = merge_dataset(find_dataset(folder / "set"), {});
  EXPECT_EQ(merged.touching, std::nullopt);
  EXPECT_THAT(examine_shard(merged.file).problems, IsEmpty());
  EXPECT_FALSE(h5::has_link(h5::open_group(h5::open_file(merged.file), "mask"), "touching"));
}

/// What `validate` and `merge` say of a set whose /scene has this text as `touch`, in this order.
std::pair<std::string, std::string> complaints(const char* touch) {
  const Folder folder;
  write_set(folder / "set", dataset_layout(20));
  const std::string shard = folder / "set/shard-00000.h5";
  {
    const hid_t file = H5Fopen(shard.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t scene = H5Gopen(file, "scene", H5P_DEFAULT);
    H5Adelete(scene, "touch");
    const hid_t type = H5Tcopy(H5T_C_S1), space = H5Screate(H5S_SCALAR);
    H5Tset_size(type, H5T_VARIABLE);
    const hid_t attribute = H5Acreate(scene, "touch", type, space, H5P_DEFAULT, H5P_DEFAULT);
    EXPECT_GE(H5Awrite(attribute, type, &touch), 0);
    H5Aclose(attribute);
    H5Sclose(space);
    H5Tclose(type);
    H5Gclose(scene);
    H5Fclose(file);
  }
  const std::vector<std::string> problems = examine_shard(shard).problems;
  std::string merged;
  try {
    merge_dataset(find_dataset(folder / "set"), {});
  } catch (const IoError& error) {
    merged = error.what();
  }
  return {problems.empty() ? "" : problems.front(), merged};
}

TEST(Touch, ListsThatAreWrongAreFound) {
  for (const auto& [touch, found] :
       {std::pair{"[skin", "'touch' of /scene is [skin; expected a JSON list of names"},
        {"[\"skin\",\"nix\"]", "'touch' of /scene names 'nix'; expected stored observations"},
        {"[\"skin\",\"skin\"]", "'touch' of /scene names 'skin'; expected stored observations"},
        {"[]", "demo_0: 'touching' is there; /scene names no touch"}}) {
    const auto [validate, merge] = complaints(touch);
    EXPECT_THAT(validate, HasSubstr(found));
    EXPECT_THAT(merge, HasSubstr(found));
    EXPECT_THAT(merge, HasSubstr("shard-00000.h5"));
  }
}

TEST(Touch, CountsThatAreWrongAreFound) {
  const Folder folder;
  write_set(folder / "set", dataset_layout(20));
  const std::string shard = folder / "set/shard-00000.h5";
  set_touching(shard, "data/demo_1", 3);
  EXPECT_THAT(examine_shard(shard).problems,
              ElementsAre("demo_1: 'touching' is 3; something is felt in 1 of its rows"));
  set_touching(shard, "data/demo_1", 4);
  try {
    merge_dataset(find_dataset(folder / "set"), {});
    ADD_FAILURE();
  } catch (const IoError& error) {
    EXPECT_THAT(error.what(), HasSubstr("demo_1: something is felt in 4 of its rows; expected 0"));
  }
}

}  // namespace
}  // namespace tangere
