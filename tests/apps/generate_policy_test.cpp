// SPDX-License-Identifier: Apache-2.0
// Tests what a data set tells a learner: who played which episode, masks, names of environments,
// and policies that are varied.
#include <gmock/gmock.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "io/hdf5/h5.hpp"
#include "io/hdf5/h5_listing.hpp"
#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Words pushes(const std::string& set, const Words& more) {
  return Words{"generate", "box_pushing", "-o", set, "--episodes", "40", "--seed", "5"} + more;
}

std::vector<float> actions_of(const h5::Id& file, int demo) {
  const h5::Id dataset = h5::open_dataset(file, "data/demo_" + std::to_string(demo) + "/actions");
  const h5::Dims dims = h5::dimensions(dataset);
  std::vector<float> actions(dims[0] * dims[1]);
  h5::read_box(dataset, {0, 0}, dims, actions.data());
  return actions;
}

std::int64_t said_of(const h5::Id& file, int demo, const char* name) {
  return h5::read_numbers<std::int64_t>(h5::open_group(file, "data/demo_" + std::to_string(demo)),
                                        name)
      .at(0);
}

/// Numbers of the demos in a mask.
std::vector<int> mask(const h5::Id& file, const std::string& name) {
  const h5::Id dataset = h5::open_dataset(file, "mask/" + name), type(H5Dget_type(dataset.get()));
  const std::size_t size = H5Tget_size(type.get()), count = h5::dimensions(dataset).at(0);
  std::string bytes(size * count, '\0');
  if (count > 0) {
    EXPECT_GE(H5Dread(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, bytes.data()), 0);
  }
  std::vector<int> demos;
  for (std::size_t at = 0; at < bytes.size(); at += size)
    demos.push_back(std::stoi(bytes.substr(at + 5, size - 5)));
  return demos;
}

TEST(GeneratePolicy, VariedEpisodesAreTheSameOnAnyNumberOfThreadsAndInAnyShard) {
  const Folder folder;
  const Words varied{"--noise", "0.3", "--mix", "random=0.3", "--quiet"};
  ASSERT_EQ(run(folder, pushes("one", varied + Words{"--threads", "1"})).exit_code, 0);
  ASSERT_EQ(run(folder, pushes("three", varied + Words{"--threads", "3"})).exit_code, 0);
  EXPECT_TRUE(folder.read("one/shard-00000.h5") == folder.read("three/shard-00000.h5"));
  ASSERT_EQ(run(folder, pushes("cut", varied + Words{"--shards", "3"})).exit_code, 0);
  const h5::Id whole = h5::open_file(folder.path("one/shard-00000.h5")),
               last = h5::open_file(folder.path("cut/shard-00002.h5"));
  EXPECT_EQ(actions_of(last, 39), actions_of(whole, 39));
  EXPECT_EQ(said_of(last, 39, "policy"), said_of(whole, 39, "policy"));
}

