// SPDX-License-Identifier: Apache-2.0
// Tests transmissions in scene files: units, motors on bodies, and errors that name file and line.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "engine/model/model.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

/// A box on a hinge, a joint without mass, and sections from line 8 on.
std::string scene_with_cord(const std::string& inside, const std::string& unit = "m-kg") {
  return fmt::format(R"(<tangere model="cord">
<option unit="{}" timestep="5e-3" integrator="BDF2"/>
<robot><link name="box"><joint name="hinge" type="revolute" axis="0 1 0"/>
<body name="box" type="cuboid" size="1 1 1" density="1"/></link></robot>
<robot><link name="cord"><joint name="cord" type="prismatic" axis="1 0 0" stiffness="8"/>
<body name="cord" type="abstract" mass="0" inertia="0 0 0"/></link></robot>

{}
</tangere>)",
                     unit, inside);
}

Scene read_cord(const std::string& inside, const std::string& unit = "m-kg") {
  return parse_scene(scene_with_cord(inside, unit), "cord.xml").scene;
}

std::string cord_error(const std::string& inside) {
  try {
    static_cast<void>(Model(read_cord(inside)));
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(SceneTransmissions, ComeThroughInSi) {
  const Scene s = read_cord(R"(<transmission><path joint="cord">
<point body="box" pos="200 0 0"/><wrap pos="1 2 3" radius="4" axis="0 0 2" side="9 2 3"/>
<point pos="-300 0 0"/><pulley divisor="2"/><point/><wrap body="box" radius="1"/>
<point body="box" pos="1 0 0"/></path></transmission>
<actuator><motor body="box" name="push" pos="5 0 0" gear="0 0 1 20 0 0" ctrl="force"
ctrl_range="-1 1"/></actuator>)",
                            "cm-g");
  ASSERT_EQ(s.transmissions.size(), 2U);
  const TransmissionDescription &push = s.transmissions[0], &cord = s.transmissions[1];
  EXPECT_EQ(cord.joint, "cord");
  EXPECT_EQ(cord.source.line, 8);
  ASSERT_EQ(cord.path.size(), 7U);
  EXPECT_DOUBLE_EQ(cord.path[0].position[0], 2);
  EXPECT_EQ(cord.path[1].kind, PathPart::Kind::cylinder);
  EXPECT_DOUBLE_EQ(cord.path[1].radius, 0.04);
  EXPECT_EQ(cord.path[1].axis, (Vector3{0, 0, 1}));
  EXPECT_DOUBLE_EQ((*cord.path[1].side)[0], 0.09);
  EXPECT_EQ(cord.path[3].divisor, 2);
  EXPECT_EQ(cord.path[5].kind, PathPart::Kind::sphere);
  EXPECT_EQ(push.joint, "push");
  EXPECT_EQ(push.kind, TransmissionDescription::Kind::wrench);
  EXPECT_EQ(push.force, (Vector3{0, 0, 1}));
  EXPECT_DOUBLE_EQ(push.position[0], 0.05);
  EXPECT_DOUBLE_EQ(push.torque[0], 0.2);
  ASSERT_EQ(s.motors.size(), 1U);
  EXPECT_EQ(s.motors[0].joint, "push");
  EXPECT_TRUE(Model(s).has_transmissions());
}

TEST(SceneTransmissions, WrenchesMayHaveAxesOfAnotherBody) {
  const Scene s = read_cord(R"(<transmission><wrench joint="cord" body="box" force="0 0 2"
reference="world" pos2="0 0 0.1"/></transmission>)");
  ASSERT_EQ(s.transmissions.size(), 1U);
  EXPECT_EQ(s.transmissions[0].reference, "");
  EXPECT_EQ(s.transmissions[0].reference_position, (Vector3{0, 0, 0.1}));
}

TEST(SceneTransmissions, MistakesNameTheirLine) {
  const auto path = [](const std::string& inside, const char* joint = "cord") {
    return cord_error(
        fmt::format("<transmission><path joint=\"{}\">\n{}</path></transmission>", joint, inside));
  };
  const std::string points = R"(<point body="box" pos="1 0 0"/><point pos="0 0 3"/>)";
  EXPECT_EQ(path(points), "");
  EXPECT_THAT(path(points, "rope"), HasSubstr("cord.xml:8: <path>: joint=\"rope\": no joint"));
  EXPECT_THAT(path(R"(<point body="bax"/><point/>)"),
              HasSubstr("cord.xml:9: <point>: body=\"bax\": no body has this name; did you mean "
                        "'box'?"));
  EXPECT_THAT(path(R"(<point body="box"/><wrap radius="0"/><point/>)"),
              HasSubstr("radius=\"0\"; expected a positive number"));
  EXPECT_THAT(path(R"(<point body="box"/>)"), HasSubstr("cord.xml:8: transmission 'cord' ends at "
                                                        "no second point"));
  EXPECT_THAT(cord_error(R"(<actuator><motor body="box" gear="1 0 0 0 0 0" ctrl="force"
ctrl_range="-1 1"/></actuator>)"),
              HasSubstr("a motor on a body has no name"));
  EXPECT_THAT(cord_error(R"(<actuator><motor body="box" name="push" gear="0 0 0 0 0 0" ctrl="force"
ctrl_range="-1 1"/></actuator>)"),
              HasSubstr("neither a force nor a torque"));
}

}  // namespace
}  // namespace tangere
