// SPDX-License-Identifier: Apache-2.0
// Tests joints, their effects and motors in scene files, in centimetres and grams, and that such a
// scene runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

const std::string kFolder = std::string(TANGERE_TEST_DATA) + "/scenes/";

TEST(SceneJoints, EveryJointEffectAndMotorComesThroughInSi) {
  const SceneFile file = read_scene(kFolder + "every_joint.xml");
  const Scene& s = file.scene;
  ASSERT_EQ(file.warnings.size(), 1U);
  EXPECT_THAT(file.warnings[0],
              HasSubstr("every_joint.xml:10: <joint>: attribute 'lim' has no effect here"));
  const auto joint = [&](const std::string& name) -> const JointDescription& {
    for (const LinkDescription& l : s.links)
      if (l.joint.name == name) return l.joint;
    throw std::logic_error(name);
  };
  const JointDescription &shoulder = joint("shoulder"), &cross = joint("cross"),
                         &puck = joint("puck");
  EXPECT_DOUBLE_EQ(shoulder.damping, 10e-7);  // dyn cm s/rad
  EXPECT_DOUBLE_EQ(shoulder.armature, 500e-7);
  EXPECT_DOUBLE_EQ(shoulder.stiffness, 1e5 * 1e-7);
  EXPECT_DOUBLE_EQ(shoulder.limit_stiffness, 0.2);
  EXPECT_EQ(shoulder.limits, (std::array<double, 2>{-1.5, 1.5}));
  EXPECT_EQ(shoulder.rest, std::vector<double>{0.25});
  EXPECT_EQ(joint("elbow").rest, (std::vector<double>{0.1, 0.2, 0}));
  EXPECT_EQ(joint("elbow").type, JointType::spherical);
  EXPECT_DOUBLE_EQ((*joint("carriage").limits)[1], 0.05);
  EXPECT_DOUBLE_EQ(joint("carriage").limit_stiffness, 2000);
  EXPECT_DOUBLE_EQ(joint("carriage").damping, 2);
  EXPECT_DOUBLE_EQ(cross.stiffness, 100);
  EXPECT_DOUBLE_EQ(cross.rest[0], 0.02);
  EXPECT_DOUBLE_EQ(cross.armature, 3e-3);
  EXPECT_DOUBLE_EQ(puck.damping, 7e-3);
  ASSERT_TRUE(puck.turning);
  EXPECT_DOUBLE_EQ(puck.turning->damping, 7e-7);
  for (const char* free : {"a", "b", "c"}) EXPECT_EQ(joint(free).type, JointType::free);
  ASSERT_EQ(s.motors.size(), 4U);
  EXPECT_DOUBLE_EQ(s.motors[0].P, 0.3);  // from <default>
  EXPECT_DOUBLE_EQ(s.motors[0].D, 2e-3);
  EXPECT_DOUBLE_EQ(s.motors[0].high, 1);
  EXPECT_EQ(s.motors[0].timing, MotorTiming::end);
  EXPECT_EQ(s.motors[1].high, HUGE_VAL);
  EXPECT_DOUBLE_EQ(s.motors[2].P, 200);
  EXPECT_DOUBLE_EQ(s.motors[2].D, 10);
  EXPECT_DOUBLE_EQ(s.motors[2].low, -10);
  EXPECT_EQ(s.motors[2].timing, MotorTiming::start);
  EXPECT_DOUBLE_EQ(s.motors[3].high, 2);
  const auto& control = std::get<PiecewiseControl>(*s.control);
  EXPECT_DOUBLE_EQ(control.values[0][0], 0.3);    // rad
  EXPECT_DOUBLE_EQ(control.values[0][4], 0.015);  // the carriage's target, from centimetres
  EXPECT_DOUBLE_EQ(control.values[0][6], 0.5);    // a force motor's control has no unit
  EXPECT_DOUBLE_EQ(s.randomizations[1].distribution.b, 1e-4);
  EXPECT_DOUBLE_EQ(s.randomizations[2].distribution.b, 1000);
  EXPECT_DOUBLE_EQ(s.randomizations[3].distribution.values[1], 2000);
  EXPECT_DOUBLE_EQ(s.randomizations[4].distribution.b, 10e-3);
  EXPECT_DOUBLE_EQ(s.randomizations[5].distribution.b, 0.3);
  EXPECT_DOUBLE_EQ(s.randomizations[6].distribution.b, 10);
}