TEST(GeneratePolicy, ADataSetSaysWhichPolicyPlayedWhichEpisode) {
  const Folder folder;
  for (const Words& words :
       {pushes("mixed", {"--mix", "random=0.4"}), pushes("random", {"--policy", "random"}),
        pushes("scripted", {}), pushes("noise", {"--noise", "0.2"})})
    run_json(folder, words);
  const h5::Id mixed = h5::open_file(folder.path("mixed/shard-00000.h5")),
               random = h5::open_file(folder.path("random/shard-00000.h5")),
               scripted = h5::open_file(folder.path("scripted/shard-00000.h5")),
               noise = h5::open_file(folder.path("noise/shard-00000.h5"));
  const h5::Id scene = h5::open_group(mixed, "scene");
  EXPECT_EQ(h5::read_text(scene, "policy"), "scripted");
  EXPECT_THAT(h5::read_texts(scene, "policies"), ElementsAre("scripted", "random"));
  EXPECT_EQ(h5::read_numbers<double>(scene, "policy_random_share").at(0), 0.4);
  EXPECT_EQ(h5::read_numbers<double>(h5::open_group(noise, "scene"), "policy_noise").at(0), 0.2);
  std::vector<int> by_chance, by_script;
  for (int e = 0; e < 40; ++e) {
    const bool chance = said_of(mixed, e, "policy") == 1;
    (chance ? by_chance : by_script).push_back(e);
    EXPECT_EQ(actions_of(mixed, e), actions_of(chance ? random : scripted, e)) << e;
    EXPECT_EQ(said_of(scripted, e, "policy"), 0);
    EXPECT_EQ(said_of(random, e, "policy"), 0);
    const std::vector<float> noisy = actions_of(noise, e);
    EXPECT_NE(noisy, actions_of(scripted, e)) << e;
    EXPECT_LE(*std::max_element(noisy.begin(), noisy.end()), 1);
    EXPECT_GE(*std::min_element(noisy.begin(), noisy.end()), -1);
  }
  EXPECT_GE(by_chance.size(), 6U) << "of 40, where 16 are expected";
  EXPECT_LE(by_chance.size(), 26U);
  const h5::Id merged = h5::open_file(folder.path("mixed/robomimic.hdf5"));
  EXPECT_EQ(mask(merged, "random"), by_chance);
  EXPECT_EQ(mask(merged, "scripted"), by_script);
  const h5::Id plain = h5::open_file(folder.path("scripted/robomimic.hdf5"));
  EXPECT_FALSE(h5::has_link(h5::open_group(plain, "mask"), "scripted")) << "all demos are its own";
}

TEST(GeneratePolicy, MasksNameTheDemosThatSolvedTheTask) {
  const Folder folder;
  run_json(folder, pushes("set", {}));
  for (const Words& how : {Words{}, Words{"--copy"}}) {
    const json merged = run_json(folder, Words{"merge", "set", "--overwrite"} + how);
    const h5::Id file = h5::open_file(folder.path("set/robomimic.hdf5"));
    std::vector<int> solved, of_train, of_valid;
    const std::vector<int> train = mask(file, "train");
    for (int e = 0; e < 40; ++e)
      if (said_of(file, e, "success") == 1) {
        solved.push_back(e);
        (std::binary_search(train.begin(), train.end(), e) ? of_train : of_valid).push_back(e);
      }
    EXPECT_EQ(merged.at("successes"), solved.size());
    EXPECT_GT(solved.size(), 10U);
    EXPECT_LT(solved.size(), 40U);
    EXPECT_EQ(mask(file, "success"), solved);
    EXPECT_EQ(mask(file, "train_success"), of_train);
    EXPECT_EQ(mask(file, "valid_success"), of_valid);
  }
  ASSERT_EQ(run(folder, {"generate", scene("rolling_ball_small.xml"), "-o", "balls", "--episodes",
                         "4", "--steps", "10", "--quiet"})
                .exit_code,
            0);
  const h5::Id balls = h5::open_file(folder.path("balls/robomimic.hdf5"));
  EXPECT_THAT(h5::link_names(h5::open_group(balls, "mask")),
              ElementsAre("touching", "train", "train_touching", "valid", "valid_touching"))
      << "a scene alone has no success";
}

