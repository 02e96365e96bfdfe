// SPDX-License-Identifier: Apache-2.0
// Tests --sleep as users see it: what runs report, what is refused, and that nothing changes
// without it.
#include <gmock/gmock.h>

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
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("wrong.xml" + line), HasSubstr("sleep 1.5"), HasSubstr("below 1")));
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

TEST(Sleeping, ARunThatGoesOnStartsAwakeAndSaysSo) {
  const Folder folder;
  simulate_boxes(folder, "first.h5", kShort + Words{"--sleep"});
  const Outcome outcome = run(
      folder,
      Words{"simulate", kBoxes, "-o", "second.h5", "--state-from", "first.h5", "--sleep"} + kShort);
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.err, HasSubstr("does not hold which bodies slept"));
}

}  // namespace
}  // namespace tangere::apps
