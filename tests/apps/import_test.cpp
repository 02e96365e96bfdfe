// SPDX-License-Identifier: Apache-2.0
// tangere import as a user runs it: a gripper and a vase become a data set, word for word as in
// docs/robots.md, and what is refused.
#include <gmock/gmock.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>

#include "tests/apps/arrays.hpp"
#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

const std::string kGrasp = TANGERE_SOURCE_DIR "/examples/grasp";
const std::string kHand = TANGERE_TEST_DATA "/robots/hand.urdf";

TEST(Import, AGripperAndAnObjectBecomeADataSet) {
  const Folder folder;
  std::filesystem::copy(kGrasp, folder.path("grasp"), std::filesystem::copy_options::recursive);
  const Words command = {"import",  "grasp/gripper.urdf",
                         "-o",      "grasp/gripper.xml",
                         "--pad",   "left_finger=gelsight_mini_measured@-y",
                         "--pad",   "right_finger=gelsight_mini_measured@+y",
                         "--motor", "lift=2000,100",
                         "--motor", "left_slide=800,40"};
  const json made = run_json(folder, command);
  EXPECT_EQ(made["format"], "URDF");
  EXPECT_EQ(made["joints"], 3);
  EXPECT_EQ(made["motors"], 2);
  EXPECT_EQ(made["sensors"], 2);
  EXPECT_THAT(made["lost"], SizeIs(0));
  EXPECT_EQ(run(folder, command).exit_code, 3) << "an output is kept";
  EXPECT_EQ(run_json(folder, {"inspect", "grasp/grasp.xml"})["u_names"],
            json({"lift.rate", "left_slide.rate"}));
  run_json(folder, {"simulate", "grasp/grasp.xml", "-o", "run.h5", "--steps", "20"});
  run_json(folder, {"view", "run.h5", "-o", "run.html"});
  run_json(folder, {"generate", "grasp/grasp.xml", "-o", "data", "--episodes", "2", "--steps", "20",
                    "--every", "10"});
  run_json(folder, {"view", "data", "-o", "data.html", "--scene", "grasp/grasp.xml"});
}

/// docs/hands.md, word for word: upside down the hand holds the egg.
TEST(Import, AHandTurnsAnEggOver) {
  const Folder folder;
  std::filesystem::copy(TANGERE_SOURCE_DIR "/examples/hand", folder.path("hand"),
                        std::filesystem::copy_options::recursive);
  const json made =
      run_json(folder, {"import", "hand/hand.urdf", "-o", "hand/hand.xml", "--pad",
                        "thumb_tip=uskin_4x4_guess@-x", "--pad", "index_tip=uskin_4x4_guess@-x",
                        "--pad", "middle_tip=uskin_4x4_guess@-x", "--motor", "wrist=20,1",
                        "--motor", "thumb_knuckle=2,0.02", "--motor", "index_knuckle=2,0.02",
                        "--motor", "middle_knuckle=2,0.02"});
  EXPECT_THAT(made["lost"], SizeIs(0));
  EXPECT_EQ(made["joints"], 7);
  const json told = run_json(folder, {"simulate", "hand/hand_egg.xml", "-o", "run.h5"});
  EXPECT_THAT(told["failed"], SizeIs(0));
  const auto q = array_of(folder.path("run.h5"), "q");
  constexpr std::size_t kWidth = 14, kEgg = 7, kTurned = 750, kEnd = 1000;
  const auto at = [&](std::size_t row, std::size_t k) { return q.values[row * kWidth + k]; };
  for (std::size_t k = kEgg; k < kWidth; ++k) EXPECT_NEAR(at(kEnd, k), at(kTurned, k), 1e-4);
  EXPECT_LT(at(kEnd, kEgg + 2), -0.04) << "below the wrist, where it began above";
  for (std::size_t row = 0; row <= kEnd; ++row) EXPECT_EQ(at(row, 2), 0.8 * at(row, 1));
  run_json(folder, {"view", "run.h5", "-o", "run.html"});
  run_json(folder, {"generate", "hand/hand_egg.xml", "-o", "set", "--episodes", "2", "--steps",
                    "20", "--every", "5"});
  EXPECT_EQ(run(folder, {"info", "set"}).exit_code, 0);
  run_json(folder, {"view", "set", "-o", "set.html", "--scene", "hand/hand_egg.xml"});
}