/// A slide that follows a hinge, in cm and g: its ratio is in cm/rad, its offset in cm.
TEST(SceneJoints, FollowersAndDryFrictionComeThroughInSi) {
  const std::string body = "\" type=\"cuboid\" size=\"1 1 1\" density=\"1\"/></link>";
  const SceneFile file = parse_scene(
      "<tangere><robot><link name=\"a\"><joint name=\"turn\" type=\"revolute\" axis=\"0 0 1\" "
      "friction=\"2e5\" friction_break=\"0.01\"/><body name=\"a" +
          body +
          "<link name=\"b\"><joint name=\"slide\" type=\"prismatic\" axis=\"1 0 0\" "
          "follows=\"turn\" "
          "ratio=\"3\" offset=\"2\" friction=\"1e5\" friction_break=\"0.01\"/><body name=\"b" +
          body +
          "<link name=\"c\"><joint name=\"back\" type=\"revolute\" axis=\"0 1 0\" follows=\"slide "
          "turn\" "
          "ratio=\"0.5 4\" friction_time=\"0.1\"/><body name=\"c" +
          body + "</robot></tangere>",
      "scene.xml");
  const JointDescription &turn = file.scene.links[0].joint, &slide = file.scene.links[1].joint,
                         &back = file.scene.links[2].joint;
  EXPECT_DOUBLE_EQ(turn.friction, 2e5 * 1e-7);
  EXPECT_DOUBLE_EQ(turn.friction_break, 0.01);
  EXPECT_DOUBLE_EQ(slide.friction, 1e5 * 1e-5);
  EXPECT_DOUBLE_EQ(slide.friction_break, 1e-4);
  EXPECT_EQ(slide.follows, std::vector<std::string>{"turn"});
  EXPECT_DOUBLE_EQ(slide.ratio[0], 0.03);
  EXPECT_DOUBLE_EQ(slide.offset, 0.02);
  EXPECT_DOUBLE_EQ(back.ratio[0], 50);
  EXPECT_DOUBLE_EQ(back.ratio[1], 4);
  ASSERT_EQ(file.warnings.size(), 1U);
  EXPECT_THAT(file.warnings[0], HasSubstr("'friction_time' has no effect without 'friction'"));
  const Model model(file.scene);  // back follows turn by 0.5/cm · 3 cm + 4
  EXPECT_DOUBLE_EQ(model.initial_q()[2], 50 * 0.02);
}

TEST(SceneJoints, ASceneOfEveryJointRuns) {
  const Model model(read_scene(kFolder + "every_joint.xml").scene);
  EXPECT_EQ(model.nv(), 1 + 3 + 3 + 1 + 1 + 2 + 3 + 3 + 3 * 6 + 3);
  EXPECT_EQ(model.nu(), 1 + 3 + 1 + 2);
  EXPECT_EQ(model.mass(4), 0);  // the carriage
  EXPECT_EQ(model.u_units()[4], "m");
  EXPECT_EQ(model.u_names()[1], "wrist.wx");
  for (Integrator scheme : integrators()) {
    StepperOptions options;
    options.integrator = scheme;
    Stepper stepper(model, options);
    Batch batch(model, 5, 2);
    const ControlProgram control(model, stepper.timestep(), 2);
    std::vector<double> u(std::size_t(5 * model.nu()));
    for (int k = 0; k < 50; ++k) {
      for (int e = 0; e < 5; ++e)
        control.evaluate(
            k, e, std::span(u).subspan(std::size_t(e * model.nu()), std::size_t(model.nu())));
      stepper.step(batch, u);
    }
    EXPECT_EQ(batch.failed_count(), 0) << to_string(scheme);
  }
}

/// Targets and forces have units, and the controls of motors with a scale have none.
TEST(SceneJoints, AMotorMapsItsControl) {
  const Scene s =
      parse_scene(
          R"(<redmax><robot><link name="a"><joint name="a" type="prismatic" axis="0 0 1"/>
<body name="a" type="sphere" radius="1"/></link><link name="b"><joint name="b" type="revolute"
axis="0 0 1"/><body name="b" type="sphere" radius="1" pos="2 0 0"/></link></robot><actuator>
<motor joint="a" ctrl="position" P="1" scale="0.5" offset="3" u_range="0 255"/>
<motor joint="b" ctrl="position" P="1" scale="0.5" offset="3" u_range="-1 2"/>
<motor joint="a" name="push" ctrl="force" scale="4" offset="-1"/>
</actuator><control><constant value="100 1 2"/></control></redmax>)",
          "s.xml")
          .scene;
  EXPECT_DOUBLE_EQ(*s.motors[0].scale, 0.005);
  EXPECT_DOUBLE_EQ(s.motors[0].offset, 0.03);
  EXPECT_EQ(s.motors[0].u_range[1], 255);
  EXPECT_DOUBLE_EQ(*s.motors[1].scale, 0.5);
  EXPECT_DOUBLE_EQ(*s.motors[2].scale, 4e-5);
  EXPECT_DOUBLE_EQ(s.motors[2].offset, -1e-5);
  EXPECT_EQ(s.motors[2].low, -HUGE_VAL);
  EXPECT_EQ(std::get<ConstantControl>(*s.control).values, (std::vector<double>{100, 1, 2}));
}

