// SPDX-License-Identifier: Apache-2.0
// Tests tasks on the command line: files with rewards and ends, summaries with successes, and
// refusals.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5.hpp"
#include "tests/apps/program.hpp"
#include "tests/sanitized.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

TEST(Tasks, GenerateStoresRewardsAndEnds) {
  const Folder folder;
  const json answer =
      run_json(folder, {"generate", "dummy", "-o", "set", "--episodes", "20", "--threads", "2"});
  EXPECT_EQ(answer.at("task"), "dummy");
  EXPECT_EQ(answer.at("policy"), "scripted");
  EXPECT_EQ(answer.at("successes"), 20);
  EXPECT_EQ(answer.at("success_rate"), 1);
  EXPECT_EQ(answer.at("rows"), 800);
  EXPECT_EQ(answer.at("simulation_steps"), 4000);
  const std::string shard = folder.path("set/shard-00000.h5");
  EXPECT_EQ(check_shard(shard).rows, 800);
  const h5::Id file = h5::open_file(shard);
  EXPECT_EQ(h5::read_text(h5::open_group(file, "scene"), "task"), "dummy");
  double mean = 0;
  for (int e = 0; e < 20; ++e) {
    const h5::Id demo = h5::open_group(file, "data/demo_" + std::to_string(e));
    std::vector<float> rewards(40);
    h5::read_box(h5::open_dataset(demo, "rewards"), {0}, {40}, rewards.data());
    double sum = 0;
    for (const float r : rewards) sum += r;
    const double stored = h5::read_numbers<double>(demo, "return").at(0);
    EXPECT_NEAR(sum, stored, 1e-5 * std::abs(stored));
    EXPECT_EQ(h5::read_numbers<std::int8_t>(demo, "success").at(0), 1);
    EXPECT_EQ(h5::dimensions(h5::open_dataset(demo, "obs/error")), (h5::Dims{40, 1}));
    EXPECT_EQ(h5::dimensions(h5::open_dataset(demo, "obs/q")), (h5::Dims{40, 10}));
    mean += stored / 20;
  }
  EXPECT_NEAR(answer.at("mean_return"), mean, 1e-9 * std::abs(mean));
}

TEST(Tasks, GenerateStoresASkinThatRemembers) {
  const Folder folder;
  const json answer =
      run_json(folder, {"generate", "insertion_elastic", "-o", "set", "--episodes", "2"});
  EXPECT_EQ(answer.at("task"), "insertion_elastic");
  const std::string shard = folder.path("set/shard-00000.h5");
  EXPECT_EQ(check_shard(shard).rows, answer.at("rows"));
  const h5::Id file = h5::open_file(shard);
  EXPECT_EQ(h5::dimensions(h5::open_dataset(file, "data/demo_0/obs/flow")).at(2), 13U);
  EXPECT_THAT(h5::read_text(h5::open_group(file, "scene"), "text"), HasSubstr("ks=\"62.5\""));
}

TEST(Tasks, GenerateWritesTheSameBytesOnAnyNumberOfThreads) {
  const Folder folder;
  for (const char* threads : {"1", "3"})
    run_json(folder, {"generate", "box_pushing", "-o", std::string("set") + threads, "--episodes",
                      "50", "--threads", threads, "--policy", "random", "--seed", "4"});
  EXPECT_EQ(folder.read("set1/shard-00000.h5"), folder.read("set3/shard-00000.h5"));
}

TEST(Tasks, ATableHoldsActions) {
  const Folder folder;
  folder.write("a.csv", "0.1\n0.2\n");
  const json answer = run_json(
      folder, {"generate", "dummy", "-o", "set", "--episodes", "1", "--controls", "a.csv"});
  EXPECT_EQ(answer.at("policy"), "csv");
  std::vector<float> actions(3);
  h5::read_box(
      h5::open_dataset(h5::open_file(folder.path("set/shard-00000.h5")), "data/demo_0/actions"),
      {0, 0}, {3, 1}, actions.data());
  EXPECT_THAT(actions, testing::ElementsAre(0.1F, 0.2F, 0.2F));
}