TEST(GeneratePolicy, LearnersFindTheEnvironmentAndItsScales) {
  const Folder folder;
  const json answer = run_json(folder, pushes("set", {"--name", "expert"}));
  EXPECT_EQ(answer.at("minari_id"), "tangere/box_pushing/expert-v0");
  const h5::Id file = h5::open_file(folder.path("set/robomimic.hdf5"));
  const h5::Id scene = h5::open_group(file, "scene");
  EXPECT_EQ(h5::read_text(scene, "dataset_id"), "tangere/box_pushing/expert-v0");
  const json arguments = json::parse(h5::read_text(h5::open_group(file, "data"), "env_args"));
  EXPECT_EQ(arguments.at("env_name"), "tangere/BoxPushing-v0");
  EXPECT_EQ(arguments.at("env_kwargs"), json({{"task", "box_pushing"}}));
  EXPECT_EQ(arguments.at("env_version"), h5::read_text(scene, "tangere_version"));
  const json scales = json::parse(h5::read_text(scene, "observation_scale"));
  EXPECT_EQ(scales.at("tactile").size(), 3U) << "one for each component";
  EXPECT_FALSE(scales.contains("q"));
  EXPECT_EQ(json::parse(h5::read_text(scene, "privileged")), json({"q", "v"}));
  const json metadata =
      json::parse(folder.read("set/minari/tangere/box_pushing/expert-v0/data/metadata.json"));
  EXPECT_EQ(metadata.at("algorithm_name"), "scripted");
  EXPECT_EQ(metadata.at("requirements").at(0),
            "tangere>=" + h5::read_text(scene, "tangere_version"));
  EXPECT_EQ(json::parse(metadata.at("env_spec").get<std::string>()).at("id"),
            "tangere/BoxPushing-v0");
  EXPECT_EQ(metadata.at("eval_env_spec"), metadata.at("env_spec"));
  const double bytes = static_cast<double>(
      fs::file_size(folder.path("set/shard-00000.h5")) +
      fs::file_size(folder.path("set/minari/tangere/box_pushing/expert-v0/data/main_data.hdf5")));
  EXPECT_NEAR(metadata.at("dataset_size").get<double>(), bytes / 1e6, 0.0501);
  // The view shows what the environment shows; the state is beside it, also with a last row.
  EXPECT_THAT(metadata.at("observation_space").get<std::string>(),
              ::testing::Not(HasSubstr("\"q\"")));
  const h5::Id view =
      h5::open_file(folder.path("set/minari/tangere/box_pushing/expert-v0/data/main_data.hdf5"));
  EXPECT_THAT(h5::link_names(h5::open_group(view, "episode_3/observations")),
              ElementsAre("goal", "tactile"));
  EXPECT_THAT(h5::link_names(h5::open_group(view, "episode_3/infos")), ElementsAre("q", "v"));
  EXPECT_EQ(h5::dimensions(h5::open_dataset(view, "episode_3/infos/q")).at(0), 101U);
}

TEST(GeneratePolicy, AnotherVariationIsAnotherDataSet) {
  const Folder folder;
  run_json(folder, pushes("set", {"--noise", "0.2", "--shards", "2"}));
  fs::remove(folder.path("set/shard-00001.h5"));
  struct Case {
    Words words;
    const char* says;
  };
  for (const Case& c :
       {Case{{"--noise", "0.25"}, "policy_noise: 0.2 there, 0.25 here"},
        Case{{"--noise", "0.2", "--mix", "random=0.1"}, "policy_random_share: 0 there, 0.1 here"},
        Case{{"--noise", "0.2", "--name", "x"}, "dataset_id: "}}) {
    const Outcome outcome =
        run(folder, pushes("set", c.words + Words{"--shards", "2", "--resume"}));
    EXPECT_NE(outcome.exit_code, 0);
    EXPECT_THAT(outcome.err, HasSubstr(c.says));
  }
  const h5::Id file = h5::open_file(folder.path("set/shard-00000.h5"));
  EXPECT_EQ(h5::read_text(file, "command"),
            "tangere generate box_pushing --episodes 40 --seed 5 --precision mixed --policy "
            "scripted --noise 0.2 --shards 2");
}

