// SPDX-License-Identifier: Apache-2.0
// Tests that a run stopped in the middle ends soon, says so, and leaves no file, neither whole nor
// partial.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/apps/program.hpp"

namespace tangere::apps {
namespace {

using testing::ElementsAre;
using ::testing::HasSubstr;
using testing::IsEmpty;

// Enough work that a signal always arrives in the middle of the run.
constexpr const char* kManySteps = "500000";

/// Waits for the file that a run writes to. After a minute, something is broken.
void wait_for(const std::string& path) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!std::filesystem::exists(path)) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline) << path << " never appeared";
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
}

std::vector<std::string> long_run(const std::vector<std::string>& more = {}) {
  std::vector<std::string> words{
      "simulate", scene("rolling_ball_small.xml"), "-o", "out.h5", "--steps", kManySteps};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

class Stop : public testing::TestWithParam<std::pair<int, int>> {};

TEST_P(Stop, LeavesNoFileAndSaysSo) {
  const auto [signal, exit_code] = GetParam();
  const Folder folder;
  Program program(folder, long_run({"--json"}));
  wait_for(folder.path("out.h5.part"));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));  // into the steps
  program.send(signal);
  const Outcome outcome = program.wait();
  EXPECT_EQ(outcome.signal, 0);
  EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("nothing was written"));
  EXPECT_EQ(nlohmann::json::parse(outcome.out).at("exit_code"), exit_code);
  EXPECT_THAT(folder.files(), IsEmpty());
}

TEST_P(Stop, KeepsTheFileThatWasToBeReplaced) {
  const auto [signal, exit_code] = GetParam();
  const Folder folder;
  folder.write("out.h5", "older");
  Program program(folder, long_run({"--overwrite"}));
  wait_for(folder.path("out.h5.part"));
  program.send(signal);
  EXPECT_EQ(program.wait().exit_code, exit_code);
  EXPECT_THAT(folder.files(), ElementsAre("out.h5"));
  EXPECT_EQ(folder.read("out.h5"), "older");
}

/// A short command is stopped now and then between any two of its instructions.
TEST_P(Stop, LeavesNoPartOfAShortCommand) {
  const auto [signal, exit_code] = GetParam();
  const Folder folder;
  ASSERT_EQ(run(folder, {"generate", scene("rolling_ball_small.xml"), "-o", "set", "--episodes",
                         "64", "--steps", "40", "--every", "1", "--no-merge", "--quiet"})
                .exit_code,
            0);
  for (const Words& words : {Words{"export", "set", "--csv", "out"},
                             Words{"view", "set", "-o", "out", "--episodes", "64"}}) {
    int stopped = 0;
    for (int attempt = 0; attempt < 60 && stopped < 2; ++attempt) {
      Program program(folder, words + Words{"--overwrite", "--json"});
      const auto start = std::chrono::steady_clock::now();
      while (!std::filesystem::exists(folder.path("out.part")) &&
             std::chrono::steady_clock::now() - start < std::chrono::seconds(2))
        std::this_thread::yield();
      program.send(signal);
      const Outcome outcome = program.wait();
      EXPECT_EQ(outcome.signal, 0);
      EXPECT_FALSE(std::filesystem::exists(folder.path("out.part")));
      if (outcome.exit_code == 0) continue;
      ++stopped;
      EXPECT_EQ(outcome.exit_code, exit_code) << outcome.err;
      EXPECT_THAT(outcome.err, HasSubstr("no half-written file is left"));
      EXPECT_EQ(nlohmann::json::parse(outcome.out).at("exit_code"), exit_code);
    }
    EXPECT_GT(stopped, 0) << words.front();
  }
}

INSTANTIATE_TEST_SUITE_P(Signals, Stop,
                         testing::Values(std::pair{SIGINT, 130}, std::pair{SIGTERM, 75}));

