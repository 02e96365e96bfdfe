// SPDX-License-Identifier: Apache-2.0
// Windows of touch in data sets: the numbers of a finer trajectory, the same bytes on any number of
// threads and after a stop, whatever the storage, and every command that reads them.
#include <gmock/gmock.h>
#include <hdf5.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_listing.hpp"
#include "io/view/view_reader.hpp"
#include "tests/apps/arrays.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kFirstShard = "/shard-00000.h5";

json make_windows(const Folder& folder, const std::string& what, const std::string& out,
                  const Words& more) {
  return run_json(folder, Words{"generate", what, "--output", out, "--seed", "3"} + more);
}

/// A reading of environment e at each step, (steps + 1, numbers): those of a trajectory with a row
/// each `between` steps, of which the first has none.
std::vector<std::vector<double>> rows_of_trajectory(const Array& array, std::size_t environment) {
  const std::size_t width = array.values.size() / array.dims[0] / array.dims[1];
  std::vector<std::vector<double>> rows;
  for (std::size_t row = 0; row < array.dims[0]; ++row) {
    const auto from = array.values.begin() +
                      static_cast<std::ptrdiff_t>((row * array.dims[1] + environment) * width);
    rows.emplace_back(from, from + static_cast<std::ptrdiff_t>(width));
  }
  return rows;
}

/// Row `row` and place `k` of an array (rows, window, …).
std::vector<double> reading(const Array& array, std::size_t row, std::size_t k) {
  const std::size_t width = array.values.size() / array.dims[0] / array.dims[1];
  const auto from =
      array.values.begin() + static_cast<std::ptrdiff_t>((row * array.dims[1] + k) * width);
  return {from, from + static_cast<std::ptrdiff_t>(width)};
}

std::string shard_of(const Folder& folder, const std::string& out) {
  return folder.path(out + kFirstShard);
}

/// An action of box pushing is five steps, and nothing comes before the first one.
TEST(WindowsRecord, OfATaskHaveTheReadingsOfSimulate) {
  const Folder folder;
  const json done = make_windows(folder, "box_pushing", "push",
                                 {"--episodes", "3", "--record", "q,tactile,pad/1,pad.sum/1"});
  EXPECT_EQ(done["touching"], 3);
  run_json(folder, {"simulate", "box_pushing", "-o", "push.h5", "--envs", "3", "--seed", "3",
                    "--policy", "scripted", "--precision", "mixed", "--record", "pad/1"});
  const Array fine = array_of(folder.path("push.h5"), "tactile/pad/force");
  const h5::Id file = h5::open_file(shard_of(folder, "push")),
               scene = h5::open_group(file, "scene");
  EXPECT_THAT(h5::read_texts(scene, "windows"), ElementsAre("pad", "pad.sum"));
  EXPECT_THAT(h5::read_numbers<std::int64_t>(scene, "window_every"), ElementsAre(1, 1));
  EXPECT_THAT(h5::read_texts(scene, "observation_units"), Contains("N, N, N, m, m, m"));
  for (std::size_t e = 0; e < 3; ++e) {
    const std::string name = "data/demo_" + std::to_string(e) + "/";
    const Array pad = array_of(shard_of(folder, "push"), name + "obs/pad"),
                last = array_of(shard_of(folder, "push"), name + "final_obs/pad"),
                shown = array_of(shard_of(folder, "push"), name + "obs/tactile");
    const std::vector<std::vector<double>> steps = rows_of_trajectory(fine, e);
    const std::size_t rows = pad.dims[0], window = pad.dims[1];
    ASSERT_EQ(pad.dims, (h5::Dims{rows, window, 13, 10, 3}));
    for (std::size_t row = 1; row < rows; ++row)
      for (std::size_t k = 0; k < window; ++k)
        ASSERT_EQ(reading(pad, row, k), steps[(row - 1) * window + k]) << row << " " << k;
    for (std::size_t k = 0; k < window; ++k)
      ASSERT_EQ(reading(last, 0, k), steps[(rows - 1) * window + k]) << k;
    for (std::size_t row = 0; row < rows; ++row)  // the task observes the pad at each row
      ASSERT_EQ(
          reading(pad, row, window - 1),
          std::vector<double>(shown.values.begin() + static_cast<std::ptrdiff_t>(row * 390),
                              shown.values.begin() + static_cast<std::ptrdiff_t>((row + 1) * 390)));
  }
}