TEST(GeneratePolicy, AProgramThatDoesNotAnswerLeavesNothing) {
  const Folder folder;
  const std::string hello = R"(printf '{"protocol":"tangere policy 1","name":"mute"}\n'; )";
  // It listens until its input ends. A program that sleeps is given 5 s to end.
  const std::string idle = "cat >/dev/null";
  struct Case {
    std::string program;
    int exit_code;
    const char* says;
  };
  for (const Case& c : {
           Case{"exit 3", 3, "has ended with exit code 3"},
           Case{"no_such_program_at_all", 3, "has ended with exit code 127"},
           Case{"kill -9 $$", 3, "has ended by a signal (Killed)"},
           Case{"echo good morning", 2, "answers 'good morning'; expected a line"},
           Case{"printf '{\"protocol\":\"tangere policy 2\"}\\n'; " + idle, 2, "policy 1"},
           Case{"sleep 1000", 3, "has not answered within 0.3 s (--program-timeout)"},
           Case{hello + idle, 3, "has not answered within 0.3 s"},
           Case{hello + "exit 5", 3, "has ended with exit code 5"},
           Case{hello + "head -c 64 /dev/zero; " + idle, 2,
                "answers 0 numbers to a question about "
                "16 environments; expected 48, 3"},
       }) {
    // What comes too late always does; everything else has all the time of a busy machine.
    const bool late = std::string(c.says).find("0.3 s") != std::string::npos;
    const Outcome outcome = run(folder, pushes("set", {"--program", c.program, "--program-timeout",
                                                       late ? "0.3" : "300", "--quiet"}));
    EXPECT_EQ(outcome.exit_code, c.exit_code) << c.program << "\n" << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(c.says)) << c.program;
    EXPECT_THAT(folder.files(), ::testing::IsEmpty()) << c.program;
  }
}

/// Waits for a file with a whole line in it and returns the line. After a minute, something is
/// broken.
std::string line_of(const Folder& folder, const std::string& name) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  std::string text;
  while (!text.ends_with('\n') && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    if (fs::exists(folder.path(name))) text = folder.read(name);
  }
  EXPECT_TRUE(text.ends_with('\n')) << name << " never appeared";
  return text;
}

TEST(GeneratePolicy, AProgramThatStartsEndsWithTheRun) {
  for (const Words& more : {Words{}, Words{"--dry-run"}}) {
    const Folder folder;
    Program command(folder,
                    pushes("set", Words{"--program", "echo $$ >started; sleep 1000"} + more));
    const pid_t program = std::stoi("0" + line_of(folder, "started"));
    command.send(SIGINT);
    const Outcome outcome = command.wait();
    EXPECT_EQ(outcome.exit_code, 130) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("stopped by SIGINT before the first episode"));
    EXPECT_THAT(folder.files(), ElementsAre("started"));
    ASSERT_GT(program, 1);
    EXPECT_EQ(kill(program, 0), -1) << "it goes on";
    EXPECT_EQ(errno, ESRCH);
  }
}

TEST(GeneratePolicy, ManyThreadsWaitOnceForAProgramThatIsMute) {
  const Folder folder;
  const std::string mute =
      R"(printf '{"protocol":"tangere policy 1","name":"mute"}\n'; cat >heard)";
  const Outcome outcome =
      run(folder, {"generate", "box_pushing", "-o", "set", "--episodes", "400", "--threads", "6",
                   "--program", mute, "--program-timeout", "2", "--quiet"});
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("has not answered within 2 s (--program-timeout)"));
  // It heard who asks, and one question about 16 environments.
  const std::string heard = folder.read("heard");
  const std::size_t first = heard.find('\n') + 1;
  const json said = json::parse(heard.substr(0, first));
  std::size_t width = 0;
  for (const json& observation : said.at("observations")) {
    std::size_t size = 1;
    for (const json& n : observation.at("shape")) size *= n.get<std::size_t>();
    width += size;
  }
  EXPECT_EQ(heard.size() - first, 8 + 16 * (8 + 8 + 4 * width));
}

/// The child keeps the socket and the streams of the command, on whose end the test waits.
TEST(GeneratePolicy, ChildrenOfAProgramThatHasEndedAreNotWaitedFor) {
  const Folder folder;
  const auto start = std::chrono::steady_clock::now();
  for (const std::string& program :
       {std::string(TANGERE_POLICY_PROGRAM " leaves_child 2"),
        std::string("sh -c '" TANGERE_POLICY_PROGRAM " leaves_child 2'")}) {
    const Outcome outcome =
        run(folder, pushes("set", {"--program", program, "--program-timeout", "300", "--quiet"}));
    EXPECT_EQ(outcome.exit_code, 3);
    EXPECT_THAT(outcome.err, HasSubstr("has ended with exit code 7"));
    EXPECT_THAT(folder.files(), ::testing::IsEmpty());
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(300));
}