TEST(Tasks, SimulateStoresActionsAndRewards) {
  const Folder folder;
  const json answer =
      run_json(folder, {"simulate", "dummy", "-o", "d.h5", "--envs", "18", "--seed", "3"});
  EXPECT_EQ(answer.at("steps"), 200);
  EXPECT_EQ(answer.at("successes"), 18);
  const json set = run_json(folder, {"generate", "dummy", "-o", "set", "--episodes", "18", "--seed",
                                     "3", "--precision", "double"});
  EXPECT_DOUBLE_EQ(answer.at("mean_return"), set.at("mean_return"));
  const h5::Id file = h5::open_file(folder.path("d.h5"));
  EXPECT_EQ(h5::read_text(file, "task"), "dummy");
  EXPECT_EQ(h5::dimensions(h5::open_dataset(file, "task/action")), (h5::Dims{40, 18, 1}));
  // Both show row 40 of an episode last.
  std::vector<double> q(10), final_q(10);
  h5::read_box(h5::open_dataset(file, "q"), {200, 17, 0}, {1, 1, 10}, q.data());
  h5::read_box(h5::open_dataset(h5::open_file(folder.path("set/shard-00000.h5")),
                                "data/demo_17/final_obs/q"),
               {0, 0}, {1, 10}, final_q.data());
  EXPECT_EQ(q, final_q);
}

TEST(Tasks, ASceneAloneSaysThatItHasNone) {
  const Folder folder;
  const std::string small = scene("rolling_ball_small.xml");
  const json simulated = run_json(folder, {"simulate", small, "-o", "s.h5", "--steps", "5"});
  EXPECT_TRUE(simulated.at("task").is_null());
  EXPECT_THAT(h5::read_text(h5::open_file(folder.path("s.h5")), "task"),
              HasSubstr("every reward is 0"));
  const json set =
      run_json(folder, {"generate", small, "-o", "set", "--episodes", "1", "--steps", "5"});
  EXPECT_TRUE(set.at("task").is_null());
  const h5::Id shard = h5::open_file(folder.path("set/shard-00000.h5"));
  EXPECT_THAT(h5::read_text(h5::open_group(shard, "scene"), "task"),
              HasSubstr("every reward is 0"));
}

TEST(Tasks, BenchCountsActions) {
  const Folder folder;
  const json answer = run_json(folder, {"bench", "box_pushing_reduced", "--envs", "32", "--threads",
                                        "1,2", "--repeat", "1"});
  EXPECT_EQ(answer.at("task"), "box_pushing_reduced");
  EXPECT_EQ(answer.at("policy"), "random");
  EXPECT_EQ(answer.at("steps_per_action"), 5);
  EXPECT_EQ(answer.at("runs").at(0).at("steps"), 100);
  EXPECT_EQ(answer.at("runs").at(0).at("checksum"), answer.at("runs").at(1).at("checksum"));
  EXPECT_EQ(answer.at("runs").at(0).at("frames"), "none");
  const double passes = answer.at("runs").at(0).at("newton_iterations");
  EXPECT_GE(passes, 1) << "of each of the five steps of an action";
  EXPECT_LT(passes, 4) << "not of an action";
}

TEST(Tasks, WhatTheyCannotTakeIsAnError) {
  const Folder folder;
  const std::string small = scene("rolling_ball_small.xml");
  struct Case {
    Words words;
    const char* says;
  };
  const Case cases[] = {
      {{"generate", "box_pushin", "-o", "s", "--episodes", "1"}, "did you mean 'box_pushing'?"},
      {{"simulate", "dumy", "-o", "s.h5"}, "did you mean 'dummy'?"},
      {{"bench", "dumy"}, "neither a file nor a task"},
      {{"generate", "dummy", "-o", "s", "--episodes", "1", "--steps", "3"},
       "--steps with task 'dummy'"},
      {{"simulate", "dummy", "-o", "s.h5", "--tol", "1e-6"}, "--tol with task 'dummy'"},
      {{"bench", "dummy", "--every", "2"}, "--every with task 'dummy'"},
      {{"bench", small, "--policy", "random"}, "expected a task"},
      {{"generate", "dummy", "-o", "s", "--episodes", "1", "--policy", "scripte"},
       "did you mean 'scripted'?"},
      {{"generate", "dummy", "-o", "s", "--episodes", "1", "--policy", "csv"},
       "--policy csv without --controls"},
      {{"simulate", "dummy", "-o", "s.h5", "--policy", "hold", "--controls", "a.csv"},
       "expected csv"},
  };
  for (const Case& c : cases) {
    const Outcome outcome = run(folder, c.words);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(c.says));
  }
  EXPECT_THAT(folder.files(), IsEmpty());
}

