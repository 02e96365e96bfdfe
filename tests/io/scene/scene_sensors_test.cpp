// SPDX-License-Identifier: Apache-2.0
// Tests <imperfections> of a sensor: units, defaults, and errors with line and nearest name.
#include <gmock/gmock.h>

#include "engine/scene/imperfection_checks.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/scene/scene_text.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using testing::kScene;
using testing::with;

const std::string kEnd = "resolution=\"5 7\" damping=\"0.003\"/>";

/// The small scene with what is inside its sensor, which begins in line 24.
std::string inside(const std::string& elements, const std::string& scene = kScene) {
  return with(kEnd, "resolution=\"5 7\" damping=\"0.003\">\n" + elements + "\n</tactile>", scene);
}

SensorImperfections read(const std::string& text) {
  return parse_scene(text, "s.xml").scene.sensors.at(0).imperfections;
}

std::string refusal(const std::string& text) {
  try {
    read(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(SensorImperfectionsElement, GivesEveryCoefficient) {
  const SensorImperfections i = read(
      inside("<imperfections hysteresis=\"0.2\" hysteresis_time=\"0.3\" low_pass=\"0.01\" "
             "delay=\"0.02\" spread=\"0.003\" "
             "crosstalk=\"0.1\" gain=\"0.05\" sensor_gain=\"0.02\" bias=\"0.004\" "
             "noise=\"0.002 0.001\" dead=\"0.01\" saturation=\"3 1\" quantisation=\"0.01\"/>"));
  EXPECT_EQ(i.hysteresis, 0.2);
  EXPECT_EQ(i.hysteresis_time, 0.3);
  EXPECT_EQ(i.low_pass, 0.01);
  EXPECT_EQ(i.delay, 0.02);
  EXPECT_EQ(i.spread, 0.003);
  EXPECT_EQ(i.crosstalk, 0.1);
  EXPECT_EQ(i.gain, 0.05);
  EXPECT_EQ(i.sensor_gain, 0.02);
  EXPECT_EQ(i.bias, (NormalAndShear{0.004, 0.004}));
  EXPECT_EQ(i.noise, (NormalAndShear{0.002, 0.001}));
  EXPECT_EQ(i.dead, 0.01);
  EXPECT_EQ(i.saturation, (NormalAndShear{3, 1}));
  EXPECT_EQ(i.quantisation, (NormalAndShear{0.01, 0.01}));
  EXPECT_EQ(i.source.line, 25);
  EXPECT_EQ(text_of(i),
            "hysteresis 0.2, hysteresis_time 0.3 s, low_pass 0.01 s, delay 0.02 s, spread 0.003 m, "
            "crosstalk 0.1, gain 0.05, sensor_gain "
            "0.02, bias 0.004 N, noise 0.002 0.001 N, dead 0.01, saturation 3 1 N, quantisation "
            "0.01 N");
}

TEST(MarkersElement, FollowsTheUnitsOfTheScene) {
  const std::string element =
      "<markers stiffness=\"2000\" thickness=\"0.3\" spread=\"0.1\"/><imperfections/>";
  const Scene scene =
      parse_scene(with("unit=\"m-kg\"", "unit=\"cm-g\"", inside(element)), "s.xml").scene;
  const std::optional<MarkersDescription>& m = scene.sensors.at(0).markers;
  ASSERT_TRUE(m);
  EXPECT_DOUBLE_EQ(m->stiffness, 2);  // 2000 dyn/cm
  EXPECT_DOUBLE_EQ(m->thickness, 0.003);
  EXPECT_DOUBLE_EQ(m->spread, 0.001);
}

TEST(SensorImperfectionsElement, NoneAndEmptyAreIdeal) {
  EXPECT_FALSE(is_imperfect(read(kScene)));
  EXPECT_FALSE(is_imperfect(read(inside(""))));
  EXPECT_FALSE(is_imperfect(read(inside("<imperfections/>"))));
  EXPECT_FALSE(is_imperfect(read(inside("<imperfections noise=\"0\" saturation=\"0 0\"/>"))));
  EXPECT_EQ(text_of(read(kScene)), "");
}

TEST(SensorImperfectionsElement, FollowsTheUnitsOfTheScene) {
  const SensorImperfections i = read(with(
      "unit=\"m-kg\"", "unit=\"cm-g\"",
      inside("<imperfections spread=\"0.3\" noise=\"100\" delay=\"0.02\" crosstalk=\"0.1\"/>")));
  EXPECT_DOUBLE_EQ(i.spread, 0.003);
  EXPECT_DOUBLE_EQ(i.noise.normal, 0.001);  // 100 dyn
  EXPECT_EQ(i.delay, 0.02);
  EXPECT_EQ(i.crosstalk, 0.1);
}

TEST(SensorImperfectionsElement, MistakesNameLineValueAndWhatWasExpected) {
  const auto expect = [](const std::string& elements, const std::string& line,
                         const std::vector<std::string>& parts) {
    const std::string message = refusal(inside(elements));
    EXPECT_THAT(message, HasSubstr("s.xml:" + line + ": ")) << elements;
    for (const std::string& part : parts) EXPECT_THAT(message, HasSubstr(part));
  };
  expect("<imperfections nois=\"1\"/>", "25", {"unknown attribute 'nois'", "did you mean 'noise'"});
  expect("<imperfection/>", "25", {"did you mean 'imperfections'"});
  expect("<imperfections noise=\"-0.1\"/>", "25", {"noise=\"-0.1\"; expected zero or more"});
  expect("<imperfections dead=\"2\"/>", "25", {"dead=\"2\"; expected a number from 0 to 1"});
  expect("<imperfections noise=\"1 2 3\"/>", "25", {"3 numbers; expected 1 or 2"});
  expect("<imperfections gain=\"0.1 0.2\"/>", "25", {"2 numbers; expected 1"});
  expect("<imperfections bias=\"x\"/>", "25", {"bias=\"x\": expected finite numbers"});
  expect("<imperfections bias=\"\"/>", "25", {"bias", "empty"});
  expect("<imperfections/>\n<imperfections/>", "26", {"a second time", "expected one"});
  expect("<imperfections hysteresis=\"0.2\"/>", "25", {"expected both above 0, or neither"});
  expect("<markers stifness=\"1\"/>", "25", {"unknown attribute", "did you mean 'stiffness'"});
  expect("<markers stiffness=\"0\"/>", "25", {"stiffness"});
  expect("<markers stiffness=\"1\"/>\n<markers stiffness=\"1\"/>", "26", {"a second time"});
  expect("<imperfections crosstalk=\"0.26\"/>", "25", {"expected a number from 0 to 0.25"});
}

}  // namespace
}  // namespace tangere