TEST(GeneratePolicy, AProgramMayStopTheRun) {
  const Folder folder;
  const Outcome outcome = run(
      folder, pushes("set", {"--program", TANGERE_POLICY_PROGRAM " stops_parent 3", "--quiet"}));
  EXPECT_EQ(outcome.exit_code, 75) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("stopped by SIGTERM"));
}

/// Goes wrong at the question whose number is given; shards that were complete then stay.
TEST(GeneratePolicy, AProgramThatGoesWrongLeavesWholeShards) {
  const Folder folder;
  // The same words each time: files name the command.
  const std::string program = "exec " TANGERE_POLICY_PROGRAM " $(cat wrong)";
  folder.write("wrong", "");
  const Words words{"generate",  "box_pushing", "-o",      "set",      "--episodes",
                    "80",        "--seed",      "5",       "--shards", "5",
                    "--threads", "1",           "--quiet", "--program"};
  ASSERT_EQ(run(folder, words + Words{program}).exit_code, 0);
  std::map<std::string, std::string> whole;
  for (const char* const number : {"0", "1", "2", "3", "4"}) {
    const std::string name = std::string("shard-0000") + number + ".h5";
    whole[name] = folder.read("set/" + name);
  }
  struct Case {
    const char* what;
    int exit_code;
    const char* says;
  };
  for (const Case& c :
       {Case{"dies", 3, "has ended with exit code 7"}, Case{"crashes", 3, "has ended by a signal"},
        Case{"hangs", 3, "has not answered within 1 s"},
        Case{"closes", 3, "has closed its standard output"},
        Case{"half", 3, "has ended with exit code 0"},
        Case{"nan", 2, "answers nan as number 2 of action"},
        Case{"garbage", 2, "nan as number 0 of action"}, Case{"negative", 2, "answers -1 numbers"},
        Case{"endless", 2, "answers 9223372036854775807 numbers"},
        Case{"floods", 2, "answers 0 numbers"}})
    for (const char* const when : {"0", "450"}) {
      SCOPED_TRACE(std::string(c.what) + " at question " + when);
      const bool late = std::string(c.what) == "hangs", deaf = std::string(c.what) == "closes";
      if ((late || deaf) && std::string(when) == "0") continue;  // the end takes such a program 5 s
      fs::remove_all(folder.path("set"));
      folder.write("wrong", std::string(c.what) + " " + when);
      const Outcome outcome =
          run(folder, words + Words{program, "--program-timeout", late ? "1" : "300"});
      EXPECT_EQ(outcome.signal, 0);
      EXPECT_EQ(outcome.exit_code, c.exit_code) << outcome.err;
      EXPECT_THAT(outcome.err, HasSubstr(c.says));
      if (std::string(when) == "0") {
        EXPECT_FALSE(fs::exists(folder.path("set")));
        continue;
      }
      // A block of 16 episodes takes 100 questions and is a shard here. The fourth block begins
      // when the first one is written.
      EXPECT_TRUE(fs::exists(folder.path("set/shard-00000.h5")));
      for (const auto& entry : fs::directory_iterator(folder.path("set"))) {
        const std::string name = entry.path().filename();
        EXPECT_TRUE(folder.read("set/" + name) == whole[name]) << name;
      }
    }
}

/// An answer that trickles in is late as well.
TEST(GeneratePolicy, AProgramThatAnswersBitByBitIsLate) {
  const Folder folder;
  const Outcome outcome =
      run(folder, pushes("set", {"--program", "while printf x; do sleep 0.02; done",
                                 "--program-timeout", "0.5", "--quiet"}));
  EXPECT_EQ(outcome.exit_code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("has not answered within 0.5 s (--program-timeout)"));
  EXPECT_THAT(folder.files(), ::testing::IsEmpty());
}

