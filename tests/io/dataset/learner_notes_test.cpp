// SPDX-License-Identifier: Apache-2.0
// Tests what files tell learners: names of environments and data sets, scales, what is privileged.
#include "io/dataset/learner_notes.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "engine/base/error.hpp"
#include "tests/io/synthetic_episodes.hpp"

namespace tangere {
namespace {

using nlohmann::json;
using ::tangere::testing::dataset_layout;
using ::testing::HasSubstr;

/// A task of three observations: one scale, one for each place of the last axis, none.
DatasetLayout of_task() {
  DatasetLayout l = dataset_layout(20);
  TaskSpec task;
  task.name = "box_pushing_privileged";
  task.action = {"u", {2}, "1", "controls", {}};
  task.observations = {{"goal", {3}, "m m rad", "goal", {0.1, 0.1, 0.3}},
                       {"tactile", {3, 4, 3}, "N", "field", {0.5}},
                       {"box", {3}, "m m rad", "box", {}}};
  task.observations.back().privileged = true;
  l.task = task;
  l.played_by = {"scripted", {"scripted"}, 0, 0};
  return l;
}

TEST(LearnerNotes, NameTheEnvironment) {
  EXPECT_EQ(environment_id("box_pushing"), "tangere/BoxPushing-v0");
  EXPECT_EQ(environment_id("dummy"), "tangere/Dummy-v0");
  EXPECT_EQ(robomimic_environment(of_task()),
            R"({"env_name":"tangere/BoxPushingPrivileged-v0","type":2,)"
            R"("env_kwargs":{"task":"box_pushing_privileged"},"env_version":"0.1.0"})");
  EXPECT_EQ(robomimic_environment(dataset_layout(20)),
            R"({"env_name":"syn \"thetic\"","type":2,"env_kwargs":{}})");
  const json spec = json::parse(gymnasium_environment("cap_opening"));
  EXPECT_EQ(spec.at("id"), "tangere/CapOpening-v0");
  EXPECT_EQ(spec.at("entry_point"), "tangere.gym:make_env");
  EXPECT_EQ(spec.at("kwargs"), json({{"task", "cap_opening"}, {"normalise", false}}));
  EXPECT_EQ(spec.at("additional_wrappers"), json::array());
  for (const char* key : {"reward_threshold", "max_episode_steps", "vector_entry_point"})
    EXPECT_TRUE(spec.at(key).is_null()) << key;
}

TEST(LearnerNotes, SayScalesAndWhatIsPrivilegedOfWhatIsStored) {
  DatasetLayout l = of_task();
  EXPECT_EQ(json::parse(observation_scale(l)), json({{"goal", {0.1, 0.1, 0.3}}, {"tactile", 0.5}}));
  EXPECT_EQ(json::parse(privileged_observations(l)), json({"q", "v", "box"}));
  l.record = {"v", "tactile"};
  EXPECT_EQ(json::parse(observation_scale(l)), json({{"tactile", 0.5}}));
  EXPECT_EQ(json::parse(privileged_observations(l)), json::array({"v"}));
  EXPECT_EQ(observation_scale(dataset_layout(20)), "{}");
  EXPECT_EQ(privileged_observations(dataset_layout(20)), R"(["q","v"])");
}

TEST(LearnerNotes, IdsSayWhoPlayed) {
  DatasetLayout l = of_task();
  EXPECT_EQ(l.dataset_id(), "tangere/box_pushing_privileged/scripted-v0");
  l.played_by.policy = "random";
  EXPECT_EQ(l.dataset_id(), "tangere/box_pushing_privileged/random-v0");
  l.played_by = {"scripted", {"scripted", "random"}, 0.1, 0.3};
  EXPECT_EQ(l.dataset_id(), "tangere/box_pushing_privileged/scripted-noise-random-v0");
  l.set_name = "expert_2";
  EXPECT_EQ(l.dataset_id(), "tangere/box_pushing_privileged/expert_2-v0");
  l = dataset_layout(20);
  EXPECT_EQ(l.dataset_id(), "tangere/syn--thetic--v0");
  l.set_name = "own";
  EXPECT_EQ(l.dataset_id(), "tangere/syn--thetic-/own-v0");
  EXPECT_NO_THROW(l.check());
  for (const std::string name : {"a b", "a/b", "../x", "ä", "a.b"}) {
    l.set_name = name;
    try {
      l.check();
      ADD_FAILURE() << name;
    } catch (const InputError& error) {
      EXPECT_THAT(error.what(), HasSubstr("--name " + name + ": expected at most 100 letters"));
    }
  }
}

}  // namespace
}  // namespace tangere
