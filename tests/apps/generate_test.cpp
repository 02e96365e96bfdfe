// SPDX-License-Identifier: Apache-2.0
// Tests `tangere generate` as users see it: its keys, its shards, its refusals, and the same bytes
// on any number of threads.
#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "engine/model/model.hpp"
#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using ::testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const std::string kSmall = scene("rolling_ball_small.xml");

/// `tangere generate SCENE --output set MORE`.
Words generate(const Words& more, const std::string& scene_file = kSmall) {
  return Words{"generate", scene_file, "--output", "set"} + more;
}

json generate_json(const Folder& folder, const Words& more, int exit_code = 0,
                   const std::string& scene_file = kSmall) {
  return run_json(folder, generate(more, scene_file), exit_code);
}

/// The small scene with one piece of its text replaced, as a file of the folder.
std::string changed_scene(const Folder& folder, const std::string& from, const std::string& to) {
  const Folder scenes;
  std::filesystem::copy_file(kSmall, scenes.path("small.xml"));
  std::string text = scenes.read("small.xml");
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  folder.write("scene.xml", text.replace(at, from.size(), to));
  return "scene.xml";
}

h5::Dims shape(const h5::Id& file, const std::string& name) {
  return h5::dimensions(h5::open_dataset(file, name));
}

TEST(Generate, SaysWhatItDid) {
  const Folder folder;
  const json answer = generate_json(folder, {"--episodes", "20", "--steps", "40", "--every", "4",
                                             "--threads", "2", "--seed", "9"});
  EXPECT_EQ(answer.at("scene"), kSmall);
  EXPECT_EQ(answer.at("output"), "set");
  EXPECT_THAT(answer.at("shards"), ElementsAre("set/shard-00000.h5"));
  EXPECT_EQ(answer.at("bytes"), std::filesystem::file_size(folder.path("set/shard-00000.h5")));
  EXPECT_EQ(answer.at("episodes"), 20);
  EXPECT_EQ(answer.at("rows"), 200);
  EXPECT_EQ(answer.at("steps"), 40);
  EXPECT_EQ(answer.at("every"), 4);
  EXPECT_EQ(answer.at("seed"), 9);
  EXPECT_EQ(answer.at("timestep"), 5e-3);
  EXPECT_EQ(answer.at("integrator"), "BDF2");
  EXPECT_EQ(answer.at("tolerance"),
            Model(read_scene(kSmall).scene).following_tolerance(Integrator::bdf2, 5e-3));
  EXPECT_EQ(answer.at("precision"), "mixed");
  EXPECT_EQ(answer.at("threads"), 2);
  EXPECT_GE(answer.at("peak_blocks_in_flight"), 1);
  EXPECT_LE(answer.at("peak_blocks_in_flight"), 2);  // there are no more
  EXPECT_EQ(answer.at("environment_steps"), 800);
  const double seconds = answer.at("seconds");
  EXPECT_DOUBLE_EQ(answer.at("environment_steps_per_second"), 800 / seconds);
  EXPECT_GE(answer.at("newton_iterations"), 800);
  EXPECT_EQ(answer.at("split_steps"), 0);
  EXPECT_THAT(answer.at("failed"), IsEmpty());
  EXPECT_THAT(folder.files(), ElementsAre("set"));
  const ShardContent content = check_shard(folder.path("set/shard-00000.h5"));
  EXPECT_EQ(content.demos, 20);
  EXPECT_EQ(content.rows, 200);
}

TEST(Generate, PeopleGetASummary) {
  const Folder folder;
  const Outcome text =
      run(folder, generate({"--episodes", "3", "--steps", "10", "--threads", "1"}));
  EXPECT_EQ(text.exit_code, 0) << text.err;
  EXPECT_THAT(text.err, IsEmpty());
  for (const char* part : {"episodes: 3, rows: 6, time: ", " env-steps/s with output, threads: 1\n",
                           "steps split: 0, episodes failed: 0\n", "wrote set: 1 shard ("})
    EXPECT_THAT(text.out, HasSubstr(part));
  const Outcome quiet = run(folder, generate({"--episodes", "3", "--overwrite", "--quiet"}));
  EXPECT_EQ(quiet.exit_code, 0);
  EXPECT_THAT(quiet.out + quiet.err, IsEmpty());
}

TEST(Generate, StepsRowsAndThreadsHaveDefaults) {
  const Folder folder;
  const json answer = generate_json(folder, {"--episodes", "2"});
  EXPECT_EQ(answer.at("steps"), 350);  // the scene's control ends at 1.75 s
  EXPECT_EQ(answer.at("every"), 5);    // its sensor's
  EXPECT_EQ(answer.at("rows"), 2 * 70);
  EXPECT_EQ(answer.at("seed"), 0);
  EXPECT_GE(answer.at("threads"), 1);
}

