// SPDX-License-Identifier: Apache-2.0
// Tests `tangere stress` as users see it: its keys, its table, its refusals. A quick run holds on
// any machine. No test looks at how long anything took.
#include <gmock/gmock.h>

#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/apps/program.hpp"
#include "tests/files.hpp"

namespace tangere::apps {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(Stress, NothingFailsSilently) {
  const Folder folder;
  const json answer = run_json(folder, {"stress", "--quick"});
  EXPECT_EQ(answer.at("stopped"), false);
  EXPECT_EQ(answer.at("quick"), true);
  int holds = 0, flagged = 0;
  for (const json& row : answer.at("rows")) {
    const std::string verdict = row.at("verdict"), name = row.at("case");
    holds += verdict == "holds" ? 1 : 0;
    flagged += verdict == "flagged" ? 1 : 0;
    if (verdict == "holds" && row.at("envs") == 1) {
      EXPECT_LE(row.at("value"), row.at("bound")) << row;
      EXPECT_EQ(row.at("failed"), 0) << row;
    }
    EXPECT_NE(verdict, "fails") << row;
    if (verdict == "flagged") {
      EXPECT_FALSE(row.at("reason").get<std::string>().empty()) << row;
    }
  }
  EXPECT_EQ(answer.at("holds"), holds);
  EXPECT_EQ(answer.at("flagged"), flagged);
  EXPECT_EQ(answer.at("fails"), 0);
  EXPECT_GT(holds, flagged);
}

TEST(Stress, PlaysOneCaseWithOneSetting) {
  const Folder folder;
  const json answer = run_json(
      folder, {"stress", "--case", "slope_below", "--integrator", "SDIRK2", "--timestep", "0.002"});
  ASSERT_EQ(answer.at("rows").size(), 1U);
  const json& row = answer.at("rows").at(0);
  EXPECT_EQ(row.at("case"), "slope_below");
  EXPECT_EQ(row.at("scene"), "hard/slope_below.xml");
  EXPECT_EQ(row.at("scheme"), "SDIRK2");
  EXPECT_EQ(row.at("step"), 0.002);
  EXPECT_EQ(row.at("environment_steps"), 500);
  EXPECT_EQ(row.at("verdict"), "holds");
}

TEST(Stress, ShowsATableToPeople) {
  const Folder folder;
  const Outcome outcome = run(folder, {"stress", "--case", "slope_above", "--integrator", "BDF1"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("criterion"), HasSubstr("passes"), HasSubstr("splits"),
                                 HasSubstr("slope_above "), HasSubstr("  holds\n"),
                                 HasSubstr("Holds: 3. Flagged: 0.")));
}

/// An order-one scheme with a long step is off by more than the bound, and nothing says so.
TEST(Stress, EndsWithCodeOneWhereSomethingFails) {
  const Folder folder;
  const json answer = run_json(
      folder, {"stress", "--case", "sliding_cube", "--integrator", "BDF1", "--timestep", "0.05"},
      1);
  EXPECT_EQ(answer.at("fails"), 1);
}

TEST(Stress, SaysWhatARunWouldWarnOf) {
  const Folder folder;
  const json answer = run_json(
      folder, {"stress", "--case", "rebound", "--integrator", "BDF1", "--timestep", "0.005"});
  const json& row = answer.at("rows").at(0);
  EXPECT_EQ(row.at("verdict"), "flagged");
  EXPECT_THAT(row.at("reason").get<std::string>(),
              HasSubstr("warning: the contact of 'ball' with 'ground' has no damping"));
}

TEST(Stress, StopsAndKeepsWhatThereIs) {
  const Folder folder;
  Program program(folder, {"stress", "--threads", "1", "--json"}, {}, {"", "rows"});
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(5);
  while (!std::filesystem::exists(folder.path("rows")) ||
         file_bytes(folder.path("rows")).find("BDF1 ") == std::string::npos) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline) << "no row appeared";
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  program.send(SIGINT);
  const Outcome outcome = program.wait();
  EXPECT_EQ(outcome.exit_code, 130);
  const json answer = json::parse(outcome.out);
  EXPECT_EQ(answer.at("stopped"), true);
  EXPECT_FALSE(answer.at("rows").empty());
}

class StressRefuses : public ::testing::TestWithParam<std::pair<Words, const char*>> {};

TEST_P(StressRefuses, WithAMessage) {
  const Folder folder;
  const Outcome outcome = run(folder, Words{"stress"} + GetParam().first);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr(GetParam().second));
}

INSTANTIATE_TEST_SUITE_P(
    Values, StressRefuses,
    ::testing::Values(std::pair{Words{"--case", "stack_equl"}, "did you mean 'stack_equal'?"},
                      std::pair{Words{"--integrator", "BDF3"}, "did you mean 'BDF"},
                      std::pair{Words{"--timestep", "-1"}, "--timestep"},
                      std::pair{Words{"--case", "toss", "--timestep", "1e-9"},
                                "expected a longer timestep"},
                      std::pair{Words{"scenes/box_pushing.xml"}, "box_pushing.xml"}));

}  // namespace
}  // namespace tangere::apps
