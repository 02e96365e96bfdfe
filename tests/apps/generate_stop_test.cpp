// SPDX-License-Identifier: Apache-2.0
// Tests that a data set whose run is killed or stopped at any moment holds whole shards, and
// nothing that only looks like one.
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "io/dataset/shard_check.hpp"
#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::steady_clock;
using testing::ElementsAre;
using ::testing::HasSubstr;
using testing::IsEmpty;

const std::string kFirst = "set/shard-00000.h5";

/// A scene whose episodes take no time, so that a run spends all its time on writing.
class GenerateStop : public testing::Test {
 protected:
  GenerateStop() {
    folder_.write("free.xml",
                  R"(<tangere model="free"><option unit="m-kg" gravity="0 0 -9.8" timestep="5e-3"/>
<robot><link name="a"><joint name="a" type="prismatic" axis="0 0 1"/>
<body name="a" type="sphere" radius="0.1"/></link></robot>
<actuator><motor joint="a" ctrl="force" ctrl_range="-1 1"/></actuator>
<control><random amplitude="1" period="0.02"/></control>
<randomize><joint name="a" q="0" uniform="-1 1"/></randomize></tangere>)");
  }

  /// `generate` for one shard of 4096 episodes and another with the rest of `episodes`.
  static Words words(const std::string& episodes, const Words& more = {}) {
    Words all{"generate", "free.xml", "--output",  "set", "--episodes", episodes,
              "--steps",  "2",        "--threads", "2",   "--no-merge"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }

  /// Waits for a file. After a minute, something is broken.
  void wait_for(const std::string& name) const {
    const auto deadline = steady_clock::now() + std::chrono::minutes(1);
    while (!fs::exists(folder_.path(name))) {
      ASSERT_LT(steady_clock::now(), deadline) << name << " never appeared";
      std::this_thread::sleep_for(milliseconds(1));
    }
  }

  /// Names of the files in the set. Expects every shard to be whole.
  [[nodiscard]] std::vector<std::string> shards_and_parts() const {
    std::vector<std::string> names;
    if (!fs::exists(folder_.path("set"))) return names;
    for (const auto& entry : fs::directory_iterator(folder_.path("set"))) {
      names.push_back(entry.path().filename());
      if (!names.back().ends_with(".h5")) continue;
      EXPECT_NO_THROW(static_cast<void>(check_shard(entry.path())));
    }
    std::sort(names.begin(), names.end());
    return names;
  }

  [[nodiscard]] std::map<std::string, std::string> bytes() const {
    std::map<std::string, std::string> files;
    for (const auto& entry : fs::directory_iterator(folder_.path("set")))
      files[entry.path().filename()] = folder_.read("set/" + entry.path().filename().string());
    return files;
  }

  const Folder folder_;
};

/// How often a run is killed: TANGERE_KILLS, or `otherwise`.
int kills_or(int otherwise) {
  const char* const given = std::getenv("TANGERE_KILLS");
  return given == nullptr ? otherwise : std::stoi(given);
}

constexpr const char* kTwoShards = "4600";
constexpr const char* kManyShards = "1000000";  // far more than any test waits for

TEST_F(GenerateStop, KilledAtAnyMomentItLeavesWholeShardsAndTheNextRunIsAsIfNothingHadHappened) {
  const auto begin = steady_clock::now();
  ASSERT_EQ(run(folder_, words(kTwoShards)).exit_code, 0);
  const auto undisturbed = std::chrono::duration_cast<milliseconds>(steady_clock::now() - begin);
  const std::map<std::string, std::string> expected = bytes();
  ASSERT_EQ(expected.size(), 2U);
  fs::remove_all(folder_.path("set"));

  std::mt19937 random(1);
  std::uniform_int_distribution<milliseconds::rep> moment(0, undisturbed.count());
  int killed = 0, with_part = 0, with_shard = 0;
  for (int round = 0; round < 6; ++round) {
    Program program(folder_, words(kTwoShards, {"--overwrite"}));
    if (round == 0) wait_for(kFirst + ".part");
    if (round == 1) {
      wait_for(kFirst + ".part");  // a shard of this run, not of the one before
      wait_for(kFirst);
    }
    if (round > 1) std::this_thread::sleep_for(milliseconds(moment(random)));
    program.send(SIGKILL);
    killed += program.wait().signal == SIGKILL ? 1 : 0;
    for (const std::string& name : shards_and_parts()) {
      EXPECT_THAT(name, testing::MatchesRegex("shard-0000[01]\\.h5(\\.part)?"));
      if (name.ends_with(".part")) {
        ++with_part;
      } else {
        ++with_shard;
        EXPECT_TRUE(folder_.read("set/" + name) == expected.at(name)) << name;
      }
    }
  }
  EXPECT_GE(killed, 2);
  EXPECT_GE(with_part, 1);
  EXPECT_GE(with_shard, 1);
  ASSERT_EQ(run(folder_, words(kTwoShards, {"--overwrite"})).exit_code, 0);
  EXPECT_TRUE(bytes() == expected);
}

/// TANGERE_KILLS=30 kills at least 30 times; without it, three times.
TEST_F(GenerateStop, KilledAgainAndAgainItResumesToTheSameBytes) {
  const Words all = words(kTwoShards, {"--shards", "6"});
  const auto begin = steady_clock::now();
  ASSERT_EQ(run(folder_, all).exit_code, 0);
  const auto undisturbed = std::chrono::duration_cast<milliseconds>(steady_clock::now() - begin);
  const std::map<std::string, std::string> expected = bytes();
  ASSERT_EQ(expected.size(), 6U);
  Words resume = all;
  resume.emplace_back("--resume");
  std::mt19937 random(2);
  std::uniform_int_distribution<milliseconds::rep> moment(0, undisturbed.count() / 2);
  int killed = 0;
  const int wanted = kills_or(3);
  for (int round = 0; round < 3 || killed < wanted; ++round) {
    ASSERT_LT(round, 3 + wanted);
    fs::remove_all(folder_.path("set"));
    for (int attempt = 0; attempt < 4; ++attempt) {
      Program program(folder_, resume);
      if (attempt == 0) wait_for(kFirst);
      if (attempt > 0) std::this_thread::sleep_for(milliseconds(moment(random)));
      program.send(SIGKILL);
      killed += program.wait().signal == SIGKILL ? 1 : 0;
    }
    const Outcome last = run(folder_, resume);
    ASSERT_EQ(last.exit_code, 0) << last.err;
    EXPECT_TRUE(bytes() == expected) << "round " << round;
  }
  EXPECT_GE(killed, wanted);
  std::printf("killed %d times\n", killed);
}

/// TANGERE_KILLS=30 kills each kind of merge 30 times; without it, four times.
TEST_F(GenerateStop, MergeKilledAtAnyMomentLeavesWholeFilesAndMergesToTheSameBytes) {
  const int kills = kills_or(4);
  ASSERT_EQ(run(folder_, words("300", {"--shards", "2"})).exit_code, 0);
  const std::string merged = "set/robomimic.hdf5", view = "set/minari/tangere/free-v0/data/";
  const std::vector<std::string> outputs = {merged, view + "main_data.hdf5",
                                            view + "metadata.json"};
  const auto clean = [&] {
    fs::remove(folder_.path(merged));
    fs::remove_all(folder_.path("set/minari"));
  };
  for (const Words& merge : {Words{"merge", "set"}, Words{"merge", "set", "--copy"}}) {
    const auto begin = steady_clock::now();
    ASSERT_EQ(run(folder_, merge).exit_code, 0);
    const auto undisturbed = std::chrono::duration_cast<milliseconds>(steady_clock::now() - begin);
    std::map<std::string, std::string> expected;
    for (const std::string& name : outputs) expected[name] = folder_.read(name);
    clean();
    int killed = 0;
    for (int k = 0; k < kills; ++k) {
      Program program(folder_, merge);
      // Spread over a run; the first has surely begun.
      if (k == 0)
        wait_for(merged + ".part");
      else
        std::this_thread::sleep_for(undisturbed * k / kills);
      program.send(SIGKILL);
      killed += program.wait().signal == SIGKILL ? 1 : 0;
      for (const std::string& name : outputs)
        if (fs::exists(folder_.path(name))) {
          EXPECT_TRUE(folder_.read(name) == expected.at(name)) << name << ", kill " << k;
        }
      if (fs::exists(folder_.path(merged))) clean();  // it was faster
    }
    EXPECT_GE(killed, 1);
    const Outcome last = run(folder_, merge);  // without --overwrite: no whole file is there
    ASSERT_EQ(last.exit_code, 0) << last.err;
    for (const std::string& name : outputs)
      EXPECT_TRUE(folder_.read(name) == expected.at(name)) << name;
    EXPECT_FALSE(fs::exists(folder_.path(merged + ".part")));
    clean();
  }
}

TEST_F(GenerateStop, APartOfAKilledRunIsCleanedWithoutAsking) {
  {
    Program program(folder_, words(kManyShards));
    wait_for(kFirst + ".part");
    program.send(SIGKILL);
    EXPECT_EQ(program.wait().signal, SIGKILL);
  }
  EXPECT_THAT(shards_and_parts(), testing::Contains("shard-00000.h5.part"));
  // A .part that the next run does not write itself, as if blocks of the next shard had overtaken.
  folder_.write("set/shard-00003.h5.part", "half");
  const Outcome next = run(folder_, words("40"));
  EXPECT_EQ(next.exit_code, 0) << next.err;
  EXPECT_THAT(shards_and_parts(), ElementsAre("shard-00000.h5"));
}

TEST_F(GenerateStop, TwoRunsIntoOneFolderDoNotMeet) {
  Program first(folder_, words(kManyShards));
  wait_for(kFirst + ".part");
  const Outcome second = run(folder_, words("40", {"--overwrite"}));
  EXPECT_EQ(second.exit_code, 3);
  EXPECT_THAT(second.err, HasSubstr("another process is writing shards there"));
  first.send(SIGTERM);
  EXPECT_EQ(first.wait().exit_code, 75);
}

class GenerateSignal : public GenerateStop,
                       public testing::WithParamInterface<std::pair<int, int>> {};

TEST_P(GenerateSignal, BeforeTheFirstShardLeavesNoFolder) {
  const auto [signal, exit_code] = GetParam();
  Program program(folder_, words(kManyShards, {"--json"}));
  wait_for(kFirst + ".part");
  program.send(signal);
  const Outcome outcome = program.wait();
  EXPECT_EQ(outcome.signal, 0);
  EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr(" of 1000000 episodes; complete shards in 'set': 0"));
  const nlohmann::json answer = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(answer.at("exit_code"), exit_code);
  EXPECT_THAT(answer.at("shards"), IsEmpty());
  EXPECT_THAT(undocumented_keys(answer), IsEmpty());
  EXPECT_THAT(folder_.files(), ElementsAre("free.xml"));
}

