// SPDX-License-Identifier: Apache-2.0
// Tests `tangere accuracy` as users see it: its keys, its files, its refusals. No test looks at how
// long anything took.
#include <gmock/gmock.h>
#include <tinyxml2.h>

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
using ::testing::IsEmpty;

const std::string kSmall = scene("rolling_ball_small.xml");

TEST(Accuracy, NamesTheCheapestSettingAndDrawsTheOthers) {
  const Folder folder;
  const json answer =
      run_json(folder, {"accuracy", kSmall, "--steps", "100", "--envs", "3", "--target", "0.03",
                        "--svg", "cost.svg", "--csv", "cost.csv"});
  EXPECT_EQ(answer.at("quantity"), "tactile");
  EXPECT_EQ(answer.at("envs"), 3);
  EXPECT_EQ(answer.at("seconds"), 0.5);
  EXPECT_LT(answer.at("reference").at("error"), 1e-3);
  EXPECT_THAT(answer.at("reference").at("method").get<std::string>(), HasSubstr("SDIRK4"));
  const json& advice = answer.at("advice");
  EXPECT_EQ(advice.at("resolved"), true);
  EXPECT_LE(advice.at("error_bound"), 0.03);
  EXPECT_THAT(advice.at("text").get<std::string>(),
              AllOf(HasSubstr("For 3 % use "), HasSubstr("own setting (BDF2, 5 ms")));
  for (const json& point : answer.at("points")) {
    EXPECT_GT(point.at("simulated_seconds_per_cpu_second"), 0);
    EXPECT_EQ(point.at("status"), "ok");
    EXPECT_EQ(point.at("within_share").is_null(), point.at("accuracy") == 0);
    if (point.at("error_bound") <= 0.03) {
      EXPECT_LE(point.at("simulated_seconds_per_cpu_second"),
                advice.at("simulated_seconds_per_cpu_second"));
    }
  }
  const json& pitches = answer.at("pitches").at(0);
  EXPECT_EQ(pitches.at("sensor"), "pad");
  EXPECT_EQ(pitches.at("points").size(), 5);
  EXPECT_EQ(pitches.at("points").at(3).at("own"), true);
  EXPECT_EQ(pitches.at("reference").at("rows"), 128);
  EXPECT_THAT(advice.at("text").get<std::string>(),
              HasSubstr("keeps the force on 'pad' within 3 %"));
  tinyxml2::XMLDocument picture;
  EXPECT_EQ(picture.LoadFile(folder.path("cost.svg").c_str()), tinyxml2::XML_SUCCESS);
  EXPECT_THAT(file_bytes(folder.path("cost.csv")),
              AllOf(HasSubstr("scene,quantity,sweep,scheme,step"), HasSubstr(",tolerance,"),
                    HasSubstr(",own,BDF2,0.005,")));
}

TEST(Accuracy, ComparesTheStateWhereItIsAskedFor) {
  const Folder folder;
  const json answer = run_json(folder, {"accuracy", kSmall, "--steps", "150", "--envs", "2",
                                        "--quantity", "state", "--tol", "1e-7"});
  EXPECT_EQ(answer.at("quantity"), "state");
  for (const json& point : answer.at("points")) {
    EXPECT_EQ(point.at("tolerance"), 1e-7);
    EXPECT_EQ(point.at("precision"), "double");
  }
}

TEST(Accuracy, ComparesGradientsWhereTheyAreAskedFor) {
  const Folder folder;
  // The gradient by a touch that begins is not resolved, which SDIRK2 at the same step hides.
  const json answer = run_json(folder,
                               {"accuracy", kSmall, "--steps", "120", "--envs", "2", "--quantity",
                                "gradient", "--target", "0.3", "--csv", "cost.csv"},
                               1);
  EXPECT_EQ(answer.at("quantity"), "gradient");
  const json& reference = answer.at("reference");
  EXPECT_LT(reference.at("scheme_distance"), 0.1);
  EXPECT_GT(reference.at("step_distance"), 0.1);
  EXPECT_GT(reference.at("error"), 0.1);
  EXPECT_EQ(answer.at("advice").at("resolved"), false);
  const json &points = answer.at("points"), &first = points.front();
  EXPECT_GT(first.at("evaluations_per_step"), 1);
  EXPECT_TRUE(first.at("split_share").is_null()) << "is not counted";
  for (const json& point : points) EXPECT_EQ(point.at("precision"), "double");
  EXPECT_THAT(file_bytes(folder.path("cost.csv")), HasSubstr(",gradient,"));
}

TEST(Accuracy, TakesATask) {
  const Folder folder;
  const Outcome outcome = run(folder, {"accuracy", "insertion", "--envs", "2", "--quantity",
                                       "state", "--target", "0.2", "--json"});
  const json answer = json::parse(outcome.out);
  EXPECT_THAT(outcome.exit_code, ::testing::AnyOf(0, 1));
  EXPECT_EQ(answer.at("scene"), "insertion");
  for (const json& point : answer.at("points")) EXPECT_LE(point.at("step"), 5e-3);
  EXPECT_FALSE(answer.at("points").empty());
}

TEST(Accuracy, SaysWhyNothingIsResolved) {
  const Folder folder;
  const json answer =
      run_json(folder, {"accuracy", scene("stable_grasp.xml"), "--steps", "40", "--envs", "1"}, 1);
  EXPECT_EQ(answer.at("advice").at("resolved"), false);
  EXPECT_THAT(answer.at("advice").at("text").get<std::string>(),
              AllOf(HasSubstr("Not resolved"), HasSubstr(" Hz")));
  EXPECT_GT(answer.at("vibration").at("frequency"), 20);
}