/// Its first action belongs to the reset, so the first window has readings of it.
TEST(WindowsRecord, BeginInTheWarmUp) {
  const Folder folder;
  make_windows(folder, "stable_grasp", "grasp",
               {"--episodes", "2", "--record", "flow,left_pad/45,right_pad.pressure"});
  run_json(folder, {"simulate", "stable_grasp", "-o", "grasp.h5", "--envs", "2", "--seed", "3",
                    "--policy", "scripted", "--precision", "mixed", "--record", "left_pad/45"});
  const Array fine = array_of(folder.path("grasp.h5"), "tactile/left_pad/force");
  for (std::size_t e = 0; e < 2; ++e) {
    const Array pad =
        array_of(shard_of(folder, "grasp"), "data/demo_" + std::to_string(e) + "/obs/left_pad");
    const std::vector<std::vector<double>> steps = rows_of_trajectory(fine, e);
    ASSERT_EQ(pad.dims[1], 4U);
    for (std::size_t row = 0; row < pad.dims[0]; ++row)
      for (std::size_t k = 0; k < 4; ++k)
        ASSERT_EQ(reading(pad, row, k), steps[row * 4 + k]) << row << " " << k;
  }
  const h5::Id file = h5::open_file(shard_of(folder, "grasp"));
  EXPECT_FALSE(h5::has_link(h5::open_group(file, "data/demo_0/obs"), "q")) << "not in the list";
}

TEST(WindowsRecord, HaveTheSameBytesOnAnyThreadsAndAfterAStop) {
  const Folder folder;
  const Words what{"--episodes", "40", "--shards", "2", "--record", "tactile,pad/1"};
  make_windows(folder, "box_pushing", "two", what + Words{"--threads", "2"});
  make_windows(folder, "box_pushing", "one", what + Words{"--threads", "1"});
  EXPECT_EQ(file_bytes(shard_of(folder, "two")), file_bytes(shard_of(folder, "one")));
  std::filesystem::remove(folder.path("one/shard-00001.h5"));
  make_windows(folder, "box_pushing", "one", what + Words{"--resume"});
  EXPECT_EQ(file_bytes(folder.path("two/shard-00001.h5")),
            file_bytes(folder.path("one/shard-00001.h5")));
  const Outcome other = run(folder, {"generate", "box_pushing", "-o", "one", "--episodes", "40",
                                     "--shards", "2", "--seed", "3", "--resume"});
  EXPECT_EQ(other.exit_code, 2) << "without the windows it is another data set";
}

/// A field of 32 × 32 points is large: its windows are cut into tiles.
TEST(WindowsRecord, OfLargeFieldsLeaveOutTilesOfZeros) {
  const Folder folder;
  const std::string ball = scene("rolling_ball_small.xml");
  const Words what{"--episodes", "3", "--steps", "120", "--every", "20", "--record", "q,pad/2"};
  const json sparse = make_windows(folder, ball, "sparse", what),
             dense = make_windows(folder, ball, "dense", what + Words{"--tactile", "dense"}),
             small = make_windows(folder, ball, "small", what + Words{"--compress", "deflate"});
  EXPECT_LT(2 * sparse["bytes"].get<double>(), dense["bytes"].get<double>());
  EXPECT_LT(small["bytes"].get<double>(), sparse["bytes"].get<double>());
  bool touched = false;
  for (const char* name :
       {"data/demo_0/obs/pad", "data/demo_2/obs/pad", "data/demo_1/final_obs/pad"}) {
    const Array whole = array_of(shard_of(folder, "dense"), name);
    ASSERT_EQ(whole.dims.size(), 5U);
    EXPECT_EQ(whole.dims[1], 10U);
    for (const double x : whole.values) touched = touched || x != 0;
    for (const char* out : {"sparse", "small"}) {
      const Array cut = array_of(shard_of(folder, out), name);
      EXPECT_EQ(cut.dims, whole.dims);
      EXPECT_TRUE(cut.values == whole.values) << out << " " << name;
    }
  }
  EXPECT_TRUE(touched) << "the pad does not touch: no test";
  const auto sum = [&](const char* out) {
    return h5::read_number<std::uint64_t>(h5::open_file(shard_of(folder, out)), "content_sum");
  };
  EXPECT_EQ(sum("sparse"), sum("dense"));
  for (const char* out : {"sparse", "dense", "small"}) run_json(folder, {"validate", out});
}