TEST(Progress, RewritesOneLineOfATerminal) {
  const int terminal = posix_openpt(O_RDWR | O_NOCTTY);
  ASSERT_GE(terminal, 0);
  ASSERT_EQ(grantpt(terminal), 0);
  ASSERT_EQ(unlockpt(terminal), 0);
  const Folder folder;
  Program program(folder, long_run(), {}, {"", ptsname(terminal)});
  // Waits for three rewrites, then stops. Reading a terminal whose program has ended is an error.
  std::string shown;
  char buffer[256];
  bool stopped = false;
  for (ssize_t n = 0; (n = read(terminal, buffer, sizeof buffer)) > 0;) {
    shown.append(buffer, static_cast<std::size_t>(n));
    if (!stopped && std::count(shown.begin(), shown.end(), '\r') >= 3) {
      program.send(SIGINT);
      stopped = true;
    }
  }
  EXPECT_EQ(program.wait().exit_code, 130);
  close(terminal);
  EXPECT_THAT(shown, HasSubstr(std::string("\rstep ")));
  EXPECT_THAT(shown, HasSubstr(std::string(" of ") + kManySteps + ", "));
  EXPECT_THAT(shown, HasSubstr("env-steps/s"));
  // The line is erased before the last message.
  EXPECT_THAT(shown, HasSubstr("\r\x1b[Ktangere: stopped by SIGINT"));
  EXPECT_EQ(shown.find('\n'), shown.rfind('\n')) << "progress made more than one line";
}

TEST(Kill, LeavesAPartThatTheNextRunTakesOver) {
  const Folder folder;
  {
    Program program(folder, long_run());
    wait_for(folder.path("out.h5.part"));
    program.send(SIGKILL);
    EXPECT_EQ(program.wait().signal, SIGKILL);
  }
  EXPECT_THAT(folder.files(), ElementsAre("out.h5.part"));
  const Outcome next =
      run(folder, {"simulate", scene("rolling_ball_small.xml"), "-o", "out.h5", "--steps", "10"});
  EXPECT_EQ(next.exit_code, 0) << next.err;
  EXPECT_THAT(folder.files(), ElementsAre("out.h5"));
}

TEST(TwoRuns, OfOneOutputDoNotMeet) {
  const Folder folder;
  Program first(folder, long_run());
  wait_for(folder.path("out.h5.part"));
  const Outcome second = run(folder, long_run());
  EXPECT_EQ(second.exit_code, 3);
  EXPECT_THAT(second.err, HasSubstr("out.h5"));
  EXPECT_THAT(folder.files(), ElementsAre("out.h5.part"));
  first.send(SIGTERM);
  EXPECT_EQ(first.wait().exit_code, 75);
  EXPECT_THAT(folder.files(), IsEmpty());
}

TEST(FileSizeLimit, FailsTheWriteOfEveryCommand) {
  const Folder folder;
  std::filesystem::copy_file(scene("rolling_ball_small.xml"), folder.path("s.xml"));
  ASSERT_EQ(run(folder, {"generate", "s.xml", "-o", "set", "--episodes", "8", "--steps", "20",
                         "--every", "5", "--no-merge", "--quiet"})
                .exit_code,
            0);
  ASSERT_EQ(run(folder, {"simulate", "s.xml", "-o", "run.h5", "--steps", "10"}).exit_code, 0);
  const std::vector<std::string> before = folder.files();
  const Words fit{"identify", scene("identify_ball.xml"), "--number", "tactile pad kn", "--steps",
                  "10"};
  for (const Words& words :
       {Words{"simulate", "s.xml", "-o", "out", "--steps", "10"}, Words{"view", "set", "-o", "out"},
        Words{"export", "set", "--csv", "out"}, Words{"plot", "run.h5", "-o", "out"},
        Words{"plot", "s.xml", "-o", "out"}, fit + Words{"--svg", "out"}, Words{"merge", "set"}}) {
    const Outcome outcome =
        run(folder, words + Words{"--quiet"}, {}, {}, Limit{RLIMIT_FSIZE, 2000});
    EXPECT_EQ(outcome.exit_code, 3) << words.front() << outcome.err;
    EXPECT_THAT(outcome.err, HasSubstr("File too large")) << words.front();
    if (words.front() != "merge") {
      EXPECT_EQ(folder.files(), before) << words.front();
    }
  }
}

/// Libraries do not load, memory runs out in various places, or the run ends well. HDF5 uses some
/// memory without checking that it got it.
TEST(AddressSpaceLimit, EndsWithACodeAndAMessage) {
  const Folder folder;
  const Words words{"generate",   scene("rolling_ball_small.xml"),
                    "-o",         "set",
                    "--episodes", "32",
                    "--steps",    "20",
                    "--every",    "5",
                    "--quiet",    "--overwrite"};
  for (rlim_t kilobytes = 44'000; kilobytes <= 76'000; kilobytes += 1000) {
    const Outcome outcome = run(folder, words, {}, {}, Limit{RLIMIT_AS, kilobytes * 1024});
    EXPECT_EQ(outcome.signal, 0) << kilobytes << " kB";
    EXPECT_TRUE(outcome.exit_code == 0 || !outcome.err.empty()) << kilobytes << " kB";
  }
}

}  // namespace
}  // namespace tangere::apps
