// SPDX-License-Identifier: Apache-2.0
// Tests a data set cut into shards. One process or several, at once or in turns, make the same set,
// and never a mixture.
#include <gmock/gmock.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "io/dataset/shard_check.hpp"
#include "io/hdf5/h5.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using testing::IsEmpty;

constexpr int kShards = 5;

/// 100 episodes, seven blocks, in five shards.
Words generate(const Words& more = {}, const std::string& folder = "set") {
  Words words{"generate",   scene("rolling_ball_small.xml"),
              "--output",   folder,
              "--episodes", "100",
              "--steps",    "20",
              "--seed",     "3",
              "--shards",   std::to_string(kShards)};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

std::map<std::string, std::string> bytes(const Folder& folder, const std::string& set) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::directory_iterator(folder.path(set)))
    if (entry.path().filename().string().starts_with("shard-"))
      files[entry.path().filename()] = folder.read(set + "/" + entry.path().filename().string());
  return files;
}

json answer_of(const Outcome& outcome) {
  json answer = json::parse(outcome.out);
  EXPECT_THAT(undocumented_keys(answer), IsEmpty());
  return answer;
}

/// Runs `words` once for each environment, all at the same time.
void run_beside(const Folder& folder, const Words& words, const std::vector<Words>& environments) {
  std::vector<std::unique_ptr<Program>> programs;
  for (const Words& environment : environments)
    programs.push_back(std::make_unique<Program>(folder, words, environment));
  for (const auto& program : programs) {
    const Outcome outcome = program->wait();
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  }
}

TEST(GenerateShards, AreWholeBlocksSpreadEvenlyWhateverTheThreads) {
  const Folder folder;
  ASSERT_EQ(run(folder, generate({"--threads", "1"})).exit_code, 0);
  ASSERT_EQ(run(folder, generate({"--threads", "3"}, "other")).exit_code, 0);
  const auto files = bytes(folder, "set");
  EXPECT_TRUE(files == bytes(folder, "other"));
  ASSERT_EQ(files.size(), kShards);
  std::int64_t episodes = 0;
  for (const auto& [name, text] : files) {
    const ShardContent content = check_shard(folder.path("set/" + name));
    EXPECT_EQ(content.first_episode, episodes) << name;
    EXPECT_EQ(content.first_episode % 16, 0);
    EXPECT_GE(content.demos, 16 - 12);
    EXPECT_LE(content.demos, 32);
    episodes += content.demos;
  }
  EXPECT_EQ(episodes, 100);
}

TEST(GenerateShards, OneByOneOrByThreeProcessesTheyAreTheSame) {
  const Folder folder;
  ASSERT_EQ(run(folder, generate()).exit_code, 0);
  const auto alone = bytes(folder, "set");
  for (int k = kShards - 1; k >= 0; --k)
    ASSERT_EQ(run(folder, generate({"--shard", std::to_string(k) + "/5"}, "by_one")).exit_code, 0);
  EXPECT_TRUE(bytes(folder, "by_one") == alone);
  const auto three = [](const std::string& index, const std::string& count,
                        const Words& more = {}) {
    std::vector<Words> environments;
    for (int k = 0; k < 3; ++k) {
      environments.push_back({index + "=" + std::to_string(k), count + "=3"});
      environments.back().insert(environments.back().end(), more.begin(), more.end());
    }
    return environments;
  };
  run_beside(folder, generate({"--threads", "1"}, "openmpi"),
             three("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"));
  run_beside(folder, generate({"--threads", "2"}, "pmi"), three("PMI_RANK", "PMI_SIZE"));
  run_beside(folder, generate({"--threads", "1"}, "srun"),
             three("SLURM_PROCID", "SLURM_STEP_NUM_TASKS"));
  // An array that begins at 4 with steps of 2 still has three tasks.
  std::vector<Words> array;
  for (const char* id : {"4", "6", "8"})
    array.push_back({std::string("SLURM_ARRAY_TASK_ID=") + id, "SLURM_ARRAY_TASK_COUNT=3",
                     "SLURM_ARRAY_TASK_MIN=4", "SLURM_ARRAY_TASK_STEP=2"});
  run_beside(folder, generate({"--threads", "1"}, "array"), array);
  for (const char* set : {"openmpi", "pmi", "srun", "array"})
    EXPECT_TRUE(bytes(folder, set) == alone) << set;
}