TEST(Tasks, GradcheckChecksTheReturn) {
  const Folder folder;
  const json answer = run_json(
      folder, {"gradcheck", "box_pushing", "--actions", "12", "--entries", "4", "--seed", "3"});
  EXPECT_EQ(answer.at("command"), "gradcheck");
  EXPECT_EQ(answer.at("task"), "box_pushing");
  EXPECT_EQ(answer.at("policy"), "scripted");
  EXPECT_EQ(answer.at("loss_name"), "return");
  EXPECT_LT(answer.at("loss"), 0);
  EXPECT_EQ(answer.at("actions"), 12);
  EXPECT_EQ(answer.at("steps"), 60);
  EXPECT_LT(answer.at("max_relative_error"), 1e-6);
  EXPECT_GE(answer.at("entries"), 8);
  EXPECT_EQ(answer.at("inputs").at(0).at("input"), "actions");
  EXPECT_EQ(answer.at("inputs").at(0).at("size"), 36);
}

/// A grasp that is lifted level pays 100, even under small disturbances.
TEST(Tasks, GradcheckThatComparesNothingFails) {
  const Folder folder;
  const Words words{"gradcheck", "stable_grasp", "--actions", "1", "--entries", "1"};
  const Outcome text = run(folder, words);
  EXPECT_EQ(text.exit_code, 1);
  EXPECT_THAT(text.err,
              HasSubstr("nothing could be compared with differences: no input acts on the return"));
  EXPECT_THAT(text.err, HasSubstr("try another --seed or --policy"));
  EXPECT_THAT(text.out, Not(HasSubstr("largest error")));
  if (kSanitized) return;  // the same once more
  EXPECT_EQ(run_json(folder, words, 1).at("entries"), 0);
}

/// Shows every observation, shape and unit that a task declares; then the scene, with the numbers
/// that the task varies.
TEST(Tasks, InspectShowsWhatATaskDeclares) {
  const Folder folder;
  const Outcome text = run(folder, {"inspect", "box_pushing"});
  EXPECT_EQ(text.exit_code, 0) << text.err;
  for (const char* says :
       {"task box_pushing: ", "action drive (3) [1], -1 to 1", "tactile (13, 10, 3) [N]",
        "5 steps per action", "at most 100 actions", "scene box_pushing", "effects\n", "stages\n"})
    EXPECT_THAT(text.out, HasSubstr(says));
  const json answer = run_json(folder, {"inspect", "insertion"});
  const json& task = answer.at("task");
  EXPECT_EQ(task.at("name"), "insertion");
  EXPECT_EQ(task.at("action").at("shape"), json({3}));
  EXPECT_EQ(task.at("action").at("low"), -1);
  EXPECT_EQ(task.at("observations").at(0).at("name"), "flow");
  EXPECT_EQ(task.at("observations").at(0).at("shape"), json({4, 13, 10}));
  EXPECT_EQ(task.at("moments"), json({6, 44, 45}));
  EXPECT_EQ(task.at("steps_per_action"), 45);
  EXPECT_EQ(task.at("horizon"), 14);
  EXPECT_EQ(task.at("opening"), true);
  EXPECT_EQ(answer.at("randomized").size(), 14U) << "the skin of two pads, which the task varies";
  EXPECT_TRUE(run_json(folder, {"inspect", scene("insertion.xml")}).at("task").is_null());
  EXPECT_TRUE(run_json(folder, {"inspect", "dummy"})
                  .at("task")
                  .at("observations")
                  .at(0)
                  .at("low")
                  .is_null());
  const Outcome typo = run(folder, {"inspect", "box_pushin"});
  EXPECT_EQ(typo.exit_code, 2);
  EXPECT_THAT(typo.err, HasSubstr("did you mean 'box_pushing'?"));
  const Outcome unknown = run(folder, {"inspect", "dummy", "--allow-unknown"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.err, HasSubstr("--allow-unknown with task 'dummy'"));
}

TEST(Tasks, GradcheckRefusesWhatIsOfScenesAlone) {
  const Folder folder;
  for (const Words& option : {Words{"--loss", "path"}, Words{"--steps", "3"}, Words{"--every", "2"},
                              Words{"--actions", "101"}}) {
    Words words{"gradcheck", "box_pushing"};
    words.insert(words.end(), option.begin(), option.end());
    const Outcome outcome = run(folder, words);
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.err, HasSubstr(option[0]));
  }
  const Outcome scene_alone =
      run(folder, {"gradcheck", scene("rolling_ball_small.xml"), "--actions", "3"});
  EXPECT_EQ(scene_alone.exit_code, 2);
  EXPECT_THAT(scene_alone.err, HasSubstr("expected a task"));
}

}  // namespace
}  // namespace tangere::apps
