// SPDX-License-Identifier: Apache-2.0
// Tests which joints a robot measures: those that motors move, directly or through others.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "engine/scene/actuated_joints.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

/// An arm of two hinges, two fingers and a rod that is free; further joints and motors.
std::vector<std::string> actuated_in(const std::string& joints, const std::string& sections) {
  const std::string body = R"(type="sphere" radius="0.1" density="1000"/>)";
  const std::string text = R"(<tangere><option unit="m-kg" timestep="5e-3" integrator="BDF1"/>
<robot><link name="arm"><joint name="arm" type="revolute" axis="0 1 0"/><body name="arm" )" +
                           body + R"(<link name="elbow"><joint name="elbow" type="revolute"
axis="0 1 0"/><body name="elbow" )" +
                           body + "</link></link></robot>" +
                           R"(<robot><link name="rod"><joint name="rod" type="free3d"/>
<body name="rod" )" + body +
                           "</link></robot>" + joints + sections + "</tangere>";
  return actuated_joints(parse_scene(text, "arm.xml").scene);
}

std::string slider(const std::string& name, const std::string& more = "") {
  return "<robot><link name=\"" + name + "\"><joint name=\"" + name +
         "\" type=\"prismatic\" axis=\"1 0 0\"" + more + "/><body name=\"" + name +
         "\" type=\"sphere\" radius=\"0.1\" density=\"1000\"/></link></robot>";
}

/// A joint without mass.
std::string cord(const std::string& more = "") {
  return R"(<robot><link name="cord"><joint name="cord" type="prismatic" axis="1 0 0" )" + more +
         R"(/><body name="cord" type="abstract" mass="0" inertia="0 0 0"/></link></robot>)";
}

std::string motor(const std::string& joint) {
  return "<actuator><motor joint=\"" + joint + "\" ctrl=\"force\" ctrl_range=\"-1 1\"/></actuator>";
}

TEST(ActuatedJoints, AreThoseWithMotors) {
  EXPECT_THAT(actuated_in("", ""), IsEmpty());
  EXPECT_THAT(actuated_in("", motor("elbow")), ElementsAre("elbow"));
}

TEST(ActuatedJoints, LeadAndFollow) {
  const std::string twin = slider("left") + slider("right", " follows=\"left\" ratio=\"-1\"");
  EXPECT_THAT(actuated_in(twin, motor("left")), ElementsAre("left", "right"));
  const std::string pair = slider("left") + slider("right");
  const std::string tendon = cord("follows=\"left right\" ratio=\"1 1\" stiffness=\"8\"");
  EXPECT_THAT(actuated_in(pair + tendon, motor("cord")), ElementsAre("left", "right", "cord"));
  EXPECT_THAT(actuated_in(pair + tendon, motor("left")), ElementsAre("left"));  // a spring's tendon
}

TEST(ActuatedJoints, AreMovedThroughTransmissions) {
  const auto path = [](const std::string& points) {
    return "<transmission><path joint=\"cord\">" + points + "</path></transmission>";
  };
  const std::string over_both = path(R"(<point pos="0 0 1"/><point body="elbow" pos="0.1 0 0"/>)"),
                    in_the_arm = path(R"(<point body="arm"/><point body="elbow" pos="0.1 0 0"/>)"),
                    to_the_rod = path(R"(<point pos="0 0 1"/><point body="rod" pos="0.1 0 0"/>)");
  const std::string joint = cord("stiffness=\"8\"");
  EXPECT_THAT(actuated_in(joint, over_both + motor("cord")), ElementsAre("arm", "elbow", "cord"));
  EXPECT_THAT(actuated_in(joint, in_the_arm + motor("cord")), ElementsAre("elbow", "cord"));
  EXPECT_THAT(actuated_in(joint, to_the_rod + motor("cord")), ElementsAre("cord"));  // it is free
  EXPECT_THAT(actuated_in(joint, over_both), IsEmpty());
}

}  // namespace
}  // namespace tangere