TEST(GenerateShards, UnderMpirun) {
  const std::string start =
      "OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 "
      "OMPI_MCA_rmaps_base_oversubscribe=1 mpirun -np 3 ";
  if (std::system("command -v mpirun >/dev/null") != 0) GTEST_SKIP() << "mpirun is not installed";
  if (std::system((start + "true >/dev/null 2>&1").c_str()) != 0)
    GTEST_SKIP() << "mpirun cannot start three processes on this machine";
  const Folder folder;
  ASSERT_EQ(run(folder, generate()).exit_code, 0);
  std::string command = "cd " + folder.path() + " && " + start + TANGERE_PROGRAM;
  for (const std::string& word : generate({"--threads", "1", "--quiet"}, "mpi"))
    command += " " + word;
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
  EXPECT_TRUE(bytes(folder, "mpi") == bytes(folder, "set"));
}

TEST(GenerateShards, ResumeKeepsWhatIsThereAndMakesTheRest) {
  const Folder folder;
  ASSERT_EQ(run(folder, generate()).exit_code, 0);
  const auto whole = bytes(folder, "set");
  for (const char* shard : {"set/shard-00001.h5", "set/shard-00004.h5"})
    fs::remove(folder.path(shard));
  const auto before = fs::last_write_time(folder.path("set/shard-00000.h5"));
  const Outcome outcome = run(folder, generate({"--resume", "--json"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  const json answer = answer_of(outcome);
  EXPECT_EQ(answer.at("kept"), 3);
  EXPECT_EQ(answer.at("kept_failed"), 0);
  EXPECT_EQ(answer.at("episodes"), 16 + 20);
  EXPECT_EQ(answer.at("shards").size(), 5U);
  EXPECT_TRUE(bytes(folder, "set") == whole);
  EXPECT_EQ(fs::last_write_time(folder.path("set/shard-00000.h5")), before);
  const json nothing = answer_of(run(folder, generate({"--resume", "--json"})));
  EXPECT_EQ(nothing.at("episodes"), 0);
  EXPECT_EQ(nothing.at("kept"), 5);
  // A folder that does not exist yet, and a task.
  const Words task{"generate", "dummy",    "--output", "task",    "--episodes",
                   "40",       "--shards", "3",        "--resume"};
  ASSERT_EQ(run(folder, task).exit_code, 0);
  const auto of_task = bytes(folder, "task");
  fs::remove(folder.path("task/shard-00001.h5"));
  ASSERT_EQ(run(folder, task).exit_code, 0);
  EXPECT_TRUE(bytes(folder, "task") == of_task);
}

/// Crossed planks of 10 mm that overlap by 5 mm. The contact points are their corners, which are
/// outside, so nothing drives them apart.
const char* const kPlanks = R"(<tangere model="planks">
  <option unit="m-kg" gravity="0 0 0" timestep="1e-3" integrator="BDF1"/>
  <robot><link name="low"><joint name="low" type="fixed"/>
    <body name="low" type="cuboid" size="0.4 0.02 0.01" density="1000"/></link></robot>
  <robot><link name="high"><joint name="high" type="free3d" pos="0 0 0.005"/>
    <body name="high" type="cuboid" size="0.02 0.4 0.01" density="1000"/></link></robot>
  <contact>
    <general_primitive_contact general_body="high" primitive_body="low" kn="1000" kt="1" mu="0.5"/>
  </contact>
</tangere>
)";

TEST(GenerateShards, KeptShardsWhoseContactsMissedEndWithTheSameCode) {
  const Folder folder;
  folder.write("planks.xml", kPlanks);
  const Words words{"generate", "planks.xml", "--output", "set", "--episodes", "32",
                    "--steps",  "4",          "--shards", "2",   "--json",     "--no-merge"};
  const auto expect = [](const Outcome& outcome, int made, int kept) {
    EXPECT_EQ(outcome.exit_code, 1);
    EXPECT_THAT(outcome.err, HasSubstr("contacts missed bodies in 128 of 128 steps"));
    const json answer = answer_of(outcome);
    EXPECT_EQ(answer.at("overlapping_steps"), made);
    EXPECT_EQ(answer.at("kept_overlapping_steps"), kept);
    EXPECT_EQ(answer.at("kept_tunnelled_steps"), 0);
  };
  expect(run(folder, words), 128, 0);
  const auto whole = bytes(folder, "set");
  fs::remove(folder.path("set/shard-00001.h5"));
  expect(run(folder, words + Words{"--resume"}), 64, 64);
  expect(run(folder, words + Words{"--resume"}), 0, 128);
  EXPECT_TRUE(bytes(folder, "set") == whole);
  run_json(folder, {"merge", "set"});
  for (const char* const name : {"set", "set/robomimic.hdf5"})
    for (const char* const command : {"info", "validate"}) {
      const json answer = json::parse(run(folder, {command, name, "--json"}).out);
      EXPECT_EQ(answer.at("simulation_steps"), 128) << command << " " << name;
      EXPECT_EQ(answer.at("tunnelled_steps"), 0) << command << " " << name;
      EXPECT_EQ(answer.at("overlapping_steps"), 128) << command << " " << name;
    }
  EXPECT_THAT(run(folder, {"info", "set"}).out,
              HasSubstr("a body came through another: 0, bodies overlap: 128, of 128"));
}

TEST(GenerateShards, ResumeNamesEverySettingThatDiffers) {
  const Folder folder;
  ASSERT_EQ(run(folder, generate()).exit_code, 0);
  const auto before = bytes(folder, "set");
  const auto refusal = [&](const std::string& option, const std::string& value,
                           const Words& environment = {}) {
    Words words = generate({"--resume"});
    const auto at = std::find(words.begin(), words.end(), option);
    if (at == words.end()) {
      words.insert(words.end(), {option, value});
    } else {
      at[1] = value;
    }
    const Outcome outcome = run(folder, words, environment);
    EXPECT_EQ(outcome.exit_code, 2) << option;
    EXPECT_TRUE(bytes(folder, "set") == before) << option;
    EXPECT_THAT(outcome.err, HasSubstr("'set/shard-00000.h5' belongs to another run"));
    return outcome.err;
  };
  EXPECT_THAT(refusal("--seed", "4"), HasSubstr("seed: 3 there, 4 here"));
  EXPECT_THAT(refusal("--steps", "40"), HasSubstr("steps: 20 there, 40 here"));
  EXPECT_THAT(refusal("--every", "10"), HasSubstr("every: 5 there, 10 here"));
  EXPECT_THAT(refusal("--episodes", "101"), HasSubstr("dataset_episodes: 100 there, 101 here"));
  EXPECT_THAT(refusal("--shards", "4"), HasSubstr("dataset_shards: 5 there, 4 here"));
  EXPECT_THAT(refusal("--precision", "double"), HasSubstr("precision: mixed there, double here"));
  if (const auto tables = kernels::available_kernels(); tables.size() > 1) {
    const std::string last = tables.back()->name;
    EXPECT_THAT(refusal("--seed", "3", {"TANGERE_ISA=" + last}),
                HasSubstr(" there, " + last + " here"));
  }
  folder.write("u.csv", "1,1,1\n");
  std::ofstream table(folder.path("u.csv"), std::ios::app);
  for (int i = 0; i < 20; ++i) table << "0,0,0\n";
  table.close();
  EXPECT_THAT(refusal("--controls", "u.csv"),
              HasSubstr("controls: of the scene there, a table of checksum "));
}

TEST(GenerateShards, OfAnotherSceneAreNotContinued) {
  const Folder folder;
  fs::copy_file(scene("rolling_ball_small.xml"), folder.path("s.xml"));
  Words words = generate();
  words[1] = "s.xml";
  ASSERT_EQ(run(folder, words).exit_code, 0);
  folder.write("s.xml", folder.read("s.xml") + "<!-- heavier -->\n");
  words.emplace_back("--resume");
  const Outcome outcome = run(folder, words);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("text: line "));
  EXPECT_THAT(outcome.err, HasSubstr("'<!-- heavier -->' here"));
}

TEST(GenerateShards, AreMergedByTheLastProcessAndNotBefore) {
  const Folder folder;
  const std::string merged = folder.path("set/robomimic.hdf5");
  for (int shard = 0; shard < kShards; ++shard) {
    EXPECT_FALSE(fs::exists(merged)) << shard;
    const json answer =
        answer_of(run(folder, generate({"--json", "--shard", std::to_string(shard) + "/5"})));
    EXPECT_EQ(answer.at("merged").is_null(), shard + 1 < kShards);
  }
  EXPECT_TRUE(fs::exists(merged));
  EXPECT_TRUE(
      fs::exists(folder.path("set/minari/tangere/rolling_ball_small-v0/data/main_data.hdf5")));
  EXPECT_EQ(run(folder, {"validate", "set/robomimic.hdf5"}).exit_code, 0);
  // Nothing is left to do, and it is merged again.
  const json again = answer_of(run(folder, generate({"--json", "--resume"})));
  EXPECT_EQ(again.at("merged"), "set/robomimic.hdf5");
  EXPECT_EQ(again.at("minari_id"), "tangere/rolling_ball_small-v0");
  // Nothing of an earlier run stays that could be mistaken for this one's.
  EXPECT_TRUE(answer_of(run(folder, generate({"--json", "--overwrite", "--no-merge"})))
                  .at("merged")
                  .is_null());
  EXPECT_FALSE(fs::exists(merged));
  EXPECT_FALSE(
      fs::exists(folder.path("set/minari/tangere/rolling_ball_small-v0/data/main_data.hdf5")));
}

TEST(GenerateShards, OfProcessesThatEndTogetherAreMerged) {
  const Folder folder;
  std::vector<Words> environments;
  for (int rank = 0; rank < 3; ++rank)
    environments.push_back({"PMI_RANK=" + std::to_string(rank), "PMI_SIZE=3"});
  run_beside(folder, generate(), environments);
  EXPECT_EQ(run(folder, {"validate", "set/robomimic.hdf5"}).exit_code, 0);
}

TEST(GenerateShards, OfAnotherTableOfPointsAreNotContinued) {
  const Folder folder;
  std::string text = folder.read(scene("rolling_ball_small.xml"));
  const std::size_t begin = text.find("<body name=\"pad\""), end = text.find("/>", begin) + 2;
  text.replace(begin, end - begin,
               "<body name=\"pad\" type=\"abstract\" mass=\"0.025\" inertia=\"1e-5 1e-5 1e-5\">"
               "<collision contacts=\"points.txt\"/></body>");
  folder.write("s.xml", text);
  folder.write("points.txt", "2\n0.01 0 -0.005\n-0.01 0 -0.005\n");
  Words words = generate();
  words[1] = "s.xml";
  const Outcome first = run(folder, words);
  ASSERT_EQ(first.exit_code, 0) << first.err;
  words.emplace_back("--resume");
  EXPECT_EQ(run(folder, words).exit_code, 0);
  folder.write("points.txt", "2\n0.01 0 -0.005\n-0.01 0 -0.0051\n");
  const Outcome other = run(folder, words);
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("tables: of checksum "));
}

