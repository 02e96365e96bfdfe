// SPDX-License-Identifier: Apache-2.0
// Tests that each verdict is given where it should be, that variants reach what they name, and that
// the table of cases is whole.
#include "tasks/stress/stress_run.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <set>

#include "engine/base/error.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::AnyOf;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A ball that falls onto the ground, in two environments.
const char* const kFalling = R"(<tangere model="falling">
  <option unit="m-kg" timestep="5e-3" integrator="BDF1"/>
  <ground pos="0 0 0" normal="0 0 1"/>
  <robot><link name="b"><joint name="b" type="free3d" pos="0 0 0.02"/>
    <body name="b" type="sphere" radius="0.01" density="1000"/></link></robot>
  <contact><ground_contact body="b" kn="1e3" kt="1" mu="0.5" damping="1"/></contact>
  <initial><joint name="b" v="0 0 -1 0 0 0"/></initial>
  <randomize><ground_contact body="b" field="kn" uniform="900 1100"/></randomize>
</tangere>)";

StressScene falling(const std::string& file) { return {parse_scene(kFalling, file).scene}; }

StressCase a_case(Criterion measure, double bound) {
  return {.name = "falling",
          .scene = "falling.xml",
          .criterion = "a number",
          .measure = std::move(measure),
          .bound = bound,
          .seconds = 0.1,
          .environments = 2};
}

StressRow only_row(const StressCase& of, const StressScenes& scenes = falling) {
  const StressReport report = run_stress({&of, 1}, {}, scenes, {});
  EXPECT_EQ(report.rows.size(), 1U);
  return report.rows.at(0);
}

TEST(StressRun, HoldsWhereTheCriterionIsMet) {
  const StressCase of = a_case(largest_sink, 0.1);
  const StressRow row = only_row(of);
  EXPECT_EQ(row.verdict, StressVerdict::holds);
  EXPECT_EQ(row.integrator, Integrator::bdf1);
  EXPECT_EQ(row.step, 5e-3);
  EXPECT_EQ(row.counts.simulation_steps, 2 * 20);
  EXPECT_GE(row.evaluations, 1);
  EXPECT_GE(row.most_evaluations, row.evaluations);
  EXPECT_GT(row.value, 0.009);
}

TEST(StressRun, FailsWhereItIsNotMetAndNothingWasSaid) {
  EXPECT_EQ(only_row(a_case(largest_sink, 1e-3)).verdict, StressVerdict::fails);
}

TEST(StressRun, FailsWhereTheMeasureIsNoNumber) {
  const StressCase of = a_case([](const StressHistory&) { return std::nan(""); }, 1e9);
  EXPECT_EQ(only_row(of).verdict, StressVerdict::fails);
}

/// For the small rolling ball, a step of one day has no solution.
TEST(StressRun, FlagsEnvironmentsThatFail) {
  StressCase of = a_case(largest_sink, 1e9);
  of.scene = "rolling_ball_small.xml";
  of.steps = {86400};
  of.seconds = 2 * 86400;
  const StressScenes shipped = [](const std::string& file) {
    return StressScene{read_scene(TANGERE_SOURCE_DIR "/scenes/" + file).scene};
  };
  const StressRow row = only_row(of, shipped);
  EXPECT_EQ(row.verdict, StressVerdict::flagged);
  EXPECT_EQ(row.failed, 2);
  EXPECT_TRUE(std::isnan(row.value));
  EXPECT_FALSE(row.reason.empty());
  of.may_fail = 1;
  EXPECT_EQ(only_row(of, shipped).verdict, StressVerdict::holds);
}

TEST(StressRun, FlagsASceneThatIsRefused) {
  const StressCase of = a_case(largest_sink, 1);
  const StressRow row = only_row(
      of, [](const std::string& file) -> StressScene { throw InputError(file + ":7: too deep"); });
  EXPECT_EQ(row.verdict, StressVerdict::flagged);
  EXPECT_EQ(row.reason, "refused: falling.xml:7: too deep");
}

TEST(StressRun, FlagsWhatWasWarnedOf) {
  const StressCase of = a_case(largest_sink, 1e-3);
  const StressRow row = only_row(of, [](const std::string& file) {
    return StressScene{falling(file).scene, {"points are far apart"}};
  });
  EXPECT_EQ(row.verdict, StressVerdict::flagged);
  EXPECT_EQ(row.reason, "warning: points are far apart");
}

