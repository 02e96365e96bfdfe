// SPDX-License-Identifier: Apache-2.0
// Tests --sleep as users see it: what runs report, what is refused, and that nothing changes
// without it.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstring>

#include "io/hdf5/h5.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kBoxes = scene("ten_boxes.xml");
const Words kShort{"--steps", "120"};

json simulate_boxes(const Folder& folder, const std::string& output, const Words& more) {
  return run_json(folder, Words{"simulate", kBoxes, "-o", output} + more);
}

bool says_sleep(const Folder& folder, const std::string& file) {
  return H5Aexists(h5::open_file(folder.path(file)).get(), "sleep") > 0;
}

TEST(Sleeping, RunsSayHowManyBodiesSlept) {
  const Folder folder;
  const json slept = simulate_boxes(folder, "slept.h5", kShort + Words{"--sleep"});
  EXPECT_EQ(slept.at("sleep"), 1e-3);
  EXPECT_GT(slept.at("mean_asleep"), 5);
  EXPECT_LE(slept.at("mean_asleep"), 11);
  const json awake = simulate_boxes(folder, "awake.h5", kShort);
  EXPECT_EQ(awake.at("sleep"), 0);
  EXPECT_TRUE(awake.at("mean_asleep").is_null());
  EXPECT_TRUE(says_sleep(folder, "slept.h5"));
  EXPECT_FALSE(says_sleep(folder, "awake.h5"));  // such files are as they were
  const json measured = run_json(
      folder, Words{"bench", kBoxes, "--sleep", "--envs", "3", "--threads", "1,2"} + kShort);
  EXPECT_EQ(measured.at("sleep"), 1e-3);
  for (const json& one : measured.at("runs")) {
    EXPECT_GT(one.at("mean_asleep"), 5);
    EXPECT_EQ(one.at("checksum"), measured.at("runs").at(0).at("checksum"));
  }
  const json made = run_json(folder, Words{"generate", kBoxes, "-o", "set", "--sleep", "--episodes",
                                           "2", "--every", "10", "--no-merge"} +
                                         kShort);
  EXPECT_EQ(made.at("sleep"), 1e-3);
  EXPECT_GT(made.at("mean_asleep"), 5);
  const Outcome people = run(
      folder,
      Words{"bench", kBoxes, "--sleep", "--envs", "2", "--threads", "1", "--repeat", "1"} + kShort);
  EXPECT_THAT(people.out + people.err, HasSubstr("bodies asleep: "));
}

TEST(Sleeping, TheSceneMayAskForIt) {
  const Folder folder;
  std::string text = file_bytes(kBoxes);
  const std::string head = "<ground ";
  text.insert(text.find(head), "<solver_option sleep=\"2e-3\"/>\n  ");
  const std::string asks = folder.write("asks.xml", text);
  EXPECT_EQ(run_json(folder, Words{"inspect", asks}).at("sleep"), 2e-3);
  const json slept = run_json(folder, Words{"simulate", asks, "-o", "out.h5", "--sleep"} + kShort);
  EXPECT_EQ(slept.at("sleep"), 2e-3);  // the scene's number
  const std::string line =
      ":" + std::to_string(
                1 + std::count(text.begin(),
                               text.begin() + std::ptrdiff_t(text.find("<solver_option")), '\n'));
  for (const Words& words :
       {Words{"gradcheck", asks}, Words{"simulate", asks, "-o", "g.h5", "--gradients", "final"},
        Words{"generate", asks, "-o", "g", "--episodes", "1", "--gradients", "jacobians"}}) {
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 2) << words.front();
    EXPECT_THAT(outcome.err, AllOf(HasSubstr("asks.xml" + line), HasSubstr("no derivatives")))
        << words.front();
  }
  text.replace(text.find("2e-3"), 4, "1.5");
  const Outcome outcome = run(folder, {"inspect", folder.write("wrong.xml", text)});
  EXPECT_THAT(outcome.err, AllOf(HasSubstr("wrong.xml" + line), HasSubstr("sleep=\"1.5\""),
                                 HasSubstr("below 1")));
}

TEST(Sleeping, WhatDoesNotGoTogetherIsRefused) {
  const Folder folder;
  const auto refusal = [&](const Words& words) {
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 2) << words.front();
    return outcome.err;
  };
  EXPECT_THAT(refusal({"simulate", kBoxes, "-o", "x.h5", "--sleep", "--gradients", "final"}),
              HasSubstr("--sleep"));
  EXPECT_THAT(refusal({"generate", kBoxes, "-o", "x", "--episodes", "1", "--sleep", "--gradients",
                       "jacobians"}),
              HasSubstr("--sleep"));
  EXPECT_THAT(refusal({"bench", kBoxes, "--sleep", "--error"}), HasSubstr("--error"));
  EXPECT_THAT(refusal({"simulate", scene("box_pushing_elastic.xml"), "-o", "x.h5", "--sleep"}),
              HasSubstr("ks"));
  EXPECT_FALSE(std::filesystem::exists(folder.path("x.h5")));
}