TEST(GenerateShards, OfAnotherRunAreNotMixedInByAWorker) {
  const Folder folder;
  ASSERT_EQ(run(folder, generate({"--shard", "0/5"})).exit_code, 0);
  const Outcome again = run(folder, generate({"--shard", "0/5"}));
  EXPECT_EQ(again.exit_code, 3);
  EXPECT_THAT(again.err, HasSubstr("exists already; give --resume to keep it, or --overwrite"));
  EXPECT_EQ(run(folder, generate({"--shard", "0/5", "--overwrite"})).exit_code, 0);
  Words other = generate({"--shard", "1/5"});
  *(std::find(other.begin(), other.end(), "--seed") + 1) = "8";
  const Outcome mixed = run(folder, other);
  EXPECT_EQ(mixed.exit_code, 2);
  EXPECT_THAT(mixed.err, HasSubstr("seed: 3 there, 8 here"));
  EXPECT_THAT(bytes(folder, "set"), testing::SizeIs(1));
}

TEST(GenerateShards, SayWhatVariedInEachEpisode) {
  const Folder folder;
  ASSERT_EQ(run(folder, generate({"--shard", "1/5"})).exit_code, 0);
  const Outcome trajectory = run(folder, {"simulate", scene("rolling_ball_small.xml"), "--output",
                                          "t.h5", "--envs", "40", "--steps", "1", "--seed", "3"});
  ASSERT_EQ(trajectory.exit_code, 0) << trajectory.err;
  const h5::Id shard = h5::open_file(folder.path("set/shard-00001.h5")),
               file = h5::open_file(folder.path("t.h5"));
  const h5::Id all = h5::open_dataset(file, "randomized"),
               scene_group = h5::open_group(shard, "scene");
  const h5::Dims dims = h5::dimensions(all);
  std::vector<double> expected(dims.at(0) * dims.at(1));
  h5::read_box(all, {0, 0}, dims, expected.data());
  EXPECT_EQ(h5::read_texts(scene_group, "randomized_names"), h5::read_texts(all, "names"));
  EXPECT_EQ(h5::read_texts(scene_group, "randomized_units"), h5::read_texts(all, "units"));
  EXPECT_EQ(h5::read_texts(all, "units").size(), dims[1]);
  for (const int episode : {16, 31}) {
    const h5::Id demo = h5::open_group(shard, "data/demo_" + std::to_string(episode));
    const auto at = expected.begin() + static_cast<std::ptrdiff_t>(dims[1]) * episode;
    EXPECT_EQ(h5::read_numbers<double>(demo, "randomized"),
              std::vector<double>(at, at + static_cast<std::ptrdiff_t>(dims[1])));
  }
}

