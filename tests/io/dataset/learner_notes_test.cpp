// SPDX-License-Identifier: Apache-2.0
// Tests what files tell learners: names of environments and data sets, scales, what is privileged.
#include "io/dataset/learner_notes.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "engine/base/error.hpp"
#include "io/dataset/dataset_merge.hpp"
#include "io/dataset/dataset_writer.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5.hpp"
#include "tests/io/synthetic_episodes.hpp"

namespace tangere {
namespace {

using nlohmann::json;
using ::tangere::testing::dataset_layout;
using ::tangere::testing::Folder;
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

TEST(LearnerNotes, NameTheReadingsThatTheEnvironmentShows) {
  DatasetLayout l = of_task();
  EXPECT_THAT(readings_in(robomimic_environment(l)), ::testing::IsEmpty());
  const std::string sensor = l.sensors.front().name;
  l.every = 20;
  l.record = {{"q"}, {"goal"}, {sensor + ".sum", {5}}, {sensor + ".shear"}};
  const std::vector<std::string> words{sensor + ".shear", sensor + ".sum/5"};
  EXPECT_EQ(json::parse(robomimic_environment(l)).at("env_kwargs").at("readings"), json(words));
  EXPECT_EQ(readings_in(robomimic_environment(l)), words);
  EXPECT_EQ(json::parse(gymnasium_environment("box_pushing", "", words)).at("kwargs"),
            json({{"task", "box_pushing"}, {"normalise", false}, {"readings", words}}));
  for (const char* text : {"{", "3", R"({"env_kwargs":{"readings":3}})", R"({"env_kwargs":[]})"})
    EXPECT_THAT(readings_in(text), ::testing::IsEmpty()) << text;
}

TEST(LearnerNotes, NameTheClassOfATaskInPython) {
  DatasetLayout l = of_task();
  l.task->name = "Lift";
  l.python_class = "robots.tasks:Lift";
  EXPECT_EQ(json::parse(robomimic_environment(l)).at("env_name"), "tangere/Lift-v0");
  EXPECT_EQ(json::parse(robomimic_environment(l)).at("env_kwargs"),
            json({{"task", "robots.tasks:Lift"}}));
  const json spec = json::parse(gymnasium_environment("Lift", l.python_class));
  EXPECT_EQ(spec.at("id"), "tangere/Lift-v0");
  EXPECT_EQ(spec.at("entry_point"), "tangere.scene_env:SceneEnv");
  EXPECT_EQ(spec.at("kwargs"), json({{"task", "robots.tasks:Lift"}}));
}

TEST(LearnerNotes, SayScalesAndWhatIsPrivilegedOfWhatIsStored) {
  DatasetLayout l = of_task();
  EXPECT_EQ(json::parse(observation_scale(l)), json({{"goal", {0.1, 0.1, 0.3}}, {"tactile", 0.5}}));
  EXPECT_EQ(json::parse(privileged_observations(l)), json({"q", "v", "box"}));
  l.record = {{"v"}, {"tactile"}};
  EXPECT_EQ(json::parse(observation_scale(l)), json({{"tactile", 0.5}}));
  EXPECT_EQ(json::parse(privileged_observations(l)), json::array({"v"}));
  EXPECT_EQ(observation_scale(dataset_layout(20)), "{}");
  EXPECT_EQ(privileged_observations(dataset_layout(20)), R"(["q","v"])");
}

TEST(LearnerNotes, IdsSayWhoPlayed) {
  DatasetLayout l = of_task();
  EXPECT_EQ(l.dataset_id(), "tangere/box_pushing_privileged/scripted-v0");
  l.played_by = {"random", {"random"}, 0, 0};
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

/// 16 episodes of which 2 failed. Policy 1 played every third, and every second solved the task.
TEST(LearnerNotes, SayWhoPlayedEachEpisodeAndWhichSolvedIt) {
  const Folder folder;
  DatasetLayout l = of_task();
  l.episodes = 16;
  l.task->observations = {{"skin", {3, 4, 3}, "N", "field", {}}};
  l.task->success = "always";
  l.played_by = {"scripted", {"scripted", "random"}, 0, 0.3};
  {
    DatasetWriter writer({folder / "set"}, l);
    const tangere::testing::SyntheticPiece<float> piece(l, 0, 0, 4);
    EpisodeRows rows = piece.rows();
    const std::vector<float> rewards(std::size_t{16} * 3, 0.5F);
    std::vector<EpisodeEnd> ends;
    for (int e = 0; e < 16; ++e) ends.push_back({3, 1.5, false, e % 2 == 0, e % 3 == 0 ? 1 : 0});
    rows.rewards = rewards;
    rows.ends = ends;
    writer.write(rows);
    writer.finish(0, std::vector{tangere::testing::failure(3), tangere::testing::failure(4)}, {});
  }
  const MergeResult merged = merge_dataset(find_dataset(folder / "set"), {});
  EXPECT_EQ(merged.successes, 7) << "the even ones without 4";
  EXPECT_THAT(examine_shard(merged.file).problems, ::testing::IsEmpty());
  const h5::Id file = h5::open_file(merged.file);
  const auto policy = [&](const std::string& path) {
    return h5::read_number<std::int64_t>(h5::open_group(file, path), "policy");
  };
  for (const int e : {0, 6, 9, 12, 15}) EXPECT_EQ(policy("data/demo_" + std::to_string(e)), 1) << e;
  for (const int e : {1, 2, 5, 14}) EXPECT_EQ(policy("data/demo_" + std::to_string(e)), 0) << e;
  EXPECT_EQ(policy("failed/episode_3"), 1);
  EXPECT_EQ(policy("failed/episode_4"), 0);
  EXPECT_EQ(h5::dimensions(h5::open_dataset(file, "mask/success")), h5::Dims{7});
  EXPECT_EQ(h5::dimensions(h5::open_dataset(file, "mask/random")), h5::Dims{5});
  EXPECT_EQ(h5::dimensions(h5::open_dataset(file, "mask/scripted")), h5::Dims{9});
}

}  // namespace
}  // namespace tangere