TEST(GeneratePolicy, AProgramGoesWithTasksAndItsOwnOptions) {
  const Folder folder;
  const auto complaint = [&](const std::string& what, const Words& more) {
    const Outcome outcome =
        run(folder, Words{"generate", what, "-o", "set", "--episodes", "4"} + more);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    return outcome.err;
  };
  EXPECT_THAT(complaint("box_pushing", {"--policy", "program"}),
              HasSubstr("--policy program without --program; expected both"));
  EXPECT_THAT(complaint("box_pushing", {"--program", "true", "--policy", "hold"}),
              HasSubstr("--policy hold with --program; expected program"));
  EXPECT_THAT(complaint("box_pushing", {"--program", "true", "--gradients", "return"}),
              HasSubstr("--gradients return with --program"));
  EXPECT_THAT(complaint("box_pushing", {"--program-timeout", "3"}),
              HasSubstr("--program-timeout without --program"));
  EXPECT_THAT(complaint("box_pushing", {"--program", "true", "--controls", "u.csv"}),
              HasSubstr("--controls with --program"));
  EXPECT_THAT(complaint(scene("rolling_ball_small.xml"), {"--program", "true"}),
              HasSubstr("--program with the scene"));
}

TEST(GeneratePolicy, AnUnknownPlayerIsAProblem) {
  const Folder folder;
  run_json(folder, pushes("set", {"--mix", "random=0.4"}));
  {
    const hid_t file =
        H5Fopen(folder.path("set/shard-00000.h5").c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t demo = H5Gopen2(file, "data/demo_3", H5P_DEFAULT), one = H5Screate(H5S_SCALAR);
    EXPECT_GE(H5Adelete(demo, "policy"), 0);
    const hid_t said = H5Acreate2(demo, "policy", H5T_STD_I64LE, one, H5P_DEFAULT, H5P_DEFAULT);
    const std::int64_t other = 2;
    EXPECT_GE(H5Awrite(said, H5T_NATIVE_INT64, &other), 0);
    H5Aclose(said);
    H5Sclose(one);
    H5Gclose(demo);
    H5Fclose(file);
  }
  EXPECT_THAT(run_json(folder, {"validate", "set"}, 3).at("problems").get<Words>(),
              ::testing::Contains(HasSubstr("demo_3: its policy is 2; expected 0 to 1")));
  EXPECT_THAT(run_json(folder, {"merge", "set", "--overwrite"}, 3).at("error").get<std::string>(),
              HasSubstr("shard-00000.h5' is damaged: demo_3: its policy is 2; expected 0 to 1"));
}

TEST(GeneratePolicy, WhatCannotBeVariedIsAnError) {
  const Folder folder;
  const std::string small = scene("rolling_ball_small.xml");
  struct Case {
    Words words;
    const char* says;
  };
  const Case cases[] = {
      {pushes("s", {"--policy", "random", "--noise", "0.1"}),
       "--noise with --policy random; expected scripted or program"},
      {pushes("s", {"--policy", "hold", "--mix", "random=0.1"}),
       "--mix with --policy hold; expected scripted or program"},
      {pushes("s", {"--noise", "-0.1"}), "expected a positive number"},
      {pushes("s", {"--noise", "nan"}), "expected a positive number"},
      {pushes("s", {"--mix", "random"}), "--mix random: expected random=SHARE"},
      {pushes("s", {"--mix", "random=1"}), "with a share between 0 and 1"},
      {pushes("s", {"--mix", "random=0.3x"}), "--mix random=0.3x: expected random=SHARE"},
      {pushes("s", {"--mix", "hold=0.3"}), "--mix hold=0.3: expected random=SHARE"},
      {pushes("s", {"--name", "a b"}), "--name a b: expected at most 100 letters, digits"},
      {pushes("s", {"--name", "../x", "--dry-run"}), "--name ../x: expected"},
      {{"generate", small, "-o", "s", "--episodes", "1", "--steps", "5", "--noise", "1"},
       "--noise with the scene"},
      {{"generate", small, "-o", "s", "--episodes", "1", "--steps", "5", "--mix", "random=0.5"},
       "--mix with the scene"},
  };
  for (const Case& c : cases) {
    const Outcome outcome = run(folder, c.words);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr(c.says));
  }
  EXPECT_THAT(folder.files(), ::testing::IsEmpty());
}

}  // namespace
}  // namespace tangere::apps