/// The reference plays bodies that fall through each other as well as any scheme.
TEST(Accuracy, FailsWhereContactsMissBodies) {
  const Folder folder;
  folder.write("planks.xml", R"(<tangere model="planks">
  <option unit="m-kg" timestep="5e-3" integrator="SDIRK2"/>
  <robot><link name="low"><joint name="low" type="fixed"/>
    <body name="low" type="cuboid" size="0.4 0.02 0.01" density="1000"
          general_contact_resolution="2 2 2"/></link></robot>
  <robot><link name="high"><joint name="high" type="free3d" pos="0 0 0.02"/>
    <body name="high" type="cuboid" size="0.02 0.4 0.01" density="1000"
          general_contact_resolution="2 2 2"/></link></robot>
  <contact><general_primitive_contact general_body="high" primitive_body="low" kn="1e3"
                                      damping="10"/></contact>
</tangere>)");
  const Outcome r = run(folder, {"accuracy", "planks.xml", "--steps", "30", "--envs", "1"});
  EXPECT_EQ(r.exit_code, 1);
  EXPECT_THAT(r.err, HasSubstr("contacts missed bodies in"));
}

/// All schemes share the error of a force that holds for a step.
TEST(Accuracy, NamesLawsOfFirstOrderAndGivesNoAdviceBelowTheirError) {
  const Folder folder;
  folder.write("pulled.xml", R"(<tangere model="pulled">
  <option unit="m-kg" gravity="0 0 0" timestep="5e-3" integrator="SDIRK2"/>
  <robot>
    <link name="block">
      <joint name="rail" type="prismatic" axis="1 0 0" pos="0 0 0"/>
      <body name="block" type="cuboid" size="0.1 0.1 0.2" density="1000"/>
    </link>
  </robot>
  <actuator><motor joint="rail" ctrl="position" P="200" D="4" timing="start"/></actuator>
  <initial><joint name="rail" q="0.1"/></initial>
</tangere>)");
  const Words words{"accuracy", "pulled.xml", "--steps", "100", "--envs", "1", "--json"};
  const Outcome coarse = run(folder, words + Words{"--target", "0.01"});
  EXPECT_EQ(coarse.exit_code, 0) << coarse.err;
  const json answer = json::parse(coarse.out);
  EXPECT_THAT(undocumented_keys(answer), IsEmpty());
  EXPECT_NEAR(answer.at("reference").at("order"), 1, 0.1);
  EXPECT_GT(answer.at("reference").at("error"), answer.at("reference").at("scheme_distance"));
  EXPECT_THAT(answer.at("first_order_laws").at(0).get<std::string>(),
              HasSubstr("timing=\"start\" of the motor of 'rail'"));
  for (const json& order : answer.at("orders")) EXPECT_NEAR(order.at("order"), 1, 0.3) << order;
  EXPECT_THAT(coarse.err,
              AllOf(HasSubstr("All schemes share most of the error"), HasSubstr(": timing=")));
  const Outcome fine = run(folder, words + Words{"--target", "1e-5"});
  EXPECT_EQ(fine.exit_code, 1);
  EXPECT_EQ(json::parse(fine.out).at("advice").at("resolved"), false);
  EXPECT_THAT(fine.err, AllOf(HasSubstr("Not resolved"), HasSubstr("can be of first order")));
  const Outcome cut =
      run(folder, {"simulate", "pulled.xml", "-o", "o.h5", "--steps", "2", "--accuracy", "1e-4"});
  EXPECT_EQ(cut.exit_code, 0);
  EXPECT_THAT(cut.err, HasSubstr("accuracy 0.0001 may not be kept by timing=\"start\""));
}

class AccuracyRefuses : public ::testing::TestWithParam<std::pair<Words, const char*>> {};

TEST_P(AccuracyRefuses, WithAMessage) {
  const Folder folder;
  Words words{"accuracy", kSmall};
  words.insert(words.end(), GetParam().first.begin(), GetParam().first.end());
  const Outcome outcome = run(folder, words);
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_THAT(outcome.err, HasSubstr(GetParam().second));
}

INSTANTIATE_TEST_SUITE_P(
    Values, AccuracyRefuses,
    ::testing::Values(std::pair{Words{"--quantity", "tactil"}, "did you mean 'tactile'"},
                      std::pair{Words{"--target", "1"}, "expected a share below 1"},
                      std::pair{Words{"--steps", "4"}, "expected at least one sample"},
                      std::pair{Words{"--steps", "5"}, "every field stays zero"},
                      std::pair{Words{"--svg", "a", "--csv", "a"}, "expected two files"},
                      std::pair{Words{"--policy", "hold"}, "--policy"},
                      std::pair{Words{"--steps", "1000000000000"}, "1000000000000 steps"},
                      std::pair{Words{"--envs", "900000000"}, "--envs"}));

TEST(Accuracy, StopsAndKeepsWhatThereIs) {
  const Folder folder;
  Program program(folder, {"accuracy", kSmall, "--envs", "48", "--svg", "cost.svg", "--json"}, {},
                  {"", "rows"});
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
  EXPECT_FALSE(answer.at("points").empty());
  EXPECT_TRUE(std::filesystem::exists(folder.path("cost.svg")));
}

}  // namespace
}  // namespace tangere::apps