/// Numbers of a dataset of any shape, as f64.
std::vector<double> numbers_of(const h5::Id& file, const std::string& name) {
  const h5::Id dataset = h5::open_dataset(file, name);
  const h5::Dims dims = h5::dimensions(dataset);
  std::size_t count = 1;
  for (const hsize_t n : dims) count *= n;
  std::vector<double> numbers(count);
  h5::read_box<double>(dataset, h5::Dims(dims.size(), 0), dims, numbers.data());
  return numbers;
}

/// Whether the last rows of one dataset are all rows of another, to the bit.
bool ends_with(const std::vector<double>& whole, const std::vector<double>& end) {
  return end.size() <= whole.size() && std::memcmp(whole.data() + (whole.size() - end.size()),
                                                   end.data(), end.size() * sizeof(double)) == 0;
}

TEST(Sleeping, ARunThatGoesOnHasTheBitsOfOneLongRun) {
  const Folder folder;
  for (const char* const name : {"ten_boxes", "rolling_ball_small", "insertion"}) {
    const Words base{"simulate", scene(std::string(name) + ".xml"), "--sleep"};
    run_json(folder,
             base + Words{"-o", "whole.h5", "--overwrite", "--steps", "120", "--envs", "3"});
    const h5::Id whole = h5::open_file(folder.path("whole.h5"));
    const std::vector<double> rested = numbers_of(whole, "sleep/rested");
    EXPECT_GT(*std::max_element(rested.begin(), rested.end()), 0) << name << ": nothing rests";
    for (const int row : {0, 20, 37, 80}) {
      SCOPED_TRACE(name + (" from row " + std::to_string(row)));
      const Outcome outcome =
          run(folder,
              base + Words{"-o", "end.h5", "--overwrite", "--state-from", "whole.h5", "--row",
                           std::to_string(row), "--steps", std::to_string(120 - row), "--quiet"});
      ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
      const h5::Id end = h5::open_file(folder.path("end.h5"));
      for (const char* const of : {"q", "v", "sleep/island", "sleep/rested", "sleep/resting"})
        EXPECT_TRUE(ends_with(numbers_of(whole, of), numbers_of(end, of))) << of;
    }
  }
}

TEST(Sleeping, ARunThatGoesOnSaysWhatItLacks) {
  const Folder folder;
  simulate_boxes(folder, "first.h5", kShort + Words{"--sleep"});
  simulate_boxes(folder, "awake.h5", kShort);
  const auto said = [&](const std::string& from) {
    const Outcome outcome = run(folder, Words{"simulate", kBoxes, "-o", "second.h5", "--overwrite",
                                              "--state-from", from, "--sleep"} +
                                            kShort);
    EXPECT_EQ(outcome.exit_code, 0);
    return outcome.err;
  };
  EXPECT_THAT(said("first.h5"), ::testing::Not(HasSubstr("one long run")));
  EXPECT_THAT(said("awake.h5"), HasSubstr("made with sleep 0, this run has 0.001"));
  {  // as older versions wrote it
    const h5::Id file(H5Fopen(folder.path("first.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT));
    ASSERT_GE(H5Ldelete(file.get(), "sleep", H5P_DEFAULT), 0);
  }
  EXPECT_THAT(said("first.h5"), HasSubstr("does not hold which bodies slept"));
}

TEST(Sleeping, ADamagedRecordOfSleepStartsNoRun) {
  const Folder folder;
  simulate_boxes(folder, "first.h5", kShort + Words{"--sleep"});
  {
    const h5::Id file(H5Fopen(folder.path("first.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT));
    const h5::Id island(H5Dopen2(file.get(), "sleep/island", H5P_DEFAULT));
    const std::int32_t wrong = 1'000'000;
    h5::write_box<std::int32_t>(island, {120, 0, 3}, {1, 1, 1}, &wrong);
  }
  const Outcome outcome = run(
      folder,
      Words{"simulate", kBoxes, "-o", "second.h5", "--state-from", "first.h5", "--sleep"} + kShort);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("sleep state of environment 0; expected islands"));
}

}  // namespace
}  // namespace tangere::apps