TEST(GenerateShards, MistakesAreNamed) {
  const Folder folder;
  const auto message = [&](const Words& more, const Words& environment = {}) {
    const Outcome outcome = run(folder, generate(more), environment);
    EXPECT_EQ(outcome.exit_code, 2);
    return outcome.err;
  };
  for (const char* wrong : {"5/5", "-1/5", "2", "a/5", "1/", "/5", "1/5/5", "1/x", "0/0"})
    EXPECT_THAT(message({"--shard", wrong}), HasSubstr("expected k/S, shard k of S"));
  EXPECT_THAT(message({"--shard", "1/4"}),
              HasSubstr("--shard 1/4 with --shards 5; expected the same"));
  EXPECT_THAT(message({"--resume", "--overwrite"}), HasSubstr("--resume with --overwrite"));
  EXPECT_THAT(message({}, {"OMPI_COMM_WORLD_RANK=3", "OMPI_COMM_WORLD_SIZE=3"}),
              HasSubstr("OMPI_COMM_WORLD_RANK says number 3 of 3; expected 0 to 2"));
  EXPECT_THAT(message({}, {"PMI_RANK=x", "PMI_SIZE=3"}),
              HasSubstr("PMI_RANK=x; expected a whole number"));
  EXPECT_THAT(message({}, {"SLURM_ARRAY_TASK_ID=1"}),
              HasSubstr("SLURM_ARRAY_TASK_COUNT is not set"));
  Words many = generate();
  many.back() = "8";
  const Outcome outcome = run(folder, many);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("8 shards of 100 episodes; expected at most 7"));
  EXPECT_THAT(folder.files(), IsEmpty());
}