TEST(StressRun, ComparesPassesWithTheOrdinaryScene) {
  StressCase of = a_case({}, 1);
  EXPECT_EQ(only_row(of).value, 1);
  of.variant.kn = 1e5;
  EXPECT_GT(only_row(of).value, 1);
}

TEST(StressRun, StopsWhenItIsToldTo) {
  const StressCase of = a_case(largest_sink, 1);
  std::stop_source source;
  const auto stopping = [&](const std::string& file) {
    source.request_stop();
    return falling(file);
  };
  const StressReport report = run_stress({&of, 1}, {}, stopping, {source.get_token(), {}});
  EXPECT_TRUE(report.stopped);
  EXPECT_THAT(report.rows, IsEmpty());
}

TEST(StressRun, ThreadsDoNotChangeWhatIsMeasured) {
  StressCase of = a_case(largest_sink, 1);
  of.environments = 40;
  StressOptions options;
  const StressRow alone = run_stress({&of, 1}, options, falling, {}).rows.at(0);
  options.threads = 2;
  const StressRow shared = run_stress({&of, 1}, options, falling, {}).rows.at(0);
  EXPECT_EQ(alone.value, shared.value);
  EXPECT_EQ(alone.evaluations, shared.evaluations);
}

TEST(StressRun, RefusesANameThatIsNotThere) {
  const StressCase of = a_case(largest_sink, 1);
  StressOptions options;
  options.name = "rising";
  EXPECT_THROW(run_stress({&of, 1}, options, falling, {}), InputError);
}

TEST(StressRun, VariesStiffnessAndSpeedWithWhatIsDrawn) {
  const Scene scene = varied(falling("falling.xml").scene, {.kn = 10, .kt = 3, .speed = 2});
  EXPECT_EQ(scene.ground_contacts.at(0).coefficients.kn, 1e4);
  EXPECT_EQ(scene.ground_contacts.at(0).coefficients.kt, 3);
  EXPECT_EQ(scene.initial.at(0).v.at(2), -2);
  EXPECT_EQ(scene.randomizations.at(0).distribution.a, 9000);
  EXPECT_EQ(scene.randomizations.at(0).distribution.b, 11000);
}

TEST(StressRun, GivesContactsSpringsWithTheirDampers) {
  const ContactCoefficients c = varied(falling("falling.xml").scene, {.kn = 2, .ks = 0.25})
                                    .ground_contacts.at(0)
                                    .coefficients;
  EXPECT_EQ(c.ks, 500);
  EXPECT_EQ(c.kt, 2.5);
  EXPECT_EQ(varied(falling("falling.xml").scene, {}).ground_contacts.at(0).coefficients.ks, 0);
}

TEST(StressCases, AreWhole) {
  std::set<std::string> names;
  for (const StressCase& of : stress_cases()) {
    EXPECT_TRUE(names.insert(of.name).second) << of.name << " is there twice";
    EXPECT_FALSE(of.criterion.empty()) << of.name;
    EXPECT_EQ(!of.measure, of.steps.empty()) << of.name << ": only passes take a scene's own step";
  }
}

/// A mistake in a file must not pass for a scene that is refused.
TEST(StressCases, HaveScenesThatLoad) {
  std::set<std::string> refused, coarse;
  for (const StressCase& of : stress_cases()) try {
      const SceneFile file = read_scene(TANGERE_SOURCE_DIR "/scenes/" + of.scene);
      EXPECT_THAT(
          file.warnings,
          Each(AnyOf(HasSubstr("it can come between them"), HasSubstr("have such points"),
                     HasSubstr("the rims may miss the face"), HasSubstr("rolls over a polygon"))))
          << of.scene;
      if (!file.warnings.empty()) coarse.insert(of.scene);
      EXPECT_GT(Model(varied(file.scene, of.variant)).nv(), 0) << of.scene;
      EXPECT_TRUE(of.seconds > 0 || file.scene.control) << of.name << " has no end";
    } catch (const InputError&) {
      refused.insert(of.scene);
    }
  EXPECT_THAT(refused, IsEmpty());
  // Bodies whose contact points are as far apart as the next body is wide, or farther.
  EXPECT_THAT(coarse,
              ::testing::ElementsAre("hard/arch.xml", "hard/card_house.xml", "hard/cradle.xml",
                                     "hard/post_between_points.xml", "hard/rod_between_fingers.xml",
                                     "hard/stack_equal.xml", "hard/stack_shifted.xml",
                                     "hard/stack_three_points.xml"));
}

}  // namespace
}  // namespace tangere