/// A slider that follows a hinge, and a hinge that follows a slider, in centimetres.
TEST(SceneJoints, PowersHaveTheUnitsOfBothCoordinates) {
  const auto scene_of = [](const std::string& attributes) {
    return R"(<redmax><robot><link name="a"><joint name="a" type="revolute" axis="0 0 1"/>
<body name="a" type="sphere" radius="1"/></link><link name="b"><joint name="b" type="prismatic"
axis="0 0 1" follows="a" )" +
           attributes + R"(/><body name="b" type="sphere" radius="1"/></link><link name="c">
<joint name="c" type="prismatic" axis="0 0 1"/><body name="c" type="sphere" radius="1"/></link>
<link name="d"><joint name="d" type="revolute" axis="0 0 1" follows="c" powers="2 3"/>
<body name="d" type="sphere" radius="1"/></link></robot></redmax>)";
  };
  const Scene s = parse_scene(scene_of("ratio=\"0\" powers=\"2 3 4\""), "s.xml").scene;
  const std::vector<double>&slides = s.links[1].joint.powers, &turns = s.links[3].joint.powers;
  ASSERT_EQ(slides.size(), 3U);
  EXPECT_DOUBLE_EQ(slides[0], 0.02);
  EXPECT_DOUBLE_EQ(slides[2], 0.04);
  ASSERT_EQ(turns.size(), 2U);
  EXPECT_DOUBLE_EQ(turns[0], 2e4);
  EXPECT_DOUBLE_EQ(turns[1], 3e6);
  const auto fault = [&](const std::string& attributes) -> std::string {
    try {
      parse_scene(scene_of(attributes), "s.xml");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(fault("powers=\"1 2 3 4\""),
              HasSubstr("s.xml:2: <joint>: powers has 4 numbers; expected 1 to 3"));
}

/// A chain of links, nested or by name.
std::string chain(const std::string& links) {
  return "<tangere><option unit=\"m-kg\"/><robot>" + links + "</robot></tangere>";
}
std::string head(const std::string& name, const std::string& parent = "") {
  return "<link name=\"" + name + "\"" + (parent.empty() ? "" : " parent=\"" + parent + "\"") +
         "><joint name=\"" + name + "\" type=\"revolute\" axis=\"0 1 0\" pos=\"0.05 0 0\"/>" +
         "<body type=\"sphere\" radius=\"0.01\" pos=\"0.02 0 0\"/>";
}

TEST(SceneJoints, ALinkMayNameItsParent) {
  const Scene nested =
      parse_scene(chain(head("a") + head("b") + head("c") + "</link></link></link>"), "s.xml")
          .scene;
  const Scene flat = parse_scene(chain(head("a") + "</link>" + head("b", "a") + "</link>" +
                                       head("c", "b") + "</link>"),
                                 "s.xml")
                         .scene;
  ASSERT_EQ(flat.links.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(flat.links[k].name, nested.links[k].name);
    EXPECT_EQ(flat.links[k].parent, nested.links[k].parent);
    EXPECT_EQ(flat.links[k].joint.pose.position, nested.links[k].joint.pose.position);
  }
  // Also with links inside it, beside others, and of another robot.
  const Scene mixed =
      parse_scene(chain(head("a") + head("b") + "</link></link></robot><robot>" + head("c", "b") +
                        head("d") + "</link></link>" + head("e", "a") + "</link>"),
                  "s.xml")
          .scene;
  std::vector<int> parents;
  for (const LinkDescription& l : mixed.links) parents.push_back(l.parent);
  EXPECT_EQ(parents, (std::vector<int>{-1, 0, 1, 2, 0}));
}

TEST(SceneJoints, AParentStandsBeforeAndIsNamedOnce) {
  const auto error_of = [](const std::string& links) -> std::string {
    try {
      parse_scene(chain(links), "s.xml");
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(error_of(head("arm") + "</link>" + head("hand", "amr") + "</link>"),
              HasSubstr("<link>: parent=\"amr\"; expected a link that stands before it; did you "
                        "mean 'arm'?"));
  EXPECT_THAT(error_of(head("hand", "arm") + "</link>" + head("arm") + "</link>"),
              HasSubstr("parent=\"arm\"; expected a link that stands before it"));
  EXPECT_THAT(error_of(head("arm") + head("hand", "arm") + "</link></link>"),
              HasSubstr("parent=\"arm\" of a link inside another; expected it of links directly"));
}

TEST(SceneJoints, AHundredLinksMakeAChain) {
  std::string links = head("link0") + "</link>";
  for (int k = 1; k < 300; ++k)
    links += head("link" + std::to_string(k), "link" + std::to_string(k - 1)) + "</link>";
  const Model model(parse_scene(chain(links), "s.xml").scene);
  EXPECT_EQ(model.nv(), 300);
}

}  // namespace
}  // namespace tangere