TEST(GenerateShards, ADryRunSaysWhatItsSizeIsOf) {
  const Folder folder;
  for (const auto& [words, said] : std::vector<std::pair<Words, std::string>>{
           {{"--record", "q"}, " in all at least;"},
           {{"--tactile", "dense"}, " in all at least;"},
           {{}, " in all before tiles of zeros are left out;"},
           {{"--tactile", "dense", "--compress", "lz4"}, " in all before compression;"},
           {{"--compress", "lz4"},
            " in all before tiles of zeros are left out and the others compressed;"}})
    EXPECT_THAT(run(folder, generate({"--dry-run"}) + words).out, HasSubstr(said));
}

TEST(GenerateShards, ADryRunSaysWhatWouldBeMadeAndMakesNothing) {
  const Folder folder;
  const Outcome outcome = run(folder, generate({"--dry-run", "--json"}));
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(folder.files(), IsEmpty());
  const json answer = answer_of(outcome);
  EXPECT_EQ(answer.at("dry_run"), true);
  EXPECT_EQ(answer.at("episodes"), 100);
  EXPECT_EQ(answer.at("rows_per_episode"), 4);
  EXPECT_EQ(answer.at("shards").size(), 5U);
  EXPECT_EQ(answer.at("bytes"), 100 * answer.at("bytes_per_episode").get<double>());
  EXPECT_GT(answer.at("environment_steps_per_second"), 0);
  EXPECT_GT(answer.at("memory_bytes"), 0);
  EXPECT_THAT(answer.at("effects"), testing::Contains("gravity"));
  ASSERT_EQ(run(folder, generate({"--shard", "2/5"})).exit_code, 0);
  const json rest = answer_of(run(folder, generate({"--dry-run", "--resume", "--json"})));
  EXPECT_EQ(rest.at("kept"), 1);
  EXPECT_EQ(rest.at("shards").size(), 4U);
  const Outcome task =
      run(folder, {"generate", "dummy", "--output", "x", "--episodes", "20", "--dry-run"});
  EXPECT_EQ(task.exit_code, 0) << task.err;
  EXPECT_THAT(task.out, HasSubstr("nothing was written"));
}

}  // namespace
}  // namespace tangere::apps