TEST(Import, AFileThatLosesMotionIsRefusedWithoutDrop) {
  const Folder folder;
  folder.write("gripper.urdf", std::regex_replace(file_bytes(kGrasp + "/gripper.urdf"),
                                                  std::regex("<mimic joint=\"left_slide\"/>"),
                                                  "<mimic joint=\"right_slide\"/>"));
  const Words command = {"import", "gripper.urdf", "-o", "gripper.xml"};
  const Outcome refused = run(folder, command);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("joint 'right_slide' follows 'right_slide', which follows it "
                                     "in turn (line "));
  EXPECT_FALSE(std::filesystem::exists(folder.path("gripper.xml")));
  EXPECT_THAT(run_json(folder, command + Words{"--drop"})["lost"], SizeIs(1));
}

TEST(Import, WhatIsNoRequestIsSaid) {
  const Folder folder;
  const auto fault = [&](const Words& more) {
    const Outcome outcome =
        run(folder, Words{"import", kHand, "--output", "hand.xml", "--overwrite"} + more);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    return outcome.err;
  };
  EXPECT_THAT(fault({"--pad", "tip"}), HasSubstr("--pad tip: expected LINK=LAYOUT"));
  EXPECT_THAT(fault({"--pad", "tip=digit_gues"}), HasSubstr("did you mean 'digit_guess'"));
  EXPECT_THAT(fault({"--pad", "tip=digit"}), HasSubstr("did you mean 'digit_guess'"));
  EXPECT_THAT(fault({"--pad", "tipp=digit_guess"}), HasSubstr("did you mean 'tip'"));
  EXPECT_THAT(fault({"--pad", "tip=digit_guess@+x"}), HasSubstr("is no box"));
  EXPECT_THAT(fault({"--pad", "tip=digit_guess@1,2"}), HasSubstr("2 numbers behind '@'"));
  EXPECT_THAT(fault({"--motor", "slid=force"}), HasSubstr("did you mean 'slide'"));
  EXPECT_THAT(fault({"--motor", "slide=-1"}), HasSubstr("a gain P above 0"));
  EXPECT_THAT(fault({"--motor", "loose=force"}),
              HasSubstr("no bound of its force (<limit effort> of URDF"));
  EXPECT_THAT(fault({"--contact", "finger=groun"}), HasSubstr("has no link 'groun'"));
  EXPECT_THAT(fault({"--base", "afloat"}), HasSubstr("expected fixed or free"));
  const Outcome same = run(folder, {"import", kHand, "-o", kHand, "--overwrite"});
  EXPECT_EQ(same.exit_code, 2);
  EXPECT_THAT(run(folder, {"inspect", kHand}).err,
              HasSubstr("'tangere import' makes a scene of it"));
  EXPECT_EQ(run(folder, {"import", "none.urdf", "-o", "none.xml"}).exit_code, 3);
  EXPECT_THAT(folder.files(), ElementsAre());
}

/// The number of points that the name of a layout has, as 10x8 or 19; 0 if it has none.
int points_in(const std::string& name) {
  std::smatch found;
  if (std::regex_search(name, found, std::regex("_(\\d+)x(\\d+)")))
    return std::stoi(found[1]) * std::stoi(found[2]);
  return std::regex_search(name, found, std::regex("_(\\d+)_")) ? std::stoi(found[1]) : 0;
}

TEST(Import, EveryLayoutLoads) {
  const Folder folder;
  for (const auto& entry :
       std::filesystem::directory_iterator(TANGERE_SOURCE_DIR "/scenes/sensors")) {
    if (entry.path().extension() != ".xml") continue;
    const std::string name = entry.path().stem().string();
    const json made = run_json(folder, {"import", kHand, "-o", name + ".xml", "--pad",
                                        "finger=" + name + "@0,0,0.06", "--quiet"});
    EXPECT_EQ(made["sensors"], 1) << name;
    const json sensor = run_json(folder, {"inspect", name + ".xml"})["sensors"][0];
    EXPECT_EQ(sensor["pressure_sign"], 1) << name;
    if (const int points = points_in(name); points > 0) {
      EXPECT_EQ(sensor["points"], points) << name;
    }
  }
}

}  // namespace
}  // namespace tangere::apps