TEST(WindowsRecord, EveryCommandReadsThem) {
  const Folder folder;
  const Words what{"--episodes", "2", "--steps", "120", "--every", "20", "--record", "q,pad/5"};
  make_windows(folder, scene("rolling_ball_small.xml"), "balls", what);
  const json said = json::parse(run(folder, {"info", "balls", "--json"}).out);
  EXPECT_EQ(said["settings"]["windows"], "pad");
  EXPECT_EQ(said["settings"]["window_every"], "5");
  EXPECT_EQ(said["datasets"]["obs/pad"], "(6, 4, 32, 32, 3) float32");
  const json table = run_json(folder, {"export", "balls", "--csv", "balls.csv"});
  EXPECT_THAT(table["left_out"], ElementsAre("pad"));
  run_json(folder, {"validate", "balls/robomimic.hdf5"});
  // The page shows the newest reading, which is that of a data set without windows.
  make_windows(folder, scene("rolling_ball_small.xml"), "rows",
               {"--episodes", "2", "--steps", "120", "--every", "20", "--record", "q,pad"});
  const ViewData windows = read_view(folder.path("balls"), {}),
                 rows = read_view(folder.path("rows"), {});
  ASSERT_EQ(windows.episodes.size(), 2U);
  ASSERT_EQ(windows.episodes[1].fields.size(), 1U);
  EXPECT_EQ(windows.episodes[1].fields[0].values, rows.episodes[1].fields[0].values);
  make_windows(folder, "stable_grasp", "grasp",
               {"--episodes", "1", "--record", "q,flow,left_pad/45,right_pad"});
  const ViewData grasp = read_view(folder.path("grasp"), {});
  EXPECT_EQ(grasp.sensors.size(), 2U) << "a task's windows and readings are shown, too";
}

TEST(WindowsRecord, DamagedDescriptionsEndInAMessage) {
  const Folder folder;
  const Words what{"--episodes", "2", "--steps", "40", "--every", "20", "--record", "q,pad/5"};
  make_windows(folder, scene("rolling_ball_small.xml"), "balls", what);
  const auto with = [&](std::int64_t every) {
    const hid_t file = H5Fopen(shard_of(folder, "balls").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    H5Adelete_by_name(file, "scene", "window_every", H5P_DEFAULT);
    const hsize_t one = 1;
    const hid_t space = H5Screate_simple(1, &one, nullptr),
                attribute = H5Acreate_by_name(file, "scene", "window_every", H5T_STD_I64LE, space,
                                              H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    EXPECT_GE(H5Awrite(attribute, H5T_NATIVE_INT64, &every), 0);
    H5Aclose(attribute);
    H5Sclose(space);
    H5Fclose(file);
    const Outcome outcome = run(folder, {"validate", shard_of(folder, "balls")});
    EXPECT_EQ(outcome.exit_code, 3);
    return outcome.out + outcome.err;
  };
  EXPECT_THAT(with(7), HasSubstr("its 'pad' is read every 7 steps; expected a divisor of 20"));
  EXPECT_THAT(with(10), HasSubstr("demo_0: pad has no windows of 2 readings, which /scene says"));
}

TEST(WindowsRecord, WhatCannotBeStoredIsTold) {
  const Folder folder;
  const auto refused = [&](const std::string& what, const std::string& record) {
    const Outcome outcome =
        run(folder, {"generate", what, "-o", "out", "--episodes", "1", "--record", record});
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_EQ(folder.files(), std::vector<std::string>{});
    return outcome.err;
  };
  EXPECT_THAT(refused("box_pushing", "tactile/1"),
              HasSubstr("'tactile/1' of a task; expected 'tactile', which is in every row, or a "
                        "window of a sensor, such as 'pad/1', of less than 5 steps"));
  EXPECT_THAT(refused("box_pushing", "pad/10"), HasSubstr("'pad/10' of a task; expected 'pad'"));
  EXPECT_THAT(refused("box_pushing", "q/final"), HasSubstr("'q/final' of a task; expected 'q'"));
  EXPECT_THAT(refused("box_pushing", "pad/3"), HasSubstr("expected a divisor of 5, for a window"));
  EXPECT_THAT(refused("box_pushing", "pad/x"), HasSubstr("--record: 'pad/x': expected 'pad'"));
  EXPECT_THAT(refused("box_pushing", "pad,pad/1"), HasSubstr("'pad' is listed twice"));
  EXPECT_THAT(refused("box_pushing", "pda/1"),
              HasSubstr("unknown observation 'pda'; did you mean 'pad'?"));
  EXPECT_THAT(refused("box_pushing", "pad.markers/1"), HasSubstr("has no <markers>"));
}

}  // namespace
}  // namespace tangere::apps
