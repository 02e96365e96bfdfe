// SPDX-License-Identifier: Apache-2.0
// Tests end effectors in scene files: units, defaults, names.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "engine/sense/readout.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/scene/scene_text.hpp"

namespace tangere {
namespace {

using ::testing::ElementsAre;
using testing::with;

Scene with_end_effectors(const std::string& end_effectors, const std::string& unit = "m-kg") {
  const std::string text = with("unit=\"m-kg\"", "unit=\"" + unit + "\"");
  const SceneFile file = parse_scene(with("<sensor>", end_effectors + "<sensor>", text), "s.xml");
  EXPECT_THAT(file.warnings, ::testing::IsEmpty());
  return file.scene;
}

TEST(SceneEndEffectors, KeepJointAndPlace) {
  const Scene s = with_end_effectors(R"(<variable>
    <endeffector name="nose" joint="ball_joint" pos="0.01 -0.02 0.03" radius="0.004" )"
                                     R"(rgba="0.5 0.25 0"/>
    <endeffector name="heel" joint="pad_joint" pos="0 0 -0.005"/></variable>)");
  ASSERT_EQ(s.end_effectors.size(), 2U);
  EXPECT_EQ(s.end_effectors[0].name, "nose");
  EXPECT_EQ(s.end_effectors[0].joint, "ball_joint");
  EXPECT_EQ(s.end_effectors[0].position, (Vector3{0.01, -0.02, 0.03}));
  EXPECT_EQ(s.end_effectors[0].radius, 0.004);
  EXPECT_THAT(s.end_effectors[0].rgba, ElementsAre(0.5, 0.25, 0, 1));
  EXPECT_EQ(s.end_effectors[0].source.line, 24);
  EXPECT_EQ(s.end_effectors[1].joint, "pad_joint");
  EXPECT_EQ(s.end_effectors[1].radius, EndEffectorDescription{}.radius);
}

TEST(SceneEndEffectors, AreConvertedFromCentimetresAndTakeDefaults) {
  const Scene s = with_end_effectors(
      R"(<default><endeffector radius="0.3" rgba="0 1 0 0.5"/></default><variable>
    <endeffector joint="ball_joint" pos="1 -2 3"/>
    <endeffector joint="ball_joint" pos="0 0 0" radius="0.1"/></variable>)",
      "cm-g");
  EXPECT_EQ(s.end_effectors[0].position, (Vector3{0.01, -0.02, 0.03}));
  EXPECT_DOUBLE_EQ(s.end_effectors[0].radius, 0.003);
  EXPECT_THAT(s.end_effectors[0].rgba, ElementsAre(0, 1, 0, 0.5));
  EXPECT_DOUBLE_EQ(s.end_effectors[1].radius, 0.001);
  // The pad's joint stands at (0, 0, 0.06 cm), the ball's at (0, 0, 0.02 cm); the ball starts at x
  // = 0.001 cm, at rest turned by nothing, so what is read is the sum, in metres.
  Scene still = s;
  still.randomizations.clear();
  const Model model(still);
  const Batch batch(model, 1);
  std::vector<double> x(6);
  Readout(model).end_effectors(batch, 0, x);
  EXPECT_NEAR(x[0], 0.01 + 0.00001, 1e-17);
  EXPECT_NEAR(x[1], -0.02, 1e-17);
  EXPECT_NEAR(x[2], 0.03 + 0.0002, 1e-17);
}

TEST(SceneEndEffectors, WithoutNamesGetTheirNumberInTheFile) {
  const Scene s = with_end_effectors(R"(<variable>
    <endeffector joint="ball_joint" pos="0 0 0"/>
    <endeffector joint="ball_joint" pos="0 0 0" name="endeffector3"/></variable>
    <variable><endeffector joint="ball_joint" pos="0 0 0"/>
    <endeffector joint="ball_joint" pos="0 0 0"/></variable>)");
  const Model model(s);
  std::vector<std::string> names;
  for (const EndEffectorInfo& v : model.end_effectors()) names.push_back(v.name);
  EXPECT_THAT(names, ElementsAre("endeffector0", "endeffector3", "endeffector2", "endeffector4"));
}

}  // namespace
}  // namespace tangere