TEST(Generate, SameBytesOnAnyNumberOfThreadsAndWhenRunTwice) {
  for (const char* precision : {"mixed", "double"}) {
    const Words words{"--episodes", "70", "--steps", "40", "--precision", precision, "--threads"};
    const auto bytes = [&](const std::string& threads, const std::string& seed = "3") {
      const Folder folder;
      Words all = words;
      all.insert(all.end(), {threads, "--seed", seed});
      generate_json(folder, all);
      return folder.read("set/shard-00000.h5");
    };
    const std::string one = bytes("1");
    // Uses ==, because a message with a megabyte of differences would not help.
    EXPECT_TRUE(bytes("1") == one) << precision;
    EXPECT_TRUE(bytes("2") == one) << precision;
    EXPECT_TRUE(bytes("4") == one) << precision;
    EXPECT_FALSE(bytes("1", "4") == one) << precision;
  }
}

TEST(Generate, PrecisionDecidesWhatIsStored) {
  const Folder folder;
  const auto size_of = [&](const std::string& precision) {
    generate_json(folder,
                  {"--episodes", "1", "--steps", "5", "--precision", precision, "--overwrite"});
    const h5::Id file = h5::open_file(folder.path("set/shard-00000.h5"));
    const h5::Id dataset = h5::open_dataset(file, "data/demo_0/obs/pad");
    const h5::Id type(H5Dget_type(dataset.get()));
    return H5Tget_size(type.get());
  };
  EXPECT_EQ(size_of("mixed"), 4U);
  EXPECT_EQ(size_of("double"), 8U);
}

TEST(Generate, ControlsComeFromATable) {
  const Folder folder;
  std::string table = "# vx, vy, vz\n";
  for (int t = 0; t < 12; ++t) table += t < 5 ? "0,0.25,0.2\n" : "0.5,0,-3\n";
  folder.write("u.csv", table);
  const json answer =
      generate_json(folder, {"--episodes", "2", "--controls", "u.csv", "--steps", "10"});
  EXPECT_EQ(answer.at("rows"), 4);
  const h5::Id file = h5::open_file(folder.path("set/shard-00000.h5"));
  std::vector<float> actions(6);
  h5::read_box(h5::open_dataset(file, "data/demo_1/actions"), {0, 0}, {2, 3}, actions.data());
  EXPECT_THAT(actions, ElementsAre(0, 0.25F, 0.2F, 0.5F, 0, -1));
  EXPECT_EQ(shape(file, "data/demo_1/obs/pad"), (h5::Dims{2, 32, 32, 3}));
  const json uneven = generate_json(
      folder, {"--episodes", "2", "--controls", "u.csv", "--every", "3", "--overwrite"}, 2);
  EXPECT_THAT(uneven.at("error").get<std::string>(), HasSubstr("change at step 5"));
}

TEST(Generate, FailedEpisodesAreListedAndTheShardIsWhole) {
  // No step of one day has a solution: the ball turns too far.
  const Folder folder;
  const std::string days = changed_scene(folder, "timestep=\"5e-3\"", "timestep=\"86400\"");
  const Words words{"--episodes", "25", "--steps", "2", "--every", "1"};
  const json answer = generate_json(folder, words, 1, days);
  ASSERT_THAT(answer.at("failed"), SizeIs(25));
  EXPECT_EQ(answer.at("failed")[24].at("episode"), 24);
  EXPECT_EQ(answer.at("failed")[0].at("step"), 0);
  EXPECT_LT(answer.at("failed")[0].at("status"), 0);
  EXPECT_FALSE(answer.at("failed")[0].at("reason").get<std::string>().empty());
  EXPECT_EQ(answer.at("rows"), 0);
  EXPECT_EQ(answer.at("environment_steps"), 25);
  const ShardContent content = check_shard(folder.path("set/shard-00000.h5"));
  EXPECT_EQ(content.demos, 0);
  EXPECT_EQ(content.failed, 25);

  Words again = words;
  again.emplace_back("--overwrite");
  const Outcome people = run(folder, generate(again, days));
  EXPECT_EQ(people.exit_code, 1);
  EXPECT_THAT(people.err, HasSubstr("episode 0 failed in step 0: "));
  EXPECT_THAT(people.err, HasSubstr("not listed: 5; --json and the shards name all"));
}

TEST(Generate, ShardsThatExistAreKeptUnlessOverwritten) {
  const Folder folder;
  const Words words{"--episodes", "2", "--steps", "10"};
  generate_json(folder, words);
  const std::string before = folder.read("set/shard-00000.h5");
  std::filesystem::copy_file(folder.path("set/shard-00000.h5"), folder.path("set/shard-00007.h5"));
  folder.write("set/notes.txt", "mine");
  Words other = words;
  other.insert(other.end(), {"--seed", "1"});
  EXPECT_THAT(generate_json(folder, other, 3).at("error").get<std::string>(),
              HasSubstr("--overwrite"));
  EXPECT_TRUE(folder.read("set/shard-00000.h5") == before);
  other.emplace_back("--overwrite");
  generate_json(folder, other);
  EXPECT_FALSE(folder.read("set/shard-00000.h5") == before);
  // A shard of the older run is gone, so nobody reads two data sets as one. Files that are no
  // shards stay.
  EXPECT_FALSE(std::filesystem::exists(folder.path("set/shard-00007.h5")));
  EXPECT_EQ(folder.read("set/notes.txt"), "mine");
}

