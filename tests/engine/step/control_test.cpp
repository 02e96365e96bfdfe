// SPDX-License-Identifier: Apache-2.0
// Tests which control holds in which step, and which controls are refused.
#include "engine/step/control.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

/// A block on rails with two controls; `control` is the scene's <control>, if any.
Model two_controls(const std::string& control = "") {
  const std::string text = R"(<tangere model="rails">
  <option unit="m-kg" timestep="5e-3" integrator="BDF1"/>
  <robot><link name="cart">
    <joint name="cart" type="planar" axis0="1 0 0" axis1="0 1 0"/>
    <body name="cart" type="cuboid" size="0.1 0.1 0.1" density="100"/>
  </link></robot>
  <actuator><motor joint="cart" ctrl="force" ctrl_range="-1 1"/></actuator>)";
  return Model(parse_scene(text + control + "</tangere>", "rails.xml").scene);
}

std::vector<double> at(const ControlProgram& program, std::int64_t step, std::int64_t episode = 0) {
  std::vector<double> u(2);
  program.evaluate(step, episode, u);
  return u;
}

PiecewiseControl steps_up(std::vector<double> times, double end = 0) {
  PiecewiseControl control;
  control.times = std::move(times);
  for (std::size_t k = 0; k < control.times.size(); ++k)
    control.values.push_back({static_cast<double>(k), -static_cast<double>(k)});
  control.end = end;
  return control;
}