TEST_P(GenerateSignal, LaterLeavesWholeShardsOnly) {
  const auto [signal, exit_code] = GetParam();
  Program program(folder_, words(kManyShards, {"--json"}));
  wait_for(kFirst);
  program.send(signal);
  const Outcome outcome = program.wait();
  EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
  const nlohmann::json answer = nlohmann::json::parse(outcome.out);
  const std::vector<std::string> left = shards_and_parts();
  ASSERT_FALSE(left.empty());
  std::vector<std::string> told;
  for (const auto& shard : answer.at("shards"))
    told.push_back(fs::path(shard.get<std::string>()).filename());
  EXPECT_EQ(told, left) << "a .part stayed, or a shard was not named";
  EXPECT_EQ(check_shard(folder_.path(kFirst)).demos, 4096);
}

TEST_P(GenerateSignal, WithOverwriteOlderShardsGoWithTheFirstStepNotBefore) {
  const auto [signal, exit_code] = GetParam();
  ASSERT_EQ(run(folder_, words("40")).exit_code, 0);
  const std::map<std::string, std::string> before = bytes();
  // Uses an error before the first step, because a signal could come too late.
  EXPECT_EQ(run(folder_, words("40", {"--overwrite", "--every", "7"})).exit_code, 2);
  EXPECT_TRUE(bytes() == before);
  Program program(folder_, words(kManyShards, {"--overwrite"}));
  wait_for(kFirst + ".part");
  program.send(signal);
  EXPECT_EQ(program.wait().exit_code, exit_code);
  EXPECT_TRUE(shards_and_parts().empty()) << "shards of two runs beside each other";
}

INSTANTIATE_TEST_SUITE_P(Signals, GenerateSignal,
                         testing::Values(std::pair{SIGINT, 130}, std::pair{SIGTERM, 75}));

}  // namespace
}  // namespace tangere::apps