class GenerateRefuses : public testing::TestWithParam<Refusal> {};

TEST_P(GenerateRefuses, AndLeavesNothing) {
  const Refusal& refusal = GetParam();
  const Folder folder;
  Words words = refusal.words;
  if (std::find(words.begin(), words.end(), "--episodes") == words.end())
    words.insert(words.end(), {"--episodes", "2"});
  const json answer = generate_json(folder, words, refusal.exit_code);
  EXPECT_THAT(answer.at("error").get<std::string>(), HasSubstr(refusal.message));
  EXPECT_THAT(folder.files(), IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(
    Values, GenerateRefuses,
    testing::Values(
        Refusal{
            "episodes_0", {"--episodes", "0"}, 2, "--episodes 0: expected a whole number from 1"},
        Refusal{
            "episodes_word", {"--episodes", "1e3"}, 2, "--episodes 1e3: expected a whole number"},
        Refusal{"threads_0", {"--threads", "0"}, 2, "--threads 0: expected a whole number from 1"},
        Refusal{"threads_list", {"--threads", "1,2"}, 2, "--threads 1,2: expected a whole number"},
        Refusal{"every_0", {"--every", "0"}, 2, "--every 0: expected"},
        Refusal{"steps_uneven", {"--steps", "12"}, 2, "12 steps, and an action is held for 5"},
        Refusal{"held", {"--every", "35"}, 2, "change at step 100, but an action is held for 35"},
        Refusal{"precision",
                {"--precision", "half"},
                2,
                "unknown precision 'half'; expected one of double, mixed"},
        Refusal{"precision_near", {"--precision", "mixd"}, 2, "did you mean 'mixed'?"},
        Refusal{"option",
                {"--episods", "1"},
                2,
                "unknown option '--episods'; did you mean '--episodes'?"},
        Refusal{"no_timestep", {"--timestep", "0.01"}, 2, "unknown option '--timestep'"},
        Refusal{"twice", {"--seed", "1", "--seed", "2"}, 2, "--seed"},
        Refusal{"disk", {"--episodes", "1000000000"}, 3, "needs at least"},
        Refusal{"no_controls", {"--controls", "nowhere.csv"}, 3, "nowhere.csv"}),
    [](const auto& test) { return test.param.name; });

TEST(Generate, PlacesThatAreNoFoldersAreNamed) {
  const Folder folder;
  folder.write("file", "mine");
  const auto complaint = [&](const std::string& output) {
    const Outcome outcome =
        run(folder, {"generate", kSmall, "--output", output, "--episodes", "1"});
    EXPECT_EQ(outcome.exit_code, 3) << outcome.err;
    return outcome.err;
  };
  EXPECT_THAT(complaint("file"), HasSubstr("'file' exists and is not a folder"));
  EXPECT_THAT(complaint("no/set"), HasSubstr("cannot create the folder 'no/set'"));
  EXPECT_THAT(complaint("/proc/set"), HasSubstr("/proc/set"));
  EXPECT_THAT(folder.files(), ElementsAre("file"));
  EXPECT_EQ(folder.read("file"), "mine");
}

TEST(Generate, ASceneWithoutAnEndNeedsSteps) {
  const Folder folder;
  const std::string open = changed_scene(folder, " end=\"1.75\"", "");
  EXPECT_THAT(generate_json(folder, {"--episodes", "1"}, 2, open).at("error").get<std::string>(),
              HasSubstr("give --steps"));
  EXPECT_THAT(folder.files(), ElementsAre("scene.xml"));
}

TEST(Generate, ASensorThatNoFileCanHoldIsRefused) {
  const Folder folder;
  const std::string odd =
      changed_scene(folder, "<tactile name=\"pad\" body", "<tactile name=\"q\" body");
  std::string text = folder.read("scene.xml");
  const std::string by_name = "<tactile name=\"pad\" field";
  folder.write("scene.xml",
               text.replace(text.find(by_name), by_name.size(), "<tactile name=\"q\" field"));
  EXPECT_THAT(generate_json(folder, {"--episodes", "1"}, 2, odd).at("error").get<std::string>(),
              HasSubstr("sensor 'q'"));
  EXPECT_THAT(folder.files(), ElementsAre("scene.xml"));
}

}  // namespace
}  // namespace tangere::apps
