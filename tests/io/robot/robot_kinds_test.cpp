// SPDX-License-Identifier: Apache-2.0
// What import makes of robots that say things in less common ways: what it takes over, what it
// lists, and what it refuses. tests/data/robots/kinds.xml compares the motion with MuJoCo's.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "engine/model/model.hpp"
#include "engine/scene/sensed_bodies.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/step/stepper.hpp"
#include "io/robot/robot_import.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

class RobotKinds : public ::testing::Test {
 protected:
  ImportedScene import(const std::string& text, const std::string& keyframe = "") {
    std::ofstream(folder_ / "robot.xml") << text;
    RobotOptions options;
    options.keyframe = keyframe;
    return import_robot(folder_ / "robot.xml", folder_ / "scene.xml", options);
  }
  Scene scene(const std::string& text, const std::string& keyframe = "") {
    return parse_scene(import(text, keyframe).text, folder_ / "scene.xml").scene;
  }
  std::string fault_of(const std::string& text, const std::string& keyframe = "") {
    try {
      import(text, keyframe);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  void write(const std::string& name, const std::string& text) {
    std::filesystem::create_directories((std::filesystem::path(folder_ / name)).parent_path());
    std::ofstream(folder_ / name) << text;
  }

  testing::Folder folder_;
};

/// A model with a hinge `j` of the range -1 to 2 rad, an <option>, a motor and a keyframe.
std::string driven(const std::string& motor, const std::string& ctrl = "0",
                   const std::string& option = "") {
  return "<mujoco><compiler angle=\"radian\"/><option " + option +
         "/><worldbody><body name=\"b\"><joint name=\"j\" range=\"-1 2\"/><geom size=\"0.1\"/>"
         "</body></worldbody><actuator>" +
         motor + "</actuator><keyframe><key name=\"k\" ctrl=\"" + ctrl + "\"/></keyframe></mujoco>";
}

/// The law of a force motor.
double force_of(const MotorDescription& m, double u) {
  if (!m.scale) return m.low + 0.5 * (std::clamp(u, -1.0, 1.0) + 1) * (m.high - m.low);
  return std::clamp(*m.scale * std::clamp(u, m.u_range[0], m.u_range[1]) + m.offset, m.low, m.high);
}

/// The force of the imported motor under a control of the file: the reference is the law of the
/// actuator.
TEST_F(RobotKinds, MotorsExertTheForceOfTheFile) {
  struct Case {
    const char* motor;
    double control, force;
  };
  for (const Case& c : {Case{"<motor joint=\"j\" gear=\"-3\" ctrlrange=\"-1 1\"/>", 0.5, -1.5},
                        Case{"<motor joint=\"j\" gear=\"-3\" ctrlrange=\"0 4\"/>", 3, -9},
                        Case{"<motor joint=\"j\" gear=\"-3\"/>", -5, 15},
                        Case{"<motor joint=\"j\" gear=\"2\"/>", 0.25, 0.5},
                        Case{"<motor joint=\"j\" gear=\"2\" ctrlrange=\"-1 1\"/>", 7, 2},
                        Case{"<motor joint=\"j\" gear=\"2\" forcerange=\"-1 1\"/>", -3, -2},
                        Case{"<motor joint=\"j\" gear=\"-2\" forcerange=\"-1 4\"/>", 3, -6},
                        Case{"<motor joint=\"j\" gear=\"10\" ctrlrange=\"-1 1\" "
                             "forcerange=\"-0.5 0.5\"/>",
                             0.03, 0.3},
                        Case{"<general joint=\"j\" gainprm=\"-4\" ctrlrange=\"-2 2\"/>", 1, -4},
                        Case{"<general joint=\"j\" gainprm=\"-4\" biastype=\"affine\" "
                             "biasprm=\"0.5 0 0\" gear=\"2\"/>",
                             1, -7}}) {
    const Scene made = scene(driven(c.motor, std::to_string(c.control)), "k");
    const MotorDescription& motor = made.motors.at(0);
    const double u = std::get<ConstantControl>(made.control.value()).values.at(0);
    EXPECT_EQ(u, c.control) << c.motor;
    EXPECT_NEAR(force_of(motor, u), c.force, 1e-12) << c.motor;
    EXPECT_THAT(import(driven(c.motor)).changed, IsEmpty());
  }
}

/// The target of the imported motor under a control of the file.
TEST_F(RobotKinds, TargetsAreThoseOfTheFile) {
  struct Case {
    const char* motor;
    double control, target, P;
  };
  const std::string affine = "<general joint=\"j\" biastype=\"affine\" ";
  for (const auto& [attributes, control, target, P] :
       {Case{"gainprm=\"5\" biasprm=\"0 -5 -1\"", 0.3, 0.3, 5},
        Case{"gainprm=\"0.3137\" biasprm=\"0 -100 -10\" ctrlrange=\"0 255\"", 300, 0.3137 * 2.55,
             100},
        Case{"gainprm=\"2\" biasprm=\"1 -4 0\" gear=\"2\" ctrlrange=\"-1 1\"", 0.5, 0.25, 16},
        Case{"gainprm=\"2\" biasprm=\"1 -4 0\" gear=\"-2\"", 0.5, -0.25, 16}}) {
    const MotorDescription motor = scene(driven(affine + attributes + "/>")).motors.at(0);
    EXPECT_EQ(motor.control, MotorControl::position) << attributes;
    EXPECT_NEAR(motor.P, P, 1e-12) << attributes;
    const double u = std::clamp(control, motor.u_range[0], motor.u_range[1]);
    EXPECT_NEAR(motor.scale.value_or(1) * u + motor.offset, target, 1e-12) << attributes;
  }
  for (const char* bias : {"0 3 0", "0 -3 3", "0 0 1"})
    EXPECT_THAT(import(driven(affine + "biasprm=\"" + bias + "\"/>")).lost,
                ElementsAre(HasSubstr("negative stiffness or damping")))
        << bias;
  EXPECT_THAT(import(driven(affine + "gainprm=\"0\" biasprm=\"0 -3 0\"/>")).lost,
              ElementsAre(HasSubstr("<general> with gain 0")));
}

/// A servo of the velocity with a range of its force is one motor, whose force is clipped.
TEST_F(RobotKinds, AServoOfVelocityWithABoundIsOneMotor) {
  const ImportedScene made = import(driven(
      "<velocity joint=\"j\" kv=\"3\" gear=\"-2\" forcerange=\"-1 4\" ctrlrange=\"-5 5\"/>"));
  EXPECT_THAT(made.lost, IsEmpty());
  const Scene s = parse_scene(made.text, folder_ / "scene.xml").scene;
  const MotorDescription& motor = s.motors.at(0);
  EXPECT_EQ(motor.control, MotorControl::force);
  EXPECT_EQ(motor.scale, -6);
  EXPECT_EQ(motor.D, 12);
  EXPECT_EQ(motor.low, -8);
  EXPECT_EQ(motor.high, 2);
  EXPECT_EQ(s.links.at(0).joint.damping, 0);
}

/// Of two servos the one without a range of its force is a spring; tests/data/robots/servos.xml
/// compares such a joint with MuJoCo.
TEST_F(RobotKinds, AJointHasSeveralMotors) {
  const std::string free = "<position name=\"j\" joint=\"j\" kp=\"3\" kv=\"0.5\"/>",
                    clipped = "<position joint=\"j\" kp=\"2\" forcerange=\"-1 1\"/>",
                    force = "<motor name=\"push\" joint=\"j\"/>";
  const ImportedScene both = import(driven(free + clipped + force, "1 2 3"), "k");
  EXPECT_THAT(both.lost, IsEmpty());
  EXPECT_THAT(both.changed, Contains(HasSubstr("a second actuator with a target, of joint 'j'")));
  const Scene s = parse_scene(both.text, folder_ / "scene.xml").scene;
  ASSERT_EQ(s.motors.size(), 3U);
  EXPECT_EQ(s.motors[0].control, MotorControl::force);
  EXPECT_EQ(s.motors[0].scale, 3);
  EXPECT_EQ(s.motors[1].P, 2);
  EXPECT_EQ(s.motors[1].name, "j_2");
  EXPECT_EQ(s.motors[2].name, "push");
  EXPECT_EQ(s.links[0].joint.stiffness, 3);
  EXPECT_EQ(s.links[0].joint.damping, 0.5);
  EXPECT_THAT(std::get<ConstantControl>(s.control.value()).values, ElementsAre(1, 2, 3));
  const ImportedScene lost = import(driven(clipped + free + clipped + force, "1 2 3 4"), "k");
  EXPECT_THAT(lost.lost, ElementsAre(HasSubstr("a joint has one position motor")));
  EXPECT_THAT(
      std::get<ConstantControl>(parse_scene(lost.text, folder_ / "scene.xml").scene.control.value())
          .values,
      ElementsAre(1, 2, 4));
}

/// A range from high to low is the same motor under the opposite control.
TEST_F(RobotKinds, ARangeFromHighToLowTurnsTheForceRound) {
  const auto last = [&](const std::string& range, double u) {
    const Model model(
        parse_scene("<tangere><option unit=\"m-kg\"/><robot><link name=\"a\"><joint name=\"a\" "
                    "type=\"revolute\" axis=\"0 0 1\"/>"
                    "<body name=\"a\" type=\"cuboid\" size=\"1 2 3\" density=\"1000\"/>"
                    "</link></robot><actuator><motor joint=\"a\" ctrl=\"force\" ctrl_range=\"" +
                        range + "\"/></actuator></tangere>",
                    "s.xml")
            .scene);
    Batch batch(model, 1, 1);
    Stepper stepper(model);
    for (int k = 0; k < 20; ++k) stepper.step(batch, std::array{u});
    std::array<double, 1> q{};
    batch.get_q(0, q);
    return q[0];
  };
  EXPECT_NE(last("3 -2", 0.5), 0);
  EXPECT_EQ(last("3 -2", 0.5), last("-2 3", -0.5));
}

TEST_F(RobotKinds, WordsThatChangeAForceAreNotIdle) {
  const auto idle = [&](const std::string& motor, const std::string& option = "") {
    std::string all;
    for (const std::string& line : import(driven(motor, "0 0", option)).idle) all += line + "\n";
    return all;
  };
  const std::string second = "<motor joint=\"j\"/>";
  for (const char* more : {"damping=\"1\"", "armature=\"1\"", "delay=\"0.1\"", "cranklength=\"1\""})
    EXPECT_THAT(import(driven("<motor joint=\"j\" " + std::string(more) + "/>")).lost,
                ElementsAre(HasSubstr("<motor> ")))
        << more;
  EXPECT_THAT(import(driven("<position joint=\"j\" timeconst=\"0.1\"/>")).lost,
              ElementsAre(HasSubstr("<position> timeconst")));
  EXPECT_THAT(import(driven("<pid joint=\"j\" kp=\"1\"/>")).lost,
              ElementsAre(HasSubstr("<pid>: an actuator that scenes do not have")));
  const ImportedScene off = import(
      driven("<motor joint=\"j\" group=\"3\"/>" + second, "0 0", "actuatorgroupdisable=\"1 3\""));
  EXPECT_EQ(off.motors, 1U);
  EXPECT_THAT(off.lost, IsEmpty());
  EXPECT_THAT(off.changed, Contains(HasSubstr("a group that <option actuatorgroupdisable>")));
  EXPECT_THAT(idle("<motor joint=\"j\" group=\"3\"/>" + second, "actuatorgroupdisable=\"1 3\""),
              Not(HasSubstr("group")));
}

/// Half of the range -1 to 2 about its middle is -0.25 to 1.25.
TEST_F(RobotKinds, AnInheritedRangeBoundsTheControl) {
  const Scene made =
      scene(driven("<position joint=\"j\" kp=\"9\" inheritrange=\"0.5\"/>", "-3"), "k");
  EXPECT_THAT(made.motors.at(0).u_range, ElementsAre(-0.25, 1.25));
  EXPECT_THAT(std::get<ConstantControl>(made.control.value()).values, ElementsAre(-3));
}

/// Bodies that move rigidly together have one share of gravity. That of a body on an upright axis
/// alone does not matter, as its weight does no work.
TEST_F(RobotKinds, LiftedBodiesHaveAShareOfGravity) {
  const auto arm = [](const std::string& base, const std::string& upper, const std::string& lower,
                      const std::string& axis) {
    return "<mujoco><worldbody><body name=\"base\"" + base + "><joint axis=\"" + axis +
           "\"/><geom size=\"0.1\" pos=\"0.1 0 0\"/><body name=\"upper\"" + upper +
           "><joint axis=\"0 1 0\"/><geom size=\"0.1\" pos=\"0 0 1\"/>"
           "<geom size=\"0.1\" pos=\"0 0 2\"/><body name=\"lower\"" +
           lower +
           " pos=\"0 0 2\"><joint axis=\"0 1 0\"/><geom size=\"0.1\" pos=\"0 0 1\"/>"
           "</body></body></body></worldbody></mujoco>";
  };
  const std::string all = " gravcomp=\"1\"", some = " gravcomp=\"0.25\"";
  const auto shares = [&](const std::string& text) {
    std::vector<double> out;
    for (const LinkDescription& l : scene(text).links) out.push_back(l.body.gravity_share);
    return out;
  };
  EXPECT_THAT(shares(arm("", all, all, "0 0 1")), ElementsAre(0, 0, 0, 0));
  EXPECT_THAT(shares(arm(some, some, some, "1 0 0")), ElementsAre(0.75, 0.75, 0.75, 0.75));
  EXPECT_THAT(shares(arm("", all, all, "1 0 0")), ElementsAre(1, 0, 0, 0));
  EXPECT_THAT(shares(arm(all, all, some, "0 0 1")), ElementsAre(0, 0, 0, 0.75));
  const std::string mixed =
      "<mujoco><worldbody><body name=\"arm\"><joint axis=\"0 1 0\"/><geom size=\"0.1\"/>"
      "<body name=\"tool\" gravcomp=\"1\"><geom size=\"0.1\" pos=\"0 0 1\"/></body></body>"
      "</worldbody></mujoco>";
  EXPECT_THAT(import(mixed).lost, ElementsAre(HasSubstr("<body> gravcomp")));
  EXPECT_THAT(shares(mixed), ElementsAre(1, 1));
}

/// A pendulum has the inertia m (l² + 0.4 r²) and armature, whatever the gear. MuJoCo 4.0.0 gave kv
/// of the chain, whose other joints are free.
TEST_F(RobotKinds, ADampingRatioIsThatOfTheInertiaThatMoves) {
  const auto damping = [&](const std::string& joint, const std::string& motor) {
    return scene(
               "<mujoco><compiler angle=\"radian\"/><worldbody>"
               "<body name=\"a\" euler=\"0.3 0 0\"><joint name=\"a\" axis=\"0 1 0\" "
               "armature=\"0.01\" ref=\"0.5\"/><geom size=\"0.05\" pos=\"0.1 0 0.2\"/>" +
               joint + "</body></worldbody><actuator>" + motor + "</actuator></mujoco>")
        .motors.at(0)
        .D;
  };
  const double mass = 1000 * 4 * M_PI / 3 * std::pow(0.05, 3);
  const double inertia = mass * (0.05 + 0.4 * 0.0025) + 0.01;
  EXPECT_NEAR(damping("", "<position joint=\"a\" kp=\"3\" dampratio=\"0.7\"/>"),
              1.4 * std::sqrt(3 * inertia), 1e-12);
  EXPECT_NEAR(damping("", "<position joint=\"a\" kp=\"3\" dampratio=\"0.7\" gear=\"-2\"/>"),
              1.4 * std::sqrt(12 * inertia), 1e-12);
  EXPECT_NEAR(damping("",
                      "<general joint=\"a\" biastype=\"affine\" gainprm=\"3\" "
                      "biasprm=\"0 -3 0.7\"/>"),
              1.4 * std::sqrt(3 * inertia), 1e-12);
  // A tendon with a length at rest adds no inertia.
  EXPECT_NEAR(damping("",
                      "<position joint=\"a\" kp=\"3\" dampratio=\"0.7\"/></actuator><tendon>"
                      "<fixed name=\"t\" stiffness=\"2\" springlength=\"0.1\"><joint joint=\"a\" "
                      "coef=\"1\"/></fixed></tendon><actuator>"),
              1.4 * std::sqrt(3 * inertia), 1e-12);
  const std::string chain =
      "<body pos=\"0.3 0 0.1\"><joint name=\"b\" type=\"slide\" axis=\"1 0 0\"/>"
      "<geom type=\"capsule\" size=\"0.03 0.1\" euler=\"0 1 0\"/><body pos=\"0 0 0.1\">"
      "<joint name=\"c\" axis=\"0 0 1\"/><geom pos=\"0.1 0.1 0\" size=\"0.04\"/></body></body>";
  for (const auto& [joint, gear, kv] : {std::tuple{"a", 1.0, 0.924723197554299},
                                        {"b", 2.0, 1.055962746398851},
                                        {"c", -2.0, 0.08355074914081963}})
    EXPECT_NEAR(damping(chain, fmt::format("<position joint=\"{}\" kp=\"3\" dampratio=\"0.7\" "
                                           "gear=\"{}\"/>",
                                           joint, gear)) /
                    (gear * gear),
                kv, 1e-12)
        << joint;
  const std::string both = "<position joint=\"j\" kv=\"1\" dampratio=\"1\"/>";
  EXPECT_THAT(fault_of(driven(both)), HasSubstr("both 'kv' and 'dampratio'"));
  const auto with_class = [&](const std::string& given, const std::string& own) {
    const std::string text = driven("<position joint=\"j\" " + own + "/>");
    return scene("<mujoco><default><position " + given + "/></default>" + text.substr(8))
        .motors.at(0)
        .D;
  };
  EXPECT_EQ(with_class("dampratio=\"1\"", "kv=\"2\""), 2);
  EXPECT_EQ(with_class("kv=\"2\"", "dampratio=\"1\""), with_class("dampratio=\"1\"", ""));
  EXPECT_THAT(import(driven("<position joint=\"j\" dampratio=\"1\"/>")).changed,
              Contains(AllOf(HasSubstr("dampratio"), HasSubstr("MuJoCo 4.0.0"))));
}

TEST_F(RobotKinds, AFreeJointHasNoLimitsOfItsClass) {
  const auto text = [](const std::string& joint) {
    return "<mujoco><default><joint limited=\"true\"/></default><worldbody><body name=\"b\">"
           "<joint name=\"j\" " +
           joint + "/><geom size=\"0.1\"/></body></worldbody></mujoco>";
  };
  const ImportedScene free = import(text("type=\"free\""));
  EXPECT_THAT(free.lost, IsEmpty());
  EXPECT_EQ(free.joints, 1U);
  EXPECT_THAT(fault_of(text("type=\"hinge\"")), HasSubstr("limited=\"true\" without a range"));
}

TEST_F(RobotKinds, AKeyframeOfAnAlignedBodyNeedsItsAxes) {
  const auto text = [](const std::string& geoms) {
    return "<mujoco><compiler alignfree=\"true\"/><worldbody><body name=\"b\">"
           "<freejoint name=\"j\"/>" +
           geoms + "</body></worldbody><keyframe><key qpos=\"0 0 1 1 0 0 0\"/></keyframe></mujoco>";
  };
  const std::string block = "<geom type=\"box\" size=\"0.05 0.02 0.01\" pos=\"0.1 0 0\"/>";
  EXPECT_THAT(scene(text(block), "0").initial.at(0).q, ElementsAre(-0.1, 0, 1, 1, 0, 0, 0));
  EXPECT_EQ(fault_of(text(block + block)), "");  // without the keyframe its frame is its own
  EXPECT_THAT(fault_of(text(block + block), "0"),
              AllOf(HasSubstr("the free joint 'j' is aligned with the inertia of its body"),
                    HasSubstr("or align=\"false\"")));
  const std::string child = "<body><joint/><geom size=\"0.1\"/></body>";  // then nothing is aligned
  EXPECT_THAT(fault_of(text(block + child), "0"), HasSubstr("qpos has 7 numbers"));
}

TEST_F(RobotKinds, MeshesNeedNoFile) {
  const auto text = [](const std::string& mesh) {
    return "<mujoco><asset><mesh name=\"m\" " + mesh +
           "/></asset><worldbody><body name=\"b\"><joint/><geom size=\"0.1\"/>"
           "<geom type=\"mesh\" mesh=\"m\"/></body></worldbody></mujoco>";
  };
  const std::string corners = "vertex=\"0 0 0 1 0 0 0 1 0 0 0 1\" ";
  const auto volume = [&](const std::string& mesh) {
    return volume_of(scene(text(mesh)).links.at(1).body.shape);
  };
  EXPECT_NEAR(volume(corners), 1.0 / 6, 1e-15);
  EXPECT_NEAR(volume(corners + "face=\"0 2 1 0 1 3 1 2 3 0 3 2\" scale=\"2 1 -1\""), 2.0 / 6,
              1e-15);
  EXPECT_THAT(fault_of(text(corners + "face=\"0 2 1 0 1 4\"")),
              HasSubstr("face has the vertex 4; expected one of 0 to 3"));
  EXPECT_THAT(fault_of(text("vertex=\"0 0\"")), HasSubstr("vertex has 2 numbers"));
  const ImportedScene made = import(text("builtin=\"sphere\" params=\"2\""));
  EXPECT_THAT(made.lost, ElementsAre(HasSubstr("<mesh> builtin: a shape made by MuJoCo")));
  EXPECT_EQ(made.links, 1U);
}

// --- URDF ---

std::string urdf(const std::string& more, const std::string& inside = "") {
  return "<robot name=\"r\">\n<link name=\"a\"/>\n"
         "<link name=\"b\"><inertial><mass value=\"1\"/>"
         "<inertia ixx=\"1\" iyy=\"1\" izz=\"1\"/></inertial>" +
         inside +
         "</link>\n"
         "<joint name=\"j\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/></joint>\n" +
         more + "</robot>\n";
}

TEST_F(RobotKinds, OfElementsGivenTwiceTheLastCounts) {
  const ImportedScene made = import(urdf(
      "", "\n<inertial><mass value=\"3\"/><inertia ixx=\"2\" iyy=\"2\" izz=\"2\"/></inertial>"));
  EXPECT_THAT(made.warnings, Contains(HasSubstr(":4: <inertial>: given twice, first in line 3; the "
                                                "last counts")));
  const Scene scene = parse_scene(made.text, "s.xml").scene;
  EXPECT_EQ(std::get<AbstractShape>(scene.links.at(1).body.shape).mass, 3);
}

TEST_F(RobotKinds, TheExtensionOfMujocoIsReadInUrdf) {
  write("meshes/t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n");
  const std::string mesh =
      "<collision><geometry><mesh filename=\"package://x/y/t.obj\"/></geometry></collision>";
  EXPECT_THAT(fault_of(urdf("", mesh)), HasSubstr("\"package://x/y/t.obj\" is not there"));
  const std::string settings =
      "<mujoco><compiler meshdir=\"meshes\" settotalmass=\"5\" strippath=\"true\"/>"
      "<option gravity=\"0 0 1\" timestep=\"0.01\"/></mujoco>";
  const ImportedScene made = import(urdf(settings, mesh));
  EXPECT_THAT(made.lost, IsEmpty());
  EXPECT_THAT(made.changed, Contains(HasSubstr("<compiler> settotalmass")));
  const Scene scene = parse_scene(made.text, folder_ / "scene.xml").scene;
  EXPECT_THAT(scene.gravity, ElementsAre(0, 0, 1));
  EXPECT_EQ(scene.timestep, 0.01);
  const Model model(scene);
  double mass = 0;
  for (int i = 0; i < int(scene.links.size()); ++i) mass += model.mass(i);
  EXPECT_NEAR(mass, 5, 1e-12);
  for (const char* lost : {"<compiler inertiafromgeom=\"true\"/>", "<compiler boundmass=\"2\"/>",
                           "<actuator><motor joint=\"j\"/></actuator>"})
    EXPECT_EQ(import(urdf("<mujoco>" + std::string(lost) + "</mujoco>")).lost.size(), 1U) << lost;
  EXPECT_THAT(fault_of(urdf("<mujoco><compiler meshdr=\"m\"/></mujoco>")),
              HasSubstr("unknown attribute 'meshdr'; did you mean 'meshdir'"));
}

TEST_F(RobotKinds, APointerOfGitLfsIsNamed) {
  const std::string pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\n";
  EXPECT_THAT(fault_of(pointer), HasSubstr("robot.xml:1: a pointer of Git LFS"));
  write("t.stl", pointer);
  EXPECT_THAT(fault_of(urdf("",
                            "<collision><geometry><mesh filename=\"t.stl\"/></geometry>"
                            "</collision>")),
              HasSubstr("t.stl:1: a pointer of Git LFS"));
}

/// A skin does not feel what the file keeps from touching its link: geoms without contact, and
/// links of an <exclude>, with all their shapes. Contacts leave out geoms without contact.
TEST_F(RobotKinds, GeomsThatTouchNothingHaveAMassAlone) {
  const std::string text =
      "<mujoco><worldbody><body name=\"palm\"><joint name=\"p\" type=\"slide\"/>"
      "<geom type=\"box\" size=\"0.02 0.02 0.02\"/>"
      "<body name=\"tip\" pos=\"0.1 0 0\"><joint name=\"t\"/>"
      "<geom type=\"box\" size=\"0.01 0.01 0.01\"/></body>"
      "<body name=\"thumb\" pos=\"0 0.1 0\"><joint name=\"h\"/>"
      "<geom type=\"box\" size=\"0.01 0.01 0.01\"/><geom type=\"sphere\" size=\"0.01\" pos=\"0 0 "
      "0.02\"/>"
      "</body>"
      "<body name=\"cover\" pos=\"0 0 0.1\"><joint name=\"c\"/>"
      "<geom type=\"box\" size=\"0.01 0.01 0.01\" contype=\"0\" conaffinity=\"0\"/></body>"
      "<body name=\"finger\" pos=\"0 0 0.2\"><joint name=\"f\"/>"
      "<geom type=\"box\" size=\"0.01 0.01 0.01\"/>"
      "<geom type=\"box\" size=\"0.03 0.01 0.01\" contype=\"0\" conaffinity=\"0\"/></body>"
      "</body></worldbody><contact><exclude body1=\"thumb\" body2=\"tip\"/></contact></mujoco>";
  std::ofstream(folder_ / "robot.xml") << text;
  const std::string layout =
      "<sensor unit=\"m-kg\"><tactile name=\"skin\" type=\"rect_array\" rect_pos0=\"-0.01 -0.01 "
      "0\" "
      "rect_pos1=\"0.01 0.01 0\" axis0=\"1 0 0\" axis1=\"0 1 0\" resolution=\"2 2\" "
      "kn=\"1\"/></sensor>";
  RobotOptions options;
  options.pads = {{"tip", "skin.xml", layout, {}, "+x"}};
  const ImportedScene made = import_robot(folder_ / "robot.xml", folder_ / "scene.xml", options);
  const Scene scene = parse_scene(made.text, folder_ / "scene.xml").scene;
  EXPECT_THAT(scene.sensors.at(0).ignores,
              ElementsAre("cover", "finger_shape", "thumb", "thumb_shape"));
  std::vector<std::string> felt;
  for (const int k : sensed_bodies(scene, scene.sensors[0]))
    felt.push_back(scene.links[std::size_t(k)].body.name);
  EXPECT_THAT(felt, ElementsAre("finger")) << "the palm is a neighbour";
  EXPECT_NEAR(Model(scene).mass(6), 8 * 3000 * 1e-6, 1e-12) << "a picture has a mass";
  options.touches = {{"thumb", "tip"}};
  EXPECT_THAT(import_robot(folder_ / "robot.xml", folder_ / "scene.xml", options).text,
              HasSubstr("ignores=\"cover,finger_shape\""))
      << "a requested contact is felt";
  const auto touched = [&](const std::string& link) {
    options.touches = {{"tip", link}};
    return parse_scene(import_robot(folder_ / "robot.xml", folder_ / "scene.xml", options).text,
                       folder_ / "scene.xml")
        .scene.pair_contacts.size();
  };
  EXPECT_EQ(touched("finger"), 2U) << "one pair of surfaces, with the points of both";
  EXPECT_THAT([&] { touched("cover"); },
              ::testing::ThrowsMessage<InputError>(
                  HasSubstr("no shape to touch with: its geoms have contype and conaffinity 0")));
}

/// Base `a` carries link `b`, whose mass at `centre` has no moments, on a joint of `type` along z.
std::string carried_point(const std::string& centre, const std::string& type) {
  return "<robot name=\"r\"><link name=\"a\"><inertial><mass value=\"2\"/></inertial></link>"
         "<link name=\"b\"><inertial><origin xyz=\"" +
         centre + "\"/><mass value=\"1\"/></inertial></link><joint name=\"j\" type=\"" + type +
         "\"><parent link=\"a\"/><child link=\"b\"/><axis xyz=\"0 0 1\"/>" +
         (type == "prismatic" ? "<limit lower=\"-1\" upper=\"1\"/>" : "") + "</joint></robot>";
}

/// A mass off the axis of its joint moves with it, so a point will do. One in a link that stands
/// moves nothing.
TEST_F(RobotKinds, AMassWithoutAnInertiaMayBeAPoint) {
  const ImportedScene off = import(carried_point("0.1 0 0.3", "continuous"));
  EXPECT_THAT(off.lost, IsEmpty());
  EXPECT_THAT(off.changed,
              Contains(HasSubstr("a mass without an inertia, which is a point on its link")));
  EXPECT_THAT(off.idle, Contains(HasSubstr("not positive, of a link that stands")));
  EXPECT_THAT(import(carried_point("0 0 0.3", "prismatic")).lost, IsEmpty());
  EXPECT_THAT(import(carried_point("0 0 0.3", "continuous")).lost,
              ElementsAre(HasSubstr("a mass without an inertia; it is that of a ball of water")));
  RobotOptions free;
  free.free_base = true;
  write("free.urdf", carried_point("0.1 0 0.3", "continuous"));
  EXPECT_THAT(import_robot(folder_ / "free.urdf", folder_ / "scene.xml", free).lost,
              ElementsAre(HasSubstr("it is that of a ball of water")));

  // A torque of 0.02 N m turns 0.01 kg m² at 2 rad/s²; the first step is BDF1's.
  Scene pendulum = scene(carried_point("0.1 0 0.3", "continuous"));
  pendulum.motors.push_back({"j", -0.02, 0.02, {}});
  const Model model(pendulum);
  Batch batch(model, 1);
  Stepper stepper(model);
  const double u = 1;
  stepper.step(batch, {&u, 1});
  double v = 0;
  batch.get_v(0, {&v, 1});
  EXPECT_NEAR(v, 2 * model.timestep(), 1e-12);
}

TEST_F(RobotKinds, MassesOfLinksThatStandAreIdle) {
  const auto base = [&](const std::string& inertial, bool moves) {
    write("base.urdf", "<robot name=\"r\"><link name=\"a\"><inertial>" + inertial +
                           "</inertial></link></robot>");
    RobotOptions options;
    options.free_base = moves;
    return import_robot(folder_ / "base.urdf", folder_ / "scene.xml", options);
  };
  const std::string none = "<mass value=\"0\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\"/>",
                    below = "<mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"-1\"/>";
  EXPECT_THAT(base(none, false).lost, IsEmpty());
  EXPECT_THAT(base(none, false).idle,
              Contains(HasSubstr("an inertia without a mass of a link that stands")));
  EXPECT_THAT(base(below, false).lost, IsEmpty());
  EXPECT_THAT(base(below, false).idle, Contains(HasSubstr("not positive")));
  EXPECT_THAT(base(below, true).lost, ElementsAre(HasSubstr("is below 0")));
  const ImportedScene mjcf = import(
      "<mujoco><worldbody><body name=\"a\"><inertial mass=\"1\" pos=\"0 0 0\" diaginertia=\"0 0 "
      "0\"/>"
      "<body name=\"b\"><joint name=\"j\"/><geom "
      "size=\"0.1\"/></body></body></worldbody></mujoco>");
  EXPECT_THAT(mjcf.lost, IsEmpty());
  EXPECT_THAT(mjcf.idle, Contains(HasSubstr("not positive, of a link that stands")));
}

/// Without a program that moves it, a mocap body of MuJoCo stands, also in a free base.
TEST_F(RobotKinds, BodiesThatAProgramMovesStand) {
  const std::string text =
      "<mujoco><worldbody><body name=\"ball\" pos=\"0 0 1\"><geom name=\"ball\" "
      "size=\"0.1\"/></body>"
      "<body name=\"hand\" mocap=\"true\" pos=\"0 1 2\"><geom name=\"hand\" size=\"0.1\"/></body>"
      "</worldbody><contact><pair geom1=\"ball\" geom2=\"hand\" friction=\"1 1 0.1 0.1 0.1\"/>"
      "</contact></mujoco>";
  write("robot.xml", text);
  RobotOptions free;
  free.free_base = true;
  const ImportedScene made = import_robot(folder_ / "robot.xml", folder_ / "scene.xml", free);
  EXPECT_THAT(made.lost, IsEmpty());
  EXPECT_THAT(made.changed, Contains(HasSubstr("<body> mocap: stands where the file has it")));
  EXPECT_THAT(made.changed, Contains(HasSubstr("<pair>: no contact, as of all that may touch")));
  const Scene scene = parse_scene(made.text, folder_ / "scene.xml").scene;
  ASSERT_EQ(scene.links.size(), 2);
  EXPECT_EQ(scene.links[0].joint.type, JointType::free);
  EXPECT_EQ(scene.links[1].joint.type, JointType::fixed);
  EXPECT_EQ(scene.links[1].joint.pose.position, (Vector3{0, 1, 2}));
}

}  // namespace
}  // namespace tangere
