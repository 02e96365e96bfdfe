// SPDX-License-Identifier: Apache-2.0
// Tests what validate, info, merge and export say of a complete data set and of a damaged one.
#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <nlohmann/json.hpp>
#include <numeric>
#include <sstream>

#include "io/hdf5/h5_listing.hpp"
#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::ElementsAre;
using ::testing::HasSubstr;
using testing::IsEmpty;

/// 40 episodes of four rows in three shards.
class DatasetCommand : public testing::Test {
 protected:
  DatasetCommand() {
    const Outcome outcome =
        run(folder_, {"generate", scene("rolling_ball_small.xml"), "--output", "set", "--episodes",
                      "40", "--steps", "20", "--seed", "3", "--shards", "3", "--no-merge"});
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  json answer(Words words, int exit_code = 0) const {
    words.emplace_back("--json");
    const Outcome outcome = run(folder_, words);
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
    json object = json::parse(outcome.out);
    EXPECT_EQ(object.at("command"), words[0]);
    json known = object;
    known.erase("settings");  // names of attributes and datasets, described in docs/datasets.md
    known.erase("datasets");
    EXPECT_THAT(undocumented_keys(known), IsEmpty());
    return object;
  }
  /// Changes a number of a shard without updating its checksum.
  void spoil(const std::string& shard, const std::string& dataset, float value) const {
    const hid_t file = H5Fopen(folder_.path("set/" + shard).c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t id = H5Dopen2(file, dataset.c_str(), H5P_DEFAULT);
    const hid_t space = H5Dget_space(id);
    const hsize_t at[2] = {1, 2}, one[2] = {1, 1};
    const hid_t memory = H5Screate_simple(2, one, nullptr);
    H5Sselect_hyperslab(space, H5S_SELECT_SET, at, nullptr, one, nullptr);
    EXPECT_GE(H5Dwrite(id, H5T_NATIVE_FLOAT, memory, space, H5P_DEFAULT, &value), 0);
    H5Sclose(memory);
    H5Sclose(space);
    H5Dclose(id);
    H5Fclose(file);
  }
  const Folder folder_;
};

TEST_F(DatasetCommand, AWholeSetIsValidAndTellsWhatItIs) {
  const json valid = answer({"validate", "set"});
  EXPECT_THAT(valid.at("problems"), IsEmpty());
  EXPECT_EQ(valid.at("shards_read"), 3);
  EXPECT_EQ(valid.at("demos"), 40);
  EXPECT_EQ(valid.at("rows"), 160);
  const json info = answer({"info", "set"});
  EXPECT_EQ(info.at("demos"), 40);
  EXPECT_THAT(info.at("missing"), IsEmpty());
  EXPECT_EQ(info.at("settings").at("seed"), "3");
  EXPECT_EQ(info.at("settings").at("dataset_shards"), "3");
  EXPECT_EQ(info.at("datasets").at("obs/pad"), "(4, 32, 32, 3) float32");
  EXPECT_EQ(info.at("datasets").at("dones"), "(4) bool");
  EXPECT_TRUE(info.at("successes").is_null());
  const json one = answer({"info", "set/shard-00001.h5"});
  EXPECT_EQ(one.at("demos"), 16);
  EXPECT_THAT(one.at("files"), ElementsAre("set/shard-00001.h5"));
}

TEST_F(DatasetCommand, EveryProblemIsNamedWithItsFileAndDataset) {
  spoil("shard-00000.h5", "data/demo_3/obs/q", 7);
  spoil("shard-00001.h5", "data/demo_20/obs/v", std::numeric_limits<float>::quiet_NaN());
  fs::remove(folder_.path("set/shard-00002.h5"));
  const json report = answer({"validate", "set"}, 3);
  const std::vector<std::string> problems = report.at("problems");
  EXPECT_THAT(problems, testing::Contains("set/shard-00002.h5: missing"));
  EXPECT_THAT(problems,
              testing::Contains(HasSubstr("set/shard-00000.h5: the checksum of its numbers is ")));
  EXPECT_THAT(problems, testing::Contains(HasSubstr(
                            "set/shard-00001.h5: demo_20: v: row 1 has a number that is nan")));
  EXPECT_EQ(report.at("error"), problems.front());
  const json info = answer({"info", "set"});
  EXPECT_THAT(info.at("missing"), ElementsAre("set/shard-00002.h5"));
}

TEST_F(DatasetCommand, DamageAndStrangersAreProblemsNotCrashes) {
  folder_.write("set/shard-00001.h5", "no HDF5");
  const std::string first = folder_.read("set/shard-00000.h5");
  folder_.write("set/shard-00002.h5", first.substr(0, first.size() / 2));
  const json report = answer({"validate", "set"}, 3);
  for (const char* file : {"set/shard-00001.h5: ", "set/shard-00002.h5: "})
    EXPECT_THAT(report.at("problems").get<Words>(), testing::Contains(HasSubstr(file)));
  ASSERT_EQ(
      run(folder_, {"generate", scene("rolling_ball_small.xml"), "--output", "other", "--episodes",
                    "40", "--steps", "20", "--seed", "4", "--shards", "3", "--no-merge"})
          .exit_code,
      0);
  for (const char* name : {"1", "2"}) {
    const std::string shard = std::string("/shard-0000") + name + ".h5";
    fs::copy_file(folder_.path("other" + shard), folder_.path("set" + shard),
                  fs::copy_options::overwrite_existing);
  }
  EXPECT_THAT(answer({"validate", "set"}, 3).at("problems").get<Words>(),
              testing::Contains("set/shard-00001.h5: seed: 4 there, 3 here"));
  EXPECT_THAT(answer({"merge", "set"}, 3).at("error").get<std::string>(),
              HasSubstr("seed: 4 there, 3 here"));
  for (const char* command : {"validate", "info", "merge"}) {
    EXPECT_EQ(run(folder_, {command, "nowhere"}).exit_code, 3);
    EXPECT_EQ(run(folder_, {command, "."}).exit_code, 3);
  }
  EXPECT_FALSE(fs::exists(folder_.path("set/robomimic.hdf5")));
  EXPECT_THAT(answer({"validate", std::string(300, 'x')}, 3).at("error").get<std::string>(),
              HasSubstr("too long"));
}

TEST_F(DatasetCommand, MergedItIsOneFileOfLinksOrOfCopies) {
  const json merged = answer({"merge", "set"});
  EXPECT_EQ(merged.at("output"), "set/robomimic.hdf5");
  EXPECT_EQ(merged.at("demos"), 40);
  EXPECT_EQ(merged.at("train"), 36);
  EXPECT_EQ(merged.at("valid"), 4);
  EXPECT_EQ(answer({"merge", "set"}, 3).at("error"),
            "'set/robomimic.hdf5' exists already; give --overwrite to replace it");
  // Links still work after the folder moves, and a missing shard is an error.
  fs::rename(folder_.path("set"), folder_.path("moved"));
  EXPECT_EQ(answer({"validate", "moved/robomimic.hdf5"}).at("rows"), 160);
  EXPECT_EQ(answer({"info", "moved/robomimic.hdf5"}).at("settings"),
            answer({"info", "moved"}).at("settings"));
  EXPECT_EQ(answer({"merge", "moved", "--copy", "--overwrite"}).at("copy"), true);
  fs::rename(folder_.path("moved/shard-00001.h5"), folder_.path("aside.h5"));
  EXPECT_EQ(answer({"validate", "moved/robomimic.hdf5"}).at("demos"), 40);
  EXPECT_THAT(answer({"merge", "moved", "--overwrite"}, 3).at("error").get<std::string>(),
              HasSubstr("'moved/shard-00001.h5' is missing; make it"));
  fs::rename(folder_.path("aside.h5"), folder_.path("moved/shard-00001.h5"));
  ASSERT_EQ(answer({"merge", "moved", "--overwrite"}).at("copy"), false);
  fs::remove(folder_.path("moved/shard-00001.h5"));
  EXPECT_THAT(answer({"validate", "moved/robomimic.hdf5"}, 3).at("problems").get<Words>(),
              testing::Contains(HasSubstr("demo_20")));
}

/// All numbers of a dataset.
std::vector<float> numbers(const h5::Id& group, const std::string& name) {
  const h5::Id dataset = h5::open_dataset(group, name);
  const h5::Dims dims = h5::dimensions(dataset);
  std::vector<float> values(
      std::accumulate(dims.begin(), dims.end(), hsize_t{1}, std::multiplies<>()));
  h5::read_box(dataset, h5::Dims(dims.size(), 0), dims, values.data());
  return values;
}

TEST_F(DatasetCommand, MergedDemosHaveNextObservationsAndAllThatTheirShardsSay) {
  for (const char* how : {"links", "--copy"}) {
    const bool copy = how != std::string("links");
    answer(copy ? Words{"merge", "set", "--overwrite", "--copy"} : Words{"merge", "set"});
    for (const int number : {0, 17, 39}) {
      const std::string demo = "data/demo_" + std::to_string(number);
      Words said, names;
      {
        const h5::Id shard = h5::open_file(folder_.path("set/shard-0000" +
                                                        std::to_string(number < 16   ? 0
                                                                       : number < 32 ? 1
                                                                                     : 2) +
                                                        ".h5"));
        const h5::Id group = h5::open_group(shard, demo);
        for (const std::string& name : h5::attribute_names(group))
          said.push_back(name + h5::attribute_text(group, name));
        names = h5::link_names(group);
      }
      const h5::Id file = h5::open_file(folder_.path("set/robomimic.hdf5")),
                   group = h5::open_group(file, demo);
      Words here;
      for (const std::string& name : h5::attribute_names(group))
        here.push_back(name + h5::attribute_text(group, name));
      EXPECT_EQ(here, said);
      EXPECT_THAT(here, testing::Contains("num_samples4"));
      names.emplace_back("next_obs");
      EXPECT_THAT(h5::link_names(group), testing::UnorderedElementsAreArray(names));
      for (const std::string name : {"q", "v", "pad"}) {
        std::vector<float> expected = numbers(group, "obs/" + name);
        const std::vector<float> last = numbers(group, "final_obs/" + name),
                                 next = numbers(group, "next_obs/" + name);
        expected.erase(expected.begin(), expected.begin() + std::ssize(last));
        expected.insert(expected.end(), last.begin(), last.end());
        EXPECT_EQ(next, expected) << how << " " << demo << " " << name;
        const h5::Id dataset = h5::open_dataset(group, "next_obs/" + name),
                     plan(H5Dget_create_plist(dataset.get()));
        EXPECT_EQ(H5Pget_layout(plan.get()), H5D_VIRTUAL) << "no number twice";
      }
    }
    EXPECT_EQ(answer({"info", "set/robomimic.hdf5"}).at("datasets").at("next_obs/pad"),
              "(4, 32, 32, 3) float32");
  }
}

TEST_F(DatasetCommand, NextObservationsThatAreNotThoseOfTheNextRowAreAProblem) {
  answer({"merge", "set"});
  // Puts the numbers of another demo there.
  const hid_t file = H5Fopen(folder_.path("set/robomimic.hdf5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  const hid_t group = H5Gopen2(file, "data/demo_3/next_obs", H5P_DEFAULT);
  const hid_t other = H5Gopen2(file, "data/demo_4/next_obs", H5P_DEFAULT);
  EXPECT_GE(H5Ldelete(group, "q", H5P_DEFAULT), 0);
  EXPECT_GE(H5Lcreate_hard(other, "q", group, "q", H5P_DEFAULT, H5P_DEFAULT), 0);
  H5Gclose(group);
  H5Gclose(other);
  H5Fclose(file);
  EXPECT_THAT(
      answer({"validate", "set/robomimic.hdf5"}, 3).at("problems").get<Words>(),
      ElementsAre(HasSubstr("demo_3: next_obs/q is not obs one row later, in rows 0 to 2")));
}

TEST_F(DatasetCommand, MasksShareOutEveryDemoOnce) {
  answer({"merge", "set"});
  const h5::Id file = h5::open_file(folder_.path("set/robomimic.hdf5"));
  Words all;
  for (const char* mask : {"mask/train", "mask/valid"}) {
    const h5::Id dataset = h5::open_dataset(file, mask);
    const hid_t type = H5Dget_type(dataset.get());
    const std::size_t size = H5Tget_size(type);
    std::string bytes(size * h5::dimensions(dataset).at(0), '\0');
    EXPECT_GE(H5Dread(dataset.get(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()), 0);
    H5Tclose(type);
    for (std::size_t at = 0; at < bytes.size(); at += size)
      all.emplace_back(bytes.substr(at, size).c_str());
  }
  std::sort(all.begin(), all.end());
  EXPECT_EQ(all, h5::link_names(h5::open_group(file, "data")));
}

TEST_F(DatasetCommand, TheViewForMinariShowsTheSameNumbers) {
  const json merged = answer({"merge", "set"});
  EXPECT_EQ(merged.at("minari_id"), "tangere/rolling_ball_small-v0");
  const std::string place = merged.at("minari").get<std::string>() + "/data/";
  const json metadata = json::parse(folder_.read(place + "metadata.json"));
  EXPECT_EQ(metadata.at("dataset_id"), merged.at("minari_id"));
  EXPECT_EQ(metadata.at("total_episodes"), 40);
  EXPECT_EQ(metadata.at("total_steps"), 160);
  EXPECT_THAT(metadata.at("observation_space").get<std::string>(), HasSubstr("-Infinity"));
  // Opens one file at a time: the library follows no link to a file that is open in another mode.
  const auto read = [&](const std::string& file_name, const std::string& name) {
    const h5::Id file = h5::open_file(folder_.path(file_name)),
                 dataset = h5::open_dataset(file, name);
    const h5::Dims dims = h5::dimensions(dataset);
    std::vector<float> values(dims.at(0) * dims.at(1));
    h5::read_box(dataset, {0, 0}, dims, values.data());
    return values;
  };
  std::vector<float> expected = read("set/shard-00001.h5", "data/demo_17/obs/q");
  const std::vector<float> last = read("set/shard-00001.h5", "data/demo_17/final_obs/q");
  expected.insert(expected.end(), last.begin(), last.end());
  EXPECT_EQ(read(place + "main_data.hdf5", "episode_17/observations/q"), expected);
  EXPECT_EQ(read(place + "main_data.hdf5", "episode_17/actions"),
            read("set/shard-00001.h5", "data/demo_17/actions"));
}

TEST_F(DatasetCommand, ATableHasALineForEachRow) {
  const json table = answer({"export", "set", "--csv", "t.csv"});
  EXPECT_EQ(table.at("rows"), 160);
  EXPECT_EQ(table.at("columns"), 2 + 3 + 2 + 10 + 9);
  EXPECT_THAT(table.at("left_out"), ElementsAre("pad"));
  std::istringstream lines(folder_.read("t.csv"));
  std::string line;
  std::getline(lines, line);
  EXPECT_THAT(line, testing::StartsWith("episode,row,actions/"));
  int rows = 0;
  for (; std::getline(lines, line); ++rows)
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 25);
  EXPECT_EQ(rows, 160);
  EXPECT_EQ(answer({"export", "set", "--csv", "one.csv", "--episode", "39"}).at("rows"), 4);
  EXPECT_THAT(answer({"export", "set", "--csv", "none.csv", "--episode", "40"}, 3)
                  .at("error")
                  .get<std::string>(),
              HasSubstr("has no episode 40"));
  EXPECT_EQ(run(folder_, {"export", "set", "--csv", "t.csv"}).exit_code, 3);
  EXPECT_THAT(folder_.files(),
              ElementsAre("one.csv", "one.csv.json", "set", "t.csv", "t.csv.json"));
}

}  // namespace
}  // namespace tangere::apps
