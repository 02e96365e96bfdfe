// SPDX-License-Identifier: Apache-2.0
// Tests loops in scene files: units, defaults, and errors that name file and line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "engine/model/model.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

/// Two boxes on hinges and a loop, from line 8 on.
std::string scene_with_loop(const std::string& inside, const std::string& unit = "m-kg") {
  return fmt::format(R"(<tangere model="loop">
<option unit="{}" timestep="5e-3" integrator="BDF2"/>
<robot><link name="one"><joint name="one" type="revolute" axis="0 1 0"/>
<body name="one" type="cuboid" size="1 1 1" density="1"/></link>
<link name="two"><joint name="two" type="revolute" axis="0 1 0" pos="2 0 0"/>
<body name="two" type="cuboid" size="1 1 1" density="1"/></link></robot>
<loop>
{}
</loop></tangere>)",
                     unit, inside);
}

Scene read_loops_of(const std::string& inside, const std::string& unit = "m-kg") {
  return parse_scene(scene_with_loop(inside, unit), "loop.xml").scene;
}

std::string loop_error(const std::string& inside) {
  try {
    static_cast<void>(Model(read_loops_of(inside)));
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(SceneLoops, ComeThroughInSi) {
  const Scene s = read_loops_of(R"(<connect body1="one" body2="two" pos1="3 0 0" stiffness="5"/>
<weld name="tie" body1="two" pos2="1 2 3" quat2="0 0 0 2" stiffness="4" damping="2"
      turning_stiffness="7" turning_damping="6"/>)",
                                "cm-g");
  ASSERT_EQ(s.loops.size(), 2U);
  const LoopDescription &pin = s.loops[0], &tie = s.loops[1];
  EXPECT_EQ(pin.name, "one two");
  EXPECT_FALSE(pin.weld);
  EXPECT_EQ(pin.body2, "two");
  EXPECT_DOUBLE_EQ(pin.position1[0], 0.03);
  EXPECT_FALSE(pin.position2);
  EXPECT_DOUBLE_EQ(pin.stiffness, 5e-3);  // dyn/cm
  EXPECT_EQ(pin.damping, 0);
  EXPECT_EQ(pin.source.line, 8);
  EXPECT_TRUE(tie.weld);
  EXPECT_EQ(tie.body2, "");
  EXPECT_DOUBLE_EQ((*tie.position2)[2], 0.03);
  EXPECT_EQ(*tie.orientation2, (Quaternion{0, 0, 0, 1}));
  EXPECT_DOUBLE_EQ(tie.damping, 2e-3);
  EXPECT_DOUBLE_EQ(tie.turning_stiffness, 7e-7);  // dyn cm
  EXPECT_DOUBLE_EQ(tie.turning_damping, 6e-7);
}

TEST(SceneLoops, MistakesNameTheirLine) {
  EXPECT_THAT(loop_error(R"(<connect body1="on" body2="two" stiffness="5"/>)"),
              HasSubstr("loop.xml:8: <connect>: body1=\"on\": no body has this name; did you mean "
                        "'one'?"));
  EXPECT_THAT(loop_error(R"(<connect body1="one" body2="ground" stiffness="5"/>)"),
              HasSubstr("body2=\"ground\": no body has this name"));
  EXPECT_THAT(loop_error(R"(<connect body1="one" body2="two"/>)"), HasSubstr("'stiffness'"));
  EXPECT_THAT(loop_error(R"(<connect body1="one" body2="two" stiffness="0"/>)"),
              HasSubstr("stiffness=\"0\"; expected a positive number"));
  EXPECT_THAT(loop_error(R"(<connect body1="one" body2="one" stiffness="1"/>)"),
              HasSubstr("body 'one' with itself; expected two bodies"));
  EXPECT_THAT(loop_error(R"(<connect body1="one" quat2="1 0 0 0" stiffness="1"/>)"),
              HasSubstr("quat2"));
  EXPECT_THAT(loop_error(R"(<weld body1="one" body2="two" stiffness="1"/>)"),
              HasSubstr("'turning_stiffness'"));
  EXPECT_THAT(loop_error(R"(<connect body1="one" body2="two" stiffness="1"/>
<connect body1="one" body2="two" stiffness="1"/>)"),
              HasSubstr("loop.xml:9: <connect>: another loop has the name 'one two' already"));
}

}  // namespace
}  // namespace tangere