/// The message of the InputError that making a program throws; "" when it throws none.
std::string complaint(ControlDescription description, double timestep = 5e-3) {
  try {
    const ControlProgram program(two_controls(), timestep, 0, std::move(description));
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Control, ZeroWhereTheSceneHasNone) {
  const ControlProgram program(two_controls(), 5e-3, 0);
  EXPECT_THAT(at(program, 12345), ElementsAre(0, 0));
  EXPECT_EQ(program.steps(), -1);
}

TEST(Control, TheScenesOwn) {
  const ControlProgram program(two_controls("<control><constant value=\"0.5 -0.25\"/></control>"),
                               5e-3, 0);
  EXPECT_THAT(at(program, 0), ElementsAre(0.5, -0.25));
  EXPECT_THAT(at(program, 1'000'000'000'000), ElementsAre(0.5, -0.25));
  EXPECT_EQ(program.steps(), -1);
  program.check_covers(1'000'000'000'000);
}

TEST(Control, PiecewiseSwitchesOnTheStepThatStartsThen) {
  const ControlProgram program(two_controls(), 5e-3, 0, steps_up({0, 0.5, 0.75, 1.75}, 2.5));
  EXPECT_THAT(at(program, 0), ElementsAre(0, 0));
  EXPECT_THAT(at(program, 99), ElementsAre(0, 0));
  EXPECT_THAT(at(program, 100), ElementsAre(1, -1));
  EXPECT_THAT(at(program, 149), ElementsAre(1, -1));
  EXPECT_THAT(at(program, 150), ElementsAre(2, -2));
  EXPECT_THAT(at(program, 349), ElementsAre(2, -2));
  EXPECT_THAT(at(program, 350), ElementsAre(3, -3));
  EXPECT_THAT(at(program, 1'000'000), ElementsAre(3, -3));  // the last holds
  EXPECT_EQ(program.steps(), 500);
}

TEST(Control, PiecewiseTimesLandOnStepsAtEveryTimestep) {
  // Each of these divides 0.3 s in decimals; few do so in binary.
  for (const int steps : {3, 7, 30, 60, 70, 150, 300, 999, 3000, 123'457}) {
    const double timestep = 0.3 / steps;
    const ControlProgram program(two_controls(), timestep, 0, steps_up({0, 0.3}, 0.6));
    EXPECT_THAT(at(program, steps - 1), ElementsAre(0, 0)) << steps;
    EXPECT_THAT(at(program, steps), ElementsAre(1, -1)) << steps;
    EXPECT_EQ(program.steps(), 2 * steps);
  }
}

TEST(Control, PiecewiseTimesMayMissAStepByRounding) {
  struct Case {
    double time, timestep;
    std::int64_t step;
  };
  // 1.1 / 0.1 is a little more than 11 in binary; then a millionth of a step either side.
  for (const auto& [time, timestep, step] :
       {Case{1.1, 0.1, 11}, Case{0.3, 0.1, 3}, Case{0.5 + 4e-9, 5e-3, 100},
        Case{0.5 - 4e-9, 5e-3, 100}, Case{0.5 + 6e-9, 5e-3, 101}}) {
    const ControlProgram program(two_controls(), timestep, 0, steps_up({0, time}, 2));
    EXPECT_THAT(at(program, step - 1), ElementsAre(0, 0)) << time << " s at " << timestep << " s";
    EXPECT_THAT(at(program, step), ElementsAre(1, -1)) << time << " s at " << timestep << " s";
  }
}

TEST(Control, PiecewiseTimesBetweenStepsWaitForTheNext) {
  const ControlProgram program(two_controls(), 0.1, 0, steps_up({0, 0.25, 0.26, 0.41}, 0.95));
  EXPECT_THAT(at(program, 2), ElementsAre(0, 0));
  EXPECT_THAT(at(program, 3), ElementsAre(2, -2));  // the later of two in one step
  EXPECT_THAT(at(program, 4), ElementsAre(2, -2));
  EXPECT_THAT(at(program, 5), ElementsAre(3, -3));
  EXPECT_EQ(program.steps(), 10);
  EXPECT_EQ(ControlProgram(two_controls(), 1e9, 0, steps_up({0, 0.5}, 0.6)).steps(), 1);
}

TEST(Control, ATableHoldsOneRowPerStep) {
  const CsvControl table{{{1, 2}, {3, 4}, {5, 6}}, "u.csv"};
  const ControlProgram program(two_controls(), 5e-3, 0, table);
  EXPECT_EQ(program.steps(), 3);
  EXPECT_THAT(at(program, 0), ElementsAre(1, 2));
  EXPECT_THAT(at(program, 2), ElementsAre(5, 6));
  EXPECT_THROW(at(program, 3), InputError);
  program.check_covers(3);
  try {
    program.check_covers(4);
    FAIL() << "three rows cover four steps";
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "u.csv: 3 rows of controls for 4 steps; expected a row per step");
  }
}

TEST(Control, RandomIsSmoothBoundedAndKeyed) {
  const double timestep = 1e-3, amplitude = 0.7;
  const RandomControl noise{amplitude, 0.05};
  const ControlProgram program(two_controls(), timestep, 3, noise);
  double largest = 0, fastest = 0;
  for (std::int64_t step = 0; step < 20'000; ++step) {
    const auto now = at(program, step, 11), next = at(program, step + 1, 11);
    for (std::size_t k = 0; k < 2; ++k) {
      largest = std::max(largest, std::abs(now[k]));
      fastest = std::max(fastest, std::abs(next[k] - now[k]));
    }
  }
  EXPECT_LE(largest, amplitude);
  EXPECT_GT(largest, 0.95 * amplitude);
  // A half cosine between knots at most 2 a apart is steepest in its middle.
  EXPECT_LE(fastest, 2 * amplitude * M_PI / 2 * timestep / noise.period * (1 + 1e-9));
  EXPECT_EQ(program.steps(), -1);

  const auto here = at(program, 777, 11);
  EXPECT_NE(here[0], here[1]);
  EXPECT_NE(here, at(program, 777, 12));
  EXPECT_NE(here, at(ControlProgram(two_controls(), timestep, 4, noise), 777, 11));
  EXPECT_EQ(here, at(ControlProgram(two_controls(), timestep, 3, noise), 777, 11));
}

TEST(Control, RandomKnotsDoNotMoveWithTheTimestep) {
  const RandomControl noise{1, 0.05};
  const ControlProgram coarse(two_controls(), 5e-3, 3, noise);
  const ControlProgram fine(two_controls(), 1e-3, 3, noise);
  for (std::int64_t step = 0; step < 1000; ++step) {
    const auto a = at(coarse, step), b = at(fine, 5 * step);
    for (std::size_t k = 0; k < 2; ++k) EXPECT_NEAR(a[k], b[k], 1e-9);
  }
}

TEST(Control, RefusesWrongCounts) {
  EXPECT_EQ(complaint(ConstantControl{{1}}),
            "constant control: 1 values; expected 2, one per control");
  EXPECT_THAT(complaint(CsvControl{{{1, 2}, {1, 2, 3}}, "u.csv"}),
              HasSubstr("u.csv: row 2: 3 values; expected 2"));
  EXPECT_EQ(complaint(CsvControl{{}, "u.csv"}), "u.csv: no rows of controls");
  PiecewiseControl control = steps_up({0, 1});
  control.values.pop_back();
  EXPECT_THAT(complaint(control), HasSubstr("2 times and 1 values"));
  control.times.pop_back();
  control.values[0] = {1, 2, 3};
  EXPECT_THAT(complaint(control), HasSubstr("piecewise control at 0 s: 3 values; expected 2"));
  EXPECT_THAT(complaint(PiecewiseControl{}), HasSubstr("0 times"));
}

TEST(Control, RefusesWhatIsNotFinite) {
  EXPECT_THAT(complaint(ConstantControl{{1, kNan}}), HasSubstr("nan; expected finite numbers"));
  EXPECT_THAT(complaint(CsvControl{{{1, kNan}}, "u.csv"}), HasSubstr("u.csv: row 1: nan"));
  EXPECT_THAT(complaint(steps_up({0, kNan})), HasSubstr("ascending"));
  EXPECT_THAT(complaint(steps_up({0, HUGE_VAL})), HasSubstr("ascending"));
  EXPECT_THAT(complaint(RandomControl{kNan, 1}), HasSubstr("amplitude nan"));
  EXPECT_THAT(complaint(RandomControl{1, kNan}), HasSubstr("period nan"));
}

TEST(Control, RefusesTimesThatAreNone) {
  EXPECT_THAT(complaint(steps_up({0.1, 1})), HasSubstr("begins at 0.1 s; expected 0"));
  EXPECT_THAT(complaint(steps_up({0, 1, 1})), HasSubstr("1 s after 1 s"));
  EXPECT_THAT(complaint(steps_up({0, 1}, 0.5)), HasSubstr("ends at 0.5 s; expected after 1 s"));
  EXPECT_THAT(complaint(RandomControl{1, 0}), HasSubstr("period 0"));
  EXPECT_THAT(complaint(RandomControl{-1, 1}), HasSubstr("amplitude -1"));
  for (const double timestep : {0.0, -1.0, kNan, HUGE_VAL})
    EXPECT_THAT(complaint(ConstantControl{{1, 2}}, timestep), HasSubstr("timestep")) << timestep;
}

}  // namespace
}  // namespace tangere
