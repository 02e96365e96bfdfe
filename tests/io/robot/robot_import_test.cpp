// SPDX-License-Identifier: Apache-2.0
// What import says about robots that it cannot take over whole, and what it writes.
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "engine/scene/outer_pose.hpp"
#include "io/robot/robot_import.hpp"
#include "io/robot/rotations.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/files.hpp"
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

const std::string kRobots = TANGERE_TEST_DATA "/robots/";

ImportedScene import(const std::string& text, const RobotOptions& options = {}) {
  const testing::Folder folder;
  const std::string path = folder / "robot.xml";
  std::ofstream(path) << text;
  return import_robot(path, folder / "scene.xml", options);
}

std::string fault_of(const std::string& text, const RobotOptions& options = {}) {
  try {
    import(text, options);
  } catch (const InputError& error) {
    const std::string what = error.what();
    return what.substr(what.find("robot.xml"));
  }
  return "";
}

/// A robot of one link that turns, with `more` inside <robot> from line 5 on.
std::string urdf(const std::string& more) {
  return "<robot name=\"r\">\n"
         "<link name=\"a\"/>\n"
         "<link name=\"b\"><inertial><mass value=\"1\"/>"
         "<inertia ixx=\"1\" iyy=\"1\" izz=\"1\"/></inertial></link>\n"
         "<joint name=\"j\" type=\"continuous\"><parent link=\"a\"/><child link=\"b\"/></joint>\n" +
         more + "</robot>\n";
}
/// A model of one body that turns, with `more` inside it from line 2 on.
std::string mjcf(const std::string& more, const std::string& after = "") {
  return "<mujoco><worldbody><body name=\"b\">\n" + more + "</body></worldbody>\n" + after +
         "</mujoco>\n";
}
const std::string kBall = "<joint name=\"j\"/><geom size=\"0.1\"/>\n";

TEST(RobotImport, UrdfMistakesNameTheLine) {
  EXPECT_EQ(fault_of(urdf("")), "");
  EXPECT_THAT(fault_of(urdf("<lnk/>")),
              HasSubstr("robot.xml:5: <lnk>: unknown element inside <robot>; did you mean 'link'"));
  EXPECT_THAT(fault_of(urdf("<link name=\"a\"/>")), HasSubstr(":5: <link>: link name 'a' is used"));
  EXPECT_THAT(fault_of(urdf("<link name=\"c\"/>")), HasSubstr("expected one root"));
  const auto joint = [](const std::string& type, const std::string& inside) {
    return urdf("<link name=\"c\"/>\n<joint name=\"k\" type=\"" + type +
                "\"><parent link=\"b\"/><child link=\"c\"/>" + inside + "</joint>");
  };
  EXPECT_EQ(fault_of(joint("fixed", "")), "");
  EXPECT_THAT(fault_of(joint("revolt", "")),
              HasSubstr(":6: <joint>: type=\"revolt\" is not known"));
  EXPECT_THAT(fault_of(joint("revolute", "")), HasSubstr("has no <limit>"));
  EXPECT_THAT(fault_of(joint("fixed", "<origin xyz=\"0 0\"/>")),
              HasSubstr(":6: <origin>: xyz=\"0 0\" has 2 numbers; expected 3"));
  EXPECT_THAT(fault_of(joint("continuous", "<axis xyz=\"0 0 0\"/>")), HasSubstr("no direction"));
  EXPECT_THAT(fault_of(urdf("<joint name=\"k\" type=\"fixed\"><parent link=\"a\"/>"
                            "<child link=\"bb\"/></joint>")),
              HasSubstr("no link is named 'bb'; did you mean 'b'"));
  EXPECT_THAT(fault_of(urdf("<link name=\"c\"/><link name=\"d\"/>\n"
                            "<joint name=\"k\" type=\"fixed\"><parent link=\"c\"/>"
                            "<child link=\"d\"/></joint>\n"
                            "<joint name=\"l\" type=\"fixed\"><parent link=\"d\"/>"
                            "<child link=\"c\"/></joint>")),
              HasSubstr(":6: <joint>: joint 'k' is part of a ring"));
  EXPECT_THAT(fault_of(urdf("<link name=\"c\"><inertial><mass value=\"-1\"/></inertial></link>"
                            "<joint name=\"k\" type=\"fixed\"><parent link=\"a\"/>"
                            "<child link=\"c\"/></joint>")),
              HasSubstr(":5: <inertial>: mass -1 kg; expected 0 or more"));
  EXPECT_THAT(fault_of(urdf("<xacro:macro/>")), HasSubstr("a macro of xacro"));
  const std::string mesh = "<link name=\"c\"><collision><geometry>\n<mesh filename=\"";
  EXPECT_THAT(fault_of(urdf(mesh + "none.obj\"/></geometry></collision></link>"
                                   "<joint name=\"k\" type=\"fixed\"><parent link=\"a\"/>"
                                   "<child link=\"c\"/></joint>")),
              HasSubstr("robot.xml:6: <mesh>: the file \"none.obj\" is not there; looked for"));
}

TEST(RobotImport, MjcfMistakesNameTheLine) {
  EXPECT_EQ(fault_of(mjcf(kBall)), "");
  EXPECT_THAT(fault_of(mjcf("<joint name=\"j\" rang=\"0 1\"/>" + kBall)),
              HasSubstr("robot.xml:2: <joint>: unknown attribute 'rang'; did you mean 'range'"));
  EXPECT_THAT(fault_of(mjcf(kBall, "<default><geom rgb=\"1 0 0 1\"/></default>")),
              HasSubstr(":4: <geom>: unknown attribute 'rgb'"));
  EXPECT_THAT(fault_of(mjcf("<geom class=\"smal\" size=\"1\"/>",
                            "<default><default class=\"small\"/></default>")),
              HasSubstr("class=\"smal\": no default has this class; did you mean 'small'"));
  EXPECT_THAT(fault_of(mjcf("<geom type=\"box\" size=\"1 1\"/>")),
              HasSubstr("size has 2 numbers; expected 3"));
  EXPECT_THAT(fault_of(mjcf(kBall + "<freejoint/>")), HasSubstr("a free joint"));
  EXPECT_THAT(fault_of(mjcf(kBall, "<actuator><motor joint=\"k\"/></actuator>")),
              HasSubstr(":4: <motor>: joint=\"k\": no joint has this name; did you mean 'j'"));
  EXPECT_THAT(fault_of(mjcf("<geom type=\"mesh\" mesh=\"m\"/>")),
              HasSubstr("mesh=\"m\": no mesh has this name"));
  EXPECT_THAT(fault_of(mjcf("<joint/><geom size=\"0.1\" quat=\"1 0 0 0\" euler=\"0 0 0\"/>")),
              HasSubstr("both 'quat' and 'euler'"));
  EXPECT_THAT(fault_of("<tangere/>"), HasSubstr("This is a scene already"));
}

/// Three files: defaults and an asset folder, a finger that hangs on a body of the main file, and
/// the main file.
ImportedScene import_parts(const testing::Folder& folder, const std::string& finger) {
  std::filesystem::create_directory(folder / "parts");
  std::ofstream(folder / "parts/common.xml")
      << "<mujocoinclude>\n<default><geom rgba=\"0.1 0.2 0.3 1\"/>\n"
         "<default class=\"stiff\"><joint damping=\"7\"/></default></default>\n"
         "</mujocoinclude>\n";
  std::ofstream(folder / "parts/finger.xml") << finger;
  std::ofstream(folder / "robot.xml")
      << "<mujoco>\n<include file=\"parts/common.xml\"/>\n<worldbody><body name=\"palm\">\n"
         "<geom size=\"0.1\"/>\n<include "
         "file=\"parts/finger.xml\"/>\n</body></worldbody></mujoco>\n";
  return import_robot(folder / "robot.xml", folder / "scene.xml", {});
}
const std::string kFingerPart =
    "<mujoco>\n<body name=\"finger\" pos=\"0 0 0.2\">\n<site/>\n"
    "<joint name=\"j\" class=\"stiff\"/>\n<geom size=\"0.05\"/></body></mujoco>\n";

TEST(RobotImport, MjcfFilesStandWhereTheyAreIncluded) {
  const testing::Folder folder;
  const ImportedScene out = import_parts(folder, kFingerPart);
  EXPECT_EQ(out.links, 2);
  EXPECT_THAT(out.text, HasSubstr("line 2 of finger.xml: <body>"));
  EXPECT_THAT(out.text, HasSubstr("<!-- line 3: <body>"));
  EXPECT_THAT(out.text, HasSubstr("damping=\"7\""));
  EXPECT_THAT(out.text, HasSubstr("rgba=\"0.1 0.2 0.3 1\""));
  EXPECT_THAT(out.idle, Contains(HasSubstr("finger.xml: <site>")));
}

TEST(RobotImport, MistakesOfIncludedMjcfFilesNameTheirFileAndLine) {
  const auto fault = [](const std::string& finger) -> std::string {
    const testing::Folder folder;
    try {
      import_parts(folder, finger);
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_EQ(fault(kFingerPart), "");
  EXPECT_THAT(fault("<mujoco>\n<body name=\"palm\"/></mujoco>"),
              HasSubstr("parts/finger.xml:2: <body>: body name 'palm' is used twice, first in "
                        "line 3"));
  EXPECT_THAT(fault("<mujoco>\n\n<boddy/></mujoco>"), HasSubstr("parts/finger.xml:3: <boddy>"));
  EXPECT_THAT(fault("<mujoco>\n<body"), HasSubstr("parts/finger.xml:2"));
  EXPECT_THAT(fault("<robot/>"), HasSubstr("finger.xml:1: <robot>: no part of a MJCF file"));
  for (const char* again : {"parts/common.xml", "parts/finger.xml", "robot.xml"})
    EXPECT_THAT(fault("<mujoco>\n<include file=\"" + std::string(again) + "\"/></mujoco>"),
                HasSubstr("parts/finger.xml:2: <include>: "))
        << again;
  EXPECT_THAT(fault("<mujoco><include file=\"none.xml\"/></mujoco>"),
              HasSubstr("parts/finger.xml:1: <include>: "));
  EXPECT_THAT(fault("<mujoco><include/></mujoco>"), HasSubstr("parts/finger.xml:1: <include>"));
}

TEST(RobotImport, ListsWhatChangesTheMotion) {
  const ImportedScene arm = import_robot(kRobots + "arm.xml", kRobots + "scene.xml");
  const std::string file = kRobots + "arm.xml: ";
  EXPECT_THAT(arm.lost,
              ElementsAre(file + "<muscle>: an actuator that scenes do not have (line 27)"));
  EXPECT_THAT(arm.idle, Contains(HasSubstr("<geom> friction: coefficients of MuJoCo's contacts")));
  EXPECT_THAT(arm.idle, Contains(HasSubstr("<key>: stored states")));
  EXPECT_THAT(arm.text, HasSubstr("Left out, and the motion differs by it:"));
  const ImportedScene gripper = import_robot(kRobots + "gripper.urdf", kRobots + "scene.xml");
  EXPECT_THAT(gripper.lost, IsEmpty());
}

/// A link on a joint of its own, with `inertial` inside.
ImportedScene import_link(const std::string& inertial, const std::string& joint = "") {
  return import(urdf("<link name=\"c\">\n" + inertial +
                     "</link>\n<joint name=\"k\" type=\"prismatic\"><parent link=\"b\"/>"
                     "<child link=\"c\"/><limit lower=\"1\" upper=\"-1\"/>" +
                     joint + "</joint>"));
}
std::array<double, 6> inertia_of(const ImportedScene& scene) {
  return std::get<AbstractShape>(parse_scene(scene.text, "scene.xml").scene.links[2].body.shape)
      .inertia;
}

TEST(RobotImport, InertiasThatNoSolidHasAreMendedAndListed) {
  const auto inertial = [](const std::string& numbers) {
    return import_link("<inertial><mass value=\"1\"/><inertia " + numbers + "/></inertial>");
  };
  EXPECT_THAT(inertial("ixx=\"1\" iyy=\"1\" izz=\"1.9\"").lost, IsEmpty());
  const ImportedScene odd = inertial("ixx=\"1\" iyy=\"1\" izz=\"5\"");
  EXPECT_THAT(odd.lost, IsEmpty());
  EXPECT_THAT(odd.changed, Contains(HasSubstr("<inertial>: no solid has this inertia")));
  EXPECT_EQ(inertia_of(odd)[0], 1);
  EXPECT_EQ(inertia_of(odd)[5], 5);
  const ImportedScene bad = inertial("ixx=\"1\" iyy=\"1\" izz=\"-1\"");
  EXPECT_THAT(bad.lost, ElementsAre(HasSubstr("a principal moment of the inertia is below 0")));
  // -1 + x + 1 + x = 1 + x
  EXPECT_NEAR(inertia_of(bad)[0], 2, 1e-4);
  EXPECT_NEAR(inertia_of(bad)[5], 0, 1e-4);
  const ImportedScene rod = inertial("ixx=\"1\" iyy=\"1\" izz=\"-8e-28\"");
  EXPECT_THAT(rod.lost, IsEmpty());
  EXPECT_THAT(rod.changed, Contains(HasSubstr("the inertia of a thin rod")));
  EXPECT_NEAR(inertia_of(rod)[5], 0, 1e-4);
  // Rank one: all numbers are alike.
  const ImportedScene flat =
      inertial("ixx=\"1\" ixy=\"1\" ixz=\"1\" iyy=\"1\" iyz=\"1\" izz=\"1\"");
  EXPECT_THAT(flat.lost, IsEmpty());
  EXPECT_THAT(flat.changed, Contains(HasSubstr("the inertia of a thin rod")));
  EXPECT_EQ(inertia_of(flat)[1], 1);
  EXPECT_NEAR(inertia_of(flat)[0], 1, 2e-5);
  EXPECT_GT(inertia_of(flat)[0], 1);
  const ImportedScene point = import_link("<inertial><mass value=\"4\"/></inertial>");
  EXPECT_THAT(point.lost, IsEmpty());  // it slides
  EXPECT_THAT(point.changed, Contains(HasSubstr("a mass without an inertia, which is a point")));
  EXPECT_EQ(inertia_of(point)[0], 0);
  const ImportedScene none = import_link(
      "<inertial><mass value=\"0\"/><inertia ixx=\"1\" iyy=\"1\" "
      "izz=\"1\"/></inertial>");
  EXPECT_THAT(none.lost, ElementsAre(HasSubstr("an inertia without a mass"),
                                     HasSubstr("joint 'k' moves nothing that has a mass: it is "
                                               "held (line 7)")));
  EXPECT_EQ(none.joints, 1);
}

TEST(RobotImport, WordsOfOtherSoftwareHaveNoEffect) {
  const ImportedScene made = import_link(
      "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\"/></inertial>"
      "<gravity/><drake:proximity x=\"1\"/>",
      "<joint_properties/><dynamics D=\"1\" K=\"2\" drake:rotor=\"3\"/>");
  EXPECT_THAT(made.lost, IsEmpty());
  EXPECT_THAT(made.idle, Contains(HasSubstr("<drake:proximity>: a setting of other software")));
  EXPECT_THAT(made.idle, Contains(HasSubstr("<dynamics> drake:rotor: a setting of other")));
  EXPECT_THAT(made.changed, Contains(HasSubstr("<limit> lower above upper")));
  EXPECT_THAT(fault_of(urdf("<link name=\"c\" drake=\"1\"/>")), HasSubstr("unknown attribute"));
}

TEST(RobotImport, FlagsOfMujocoAreObeyed) {
  const auto made = [](const std::string& flags) {
    return import("<mujoco><option><flag " + flags +
                  "/></option><worldbody><body><joint range=\"-9 9\" stiffness=\"2\" "
                  "damping=\"3\"/><geom size=\"0.1\"/></body></worldbody></mujoco>");
  };
  EXPECT_THAT(made("gravity=\"enable\"").text,
              AllOf(HasSubstr("-9.81"), HasSubstr("lim="), HasSubstr("stiffness=\"2\""),
                    HasSubstr("damping=\"3\"")));
  EXPECT_THAT(made("gravity=\"disable\"").text, HasSubstr("gravity=\"0 0 0\""));
  EXPECT_THAT(made("constraint=\"disable\"").text, Not(HasSubstr("lim=")));
  EXPECT_THAT(made("limit=\"disable\"").text, Not(HasSubstr("lim=")));
  const std::string passive = made("passive=\"disable\"").text;
  EXPECT_THAT(passive, Not(HasSubstr("stiffness=\"2\"")));
  EXPECT_THAT(passive, Not(HasSubstr("damping=\"3\"")));
  EXPECT_THAT(made("contact=\"disable\"").lost, IsEmpty());
  EXPECT_THAT(made("actuation=\"disable\"").lost, ElementsAre(HasSubstr("switches forces")));
}

TEST(RobotImport, MeshesAreReadWhereAGeomNeedsThem) {
  const std::string path = kRobots + "meshes/";
  const auto made = [&](const std::string& geom, const std::string& file) {
    return import("<mujoco><asset><mesh name=\"m\" file=\"" + file +
                  "\"/></asset><worldbody><body>" + kBall + geom + "</body></worldbody></mujoco>");
  };
  const std::string picture = "<geom type=\"mesh\" mesh=\"m\" contype=\"0\" conaffinity=\"0\"";
  EXPECT_EQ(made(picture + " mass=\"0\"/>", "none.obj").links, 1);
  EXPECT_THROW(made(picture + " mass=\"1\"/>", "none.obj"), InputError);
  const std::string geom = "<geom type=\"mesh\" mesh=\"m\"/>";
  const ImportedScene open = made(geom, path + "cup.obj");
  EXPECT_THAT(open.text, HasSubstr("cup.obj\" hull=\"true\" mass=\"0\""));
  EXPECT_THAT(open.changed, Contains(HasSubstr("its convex hull takes its place")));
  EXPECT_THAT(open.lost, IsEmpty());
  const testing::Folder folder;
  std::ofstream(folder / "flat.obj") << "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
  EXPECT_THAT(made(geom, folder / "flat.obj").lost, ElementsAre(HasSubstr("the flat surface of")));
  std::ofstream(folder / "mesh.msh") << "1";
  EXPECT_THAT(made(geom, folder / "mesh.msh").lost,
              ElementsAre(HasSubstr("no OBJ, STL, PLY or DAE")));
  const ImportedScene box = import_robot(kRobots + "dae_box.urdf", "scene.xml", {});
  EXPECT_THAT(box.lost, IsEmpty());
  EXPECT_THAT(box.text, HasSubstr("box.dae\""));
}

TEST(RobotImport, PackagesAreFoldersAboveTheRobot) {
  const testing::Folder folder;
  std::filesystem::create_directories(folder / "pack/urdf");
  std::filesystem::copy_file(kRobots + "meshes/cup.obj", folder / "pack/cup.obj");
  const auto imported = [&](const std::string& mesh) {
    std::ofstream(folder / "pack/urdf/robot.urdf")
        << urdf("<link name=\"c\"><collision><geometry><mesh filename=\"" + mesh +
                "\"/></geometry></collision></link><joint name=\"k\" type=\"fixed\"><parent "
                "link=\"b\"/><child link=\"c\"/></joint>");
    return import_robot(folder / "pack/urdf/robot.urdf", folder / "scene.xml", {}).text;
  };
  for (const char* prefix : {"package://", "package:///"})
    EXPECT_THAT(imported(prefix + std::string("pack/cup.obj")),
                HasSubstr("filename=\"pack/cup.obj\" hull=\"true\""));
  EXPECT_THROW(imported("package://"), InputError);
  EXPECT_THROW(imported("package://pock/cup.obj"), InputError);
}

TEST(RobotImport, AddsSkinsMotorsAndContacts) {
  RobotOptions options;
  options.pads = {{"left_finger",
                   "grid_16x16_guess",
                   file_bytes(TANGERE_SOURCE_DIR "/scenes/sensors/grid_16x16_guess.xml"),
                   {},
                   "-y"}};
  options.motors = {{"left_slide", 400.0, 20.0}, {"right_slide"}};
  options.touches = {{"left_finger", "right_finger"}, {"left_finger", "ground"}};
  const ImportedScene made = import_robot(kRobots + "gripper.urdf", kRobots + "scene.xml", options);
  const Scene scene = parse_scene(made.text, kRobots + "scene.xml").scene;
  ASSERT_EQ(scene.sensors.size(), 1U);
  EXPECT_EQ(scene.sensors[0].body, "left_finger");
  EXPECT_EQ(scene.sensors[0].name, "left_finger_taxels");
  // Row 0 on top, column 0 on the left as seen from outside, on the face y = -6 mm.
  const RectArray& array = scene.sensors[0].array;
  EXPECT_THAT(array.corner0, ElementsAre(::testing::DoubleNear(-0.0075, 1e-15),
                                         ::testing::DoubleNear(-0.006, 1e-15),
                                         ::testing::DoubleNear(0.0075, 1e-15)));
  ASSERT_EQ(scene.motors.size(), 2U);
  EXPECT_EQ(scene.motors[0].P, 400);
  EXPECT_EQ(scene.motors[0].high, 40);
  EXPECT_EQ(scene.motors[1].control, MotorControl::force);
  // Fingers with faces touch each other with the points of both.
  ASSERT_EQ(scene.pair_contacts.size(), 3U);
  EXPECT_TRUE(scene.pair_contacts[1].second_half);
  EXPECT_TRUE(scene.pair_contacts[2].on_ground);
  EXPECT_GT(scene.pair_contacts[0].coefficients[0], 0);
  ASSERT_TRUE(scene.links[2].joint.limits.has_value());
  EXPECT_EQ(scene.links[2].joint.limit_stiffness, 40 / 1e-3);  // the effort, a millimetre deep
  options.motors = {{"left_slid"}};
  EXPECT_THROW(import_robot(kRobots + "gripper.urdf", kRobots + "scene.xml", options), InputError);
}

/// Constraints between joints, whose coordinates are less ref in both.
TEST(RobotImport, JointEqualitiesAreKept) {
  const auto made = [](const std::string& equality, const std::string& flag = "enable") {
    const std::string text =
        "<mujoco><compiler angle=\"radian\"/><option><flag equality=\"" + flag +
        "\"/></option><worldbody><body name=\"a\"><joint name=\"one\" ref=\"0.2\"/><geom "
        "size=\"0.1\"/></body><body name=\"b\"><joint name=\"two\"/><geom size=\"0.1\"/></body>"
        "</worldbody><equality><joint joint1=\"one\" joint2=\"two\" " +
        equality + "/></equality></mujoco>";
    const testing::Folder folder;
    std::ofstream(folder / "robot.xml") << text;
    return import_robot(folder / "robot.xml", folder / "scene.xml", {});
  };
  const ImportedScene plain = made("polycoef=\"0.1 -2 0 0 0\"");
  EXPECT_THAT(plain.lost, IsEmpty());
  EXPECT_THAT(plain.text, HasSubstr("follows=\"two\" ratio=\"-2\" offset=\"0.1\""));
  EXPECT_THAT(made("").text, HasSubstr("follows=\"two\" ratio=\"1\" offset=\"0\""));
  for (const auto& [equality, flag] :
       {std::pair{"active=\"false\"", "enable"}, {"polycoef=\"0 1 0 0 0\"", "disable"}})
    EXPECT_THAT(made(equality, flag).text, Not(HasSubstr("follows"))) << equality;
  const ImportedScene curved = made("polycoef=\"0.1 0 0.5 0 -2\"");
  EXPECT_THAT(curved.lost, IsEmpty());
  EXPECT_THAT(curved.text,
              HasSubstr("follows=\"two\" ratio=\"0\" offset=\"0.1\" powers=\"0.5 0 -2\""));
  EXPECT_THAT(made("polycoef=\"0 1 0.5 0 0\"").text, HasSubstr("powers=\"0.5\""));
}

/// Chains that scenes do not have are listed with both names, and the rest is read.
TEST(RobotImport, PolynomialsOfPolynomialsAreListed) {
  const auto made = [](const std::string& equalities) {
    const testing::Folder folder;
    std::ofstream(folder / "robot.xml")
        << "<mujoco><worldbody><body><joint name=\"one\"/><geom size=\"0.1\"/></body><body>"
           "<joint name=\"two\"/><geom size=\"0.1\"/></body><body><joint name=\"three\"/>"
           "<geom size=\"0.1\"/></body></worldbody><equality><joint joint1=\"two\" "
           "joint2=\"one\" polycoef=\"0 1 1 0 0\"/>"
        << equalities << "</mujoco>";
    return import_robot(folder / "robot.xml", folder / "scene.xml", {});
  };
  const ImportedScene twice =
      made("<joint joint1=\"three\" joint2=\"two\" polycoef=\"0 1 0 1 0\"/></equality>");
  EXPECT_THAT(twice.lost, ElementsAre(HasSubstr("joint 'three' follows 'two', by a polynomial of "
                                                "a polynomial")));
  EXPECT_THAT(twice.text, HasSubstr("follows=\"one\" ratio=\"1\" offset=\"0\" powers=\"1\""));
  EXPECT_THAT(twice.text, Not(HasSubstr("follows=\"two\"")));
  const ImportedScene tendon = made(
      "</equality><tendon><fixed name=\"t\"><joint joint=\"two\" coef=\"2\"/><joint "
      "joint=\"three\" coef=\"1\"/></fixed></tendon>");
  EXPECT_THAT(tendon.lost, ElementsAre(HasSubstr("joint 'two' follows 'one', by a polynomial, and "
                                                 "'t' follows it with others")));
  EXPECT_THAT(tendon.text, HasSubstr("follows=\"two three\" ratio=\"2 1\""));
}

/// A leader may have a blank in its name.
TEST(RobotImport, LeadersMayHaveBlanks) {
  const testing::Folder folder;
  std::ofstream(folder / "robot.xml")
      << "<mujoco><worldbody><body><joint name=\"left finger\"/><geom size=\"0.1\"/></body><body>"
         "<joint name=\"two\"/><geom size=\"0.1\"/></body></worldbody><equality>"
         "<joint joint1=\"two\" joint2=\"left finger\"/></equality><tendon><fixed name=\"t\">"
         "<joint joint=\"left finger\" coef=\"2\"/><joint joint=\"two\" "
         "coef=\"3\"/></fixed></tendon>"
         "</mujoco>";
  const ImportedScene made = import_robot(folder / "robot.xml", folder / "scene.xml", {});
  EXPECT_THAT(made.lost, IsEmpty());
  EXPECT_THAT(made.text, HasSubstr("follows=\"left finger,\""));
  const Scene scene = parse_scene(made.text, "scene.xml").scene;
  EXPECT_THAT(scene.links[1].joint.follows, ElementsAre("left finger"));
  EXPECT_THAT(scene.links[2].joint.follows, ElementsAre("left finger", "two"));
}

/// Loops that scenes cannot have, that hold nothing, or that are not on.
TEST(RobotImport, LoopsAreKeptWhereTheyHoldSomething) {
  const auto made = [](const std::string& equality) {
    const testing::Folder folder;
    std::ofstream(folder / "robot.xml")
        << "<mujoco><default><equality solref=\"0.01 1\"/></default><worldbody>"
           "<body name=\"a\" pos=\"0.1 0 0\"><joint axis=\"0 1 0\" pos=\"0 0 0.2\"/>"
           "<geom size=\"0.1\" pos=\"0 0.3 0\"/><site name=\"s\" pos=\"0 0 1\"/>"
           "<body name=\"tip\"><geom size=\"0.1\"/></body></body>"
           "<body name=\"b\" pos=\"0.5 0 0\" euler=\"0 0 90\"><joint axis=\"0 1 0\"/>"
           "<geom size=\"0.1\"/><site name=\"t\"/></body></worldbody><equality>" +
               equality + "</equality></mujoco>";
    return import_robot(folder / "robot.xml", folder / "scene.xml", {});
  };
  const auto loop = [&](const std::string& equality) {
    const ImportedScene imported = made(equality);
    EXPECT_THAT(imported.lost, IsEmpty()) << equality;
    const Scene scene = parse_scene(imported.text, "scene.xml").scene;
    return scene.loops.at(0);
  };
  // The body's own frame is the geom's.
  const LoopDescription pin = loop("<connect body1=\"a\" body2=\"b\" anchor=\"0.1 0 0.4\"/>");
  EXPECT_THAT(pin.position1,
              ElementsAre(DoubleNear(0.1, 1e-15), DoubleNear(-0.3, 1e-15), DoubleNear(0.4, 1e-15)));
  // 0.2 0 0.4 in the world is -0.3 0 0.4 from b, whose x is the world's y.
  EXPECT_THAT(*pin.position2,
              ElementsAre(DoubleNear(0, 1e-15), DoubleNear(0.3, 1e-15), DoubleNear(0.4, 1e-15)));
  EXPECT_GT(pin.stiffness, 1e4);
  EXPECT_EQ(pin.damping, 0);
  const LoopDescription sites = loop("<connect name=\"n\" site1=\"s\" site2=\"t\"/>");
  EXPECT_EQ(sites.name, "n");
  EXPECT_THAT(sites.position1, ElementsAre(0, DoubleNear(-0.3, 1e-15), DoubleNear(1, 1e-15)));
  EXPECT_THAT(*sites.position2, ElementsAre(0, 0, 0));
  const LoopDescription world = loop("<weld body1=\"b\"/>");
  EXPECT_EQ(world.body2, "");
  EXPECT_TRUE(world.weld);
  EXPECT_THAT(world.position1, ElementsAre(DoubleNear(0, 1e-15), DoubleNear(0.5, 1e-15), 0));
  EXPECT_THAT(*world.position2, ElementsAre(0, 0, 0));
  EXPECT_NEAR(std::abs((*world.orientation2)[3]), std::sqrt(0.5), 1e-12);
  const LoopDescription posed =
      loop("<weld body1=\"a\" body2=\"b\" relpose=\"0 0 1 1 0 0 0\" anchor=\"0 0 2\"/>");
  EXPECT_THAT(posed.position1, ElementsAre(0, DoubleNear(-0.3, 1e-15), DoubleNear(3, 1e-15)));
  EXPECT_THAT(*posed.position2, ElementsAre(0, 0, 2));
  EXPECT_NEAR(std::abs((*posed.orientation2)[0]), 1, 1e-12);
  EXPECT_FALSE(loop("<weld body1=\"a\" body2=\"b\" torquescale=\"0\"/>").weld);
  for (const char* none : {"<connect body1=\"a\" body2=\"b\" anchor=\"0 0 0\" active=\"false\"/>",
                           "<weld body1=\"a\" body2=\"tip\"/>"}) {
    const ImportedScene imported = made(none);
    EXPECT_THAT(imported.lost, IsEmpty()) << none;
    EXPECT_THAT(imported.text, Not(HasSubstr("<loop>"))) << none;
  }
  EXPECT_THROW(made("<connect body1=\"a\" body2=\"nobody\" anchor=\"0 0 0\"/>"), InputError);
  EXPECT_THAT(made("<connect site1=\"s\" site2=\"nowhere\"/>").lost,
              ElementsAre(HasSubstr("no site of a body")));
}

TEST(RobotImport, AKeyframeIsTheStart) {
  RobotOptions options;
  options.keyframe = "0";
  // Of four actuators the first three are read: of a tendon and of joints.
  const std::string arm = file_bytes(kRobots + "arm.xml");
  const auto with_key = [&](const std::string& key) {
    std::string text = arm;
    const std::string old = "<key qpos=\"0.1 0.2\"/>";
    return text.replace(text.find(old), old.size(), key);
  };
  const Scene scene =
      parse_scene(
          import(with_key("<key qpos=\"0.1 0.2\" qvel=\"0 -3\" ctrl=\"5 0.6 7 8\"/>"), options)
              .text,
          "scene.xml")
          .scene;
  ASSERT_EQ(scene.initial.size(), 2U);
  EXPECT_THAT(scene.initial[0].q, ElementsAre(0.1));
  EXPECT_THAT(scene.initial[0].v, IsEmpty());
  EXPECT_THAT(scene.initial[1].q, ElementsAre(0.2));
  EXPECT_THAT(scene.initial[1].v, ElementsAre(-3.0));
  EXPECT_THAT(std::get<ConstantControl>(scene.control.value()).values, ElementsAre(5, 0.6, 7));
  // A motor of our own holds its joint where it starts.
  options.motors = {{"wrist", 4.0, 1.0}};
  EXPECT_THAT(std::get<ConstantControl>(
                  parse_scene(import(arm, options).text, "scene.xml").scene.control.value())
                  .values,
              ElementsAre(0.0, 0.0, 0.0, 0.2));
  EXPECT_THAT(std::get<ConstantControl>(
                  parse_scene(import(mjcf("<joint name=\"wrist\"/><geom size=\"0.1\"/>",
                                          "<keyframe><key qpos=\"0.3\"/></keyframe>"),
                                     options)
                                  .text,
                              "scene.xml")
                      .scene.control.value())
                  .values,
              ElementsAre(0.3));
  options.motors.clear();
  EXPECT_THAT(
      fault_of(with_key("<key qpos=\"0.1\"/>"), options),
      HasSubstr("robot.xml:30: <key>: qpos has 1 numbers; the joints that are read have 2"));
  EXPECT_THAT(fault_of(with_key("<key ctrl=\"0.1\"/>"), options),
              HasSubstr(":30: <key>: ctrl has 1 numbers; the actuators have 4"));
  EXPECT_THAT(fault_of(with_key("<key qpso=\"0.1\"/>"), options), HasSubstr("did you mean 'qpos'"));
  options.keyframe = "hom";
  EXPECT_THAT(fault_of(with_key("<key name=\"home\"/>"), options),
              HasSubstr("has no keyframe of this name; did you mean 'home'"));
  EXPECT_THROW(import(urdf(""), options), InputError);
}

TEST(RobotImport, SitesAreNamedPlaces) {
  const std::string text = mjcf(
      "<joint name=\"j\" pos=\"0 0 1\"/><geom size=\"0.1\"/>\n"
      "<site name=\"tip\" pos=\"0 0.5 0\" euler=\"0 0 90\"/>\n"
      "<site name=\"other\"/>");
  RobotOptions options;
  options.end_effectors = {"tip", "b"};
  options.pads = {{"tip",
                   "grid_16x16_guess",
                   file_bytes(TANGERE_SOURCE_DIR "/scenes/sensors/grid_16x16_guess.xml"),
                   {{0.1, 0, 0}, {1, 0, 0, 0}},
                   ""}};
  const ImportedScene made = import(text, options);
  const Scene scene = parse_scene(made.text, "scene.xml").scene;
  ASSERT_EQ(scene.end_effectors.size(), 2U);
  EXPECT_EQ(scene.end_effectors[0].name, "tip");
  EXPECT_EQ(scene.end_effectors[0].position, (Vector3{0, 0.5, -1}));
  EXPECT_EQ(scene.end_effectors[1].position, (Vector3{0, 0, 0}));
  // The site's x is the body's y, and the array's middle lies 0.1 m along it.
  const RectArray& array = scene.sensors.at(0).array;
  EXPECT_NEAR(0.5 * (array.corner0[0] + array.corner1[0]), 0, 1e-15);
  EXPECT_NEAR(0.5 * (array.corner0[1] + array.corner1[1]), 0.6, 1e-15);
  EXPECT_THAT(made.idle, ElementsAre(HasSubstr("<site>: a place with a name")));
  options.pads[0].face = "+x";
  EXPECT_THROW(import(text, options), InputError);
  EXPECT_THAT(fault_of(mjcf(kBall + "<site name=\"a\"/>\n<site name=\"a\"/>")),
              HasSubstr(":4: <site>: site name 'a' is used twice, first in line 3"));
  options.pads.clear();
  options.end_effectors = {"tap"};
  EXPECT_THAT(fault_of(text, options),
              HasSubstr("no link or site of this name; did you mean 'tip'"));
}

TEST(RobotImport, AFreeBaseFalls) {
  RobotOptions options;
  options.free_base = true;
  const ImportedScene made = import_robot(kRobots + "gripper.urdf", kRobots + "scene.xml", options);
  const Scene scene = parse_scene(made.text, "scene.xml").scene;
  EXPECT_EQ(scene.links[0].joint.type, JointType::free);
  const std::string still = mjcf("<geom size=\"0.1\"/>\n<body><geom size=\"0.1\"/></body>");
  const Scene two = parse_scene(import(still, options).text, "scene.xml").scene;
  EXPECT_EQ(two.links[0].joint.type, JointType::free);
  EXPECT_EQ(two.links[1].joint.type, JointType::fixed);
  EXPECT_THAT(
      import(still).warnings,
      ElementsAre(HasSubstr("nothing in it moves, so it cannot be simulated alone; <include> "
                            "the scene in another, or let it move with --base free")));
  EXPECT_EQ(import(still).joints, 0);
  const ImportedScene weightless = import("<robot name=\"r\"><link name=\"a\"/></robot>", options);
  EXPECT_THAT(weightless.lost,
              ElementsAre(HasSubstr("joint 'a_base' moves nothing that has a mass")));
  EXPECT_THAT(weightless.warnings, ElementsAre(HasSubstr("nothing in it moves")));
}

TEST(RobotImport, RotationsAreThoseOfTheFormats) {
  const Quaternion yaw = from_rpy({0, 0, M_PI / 2});
  EXPECT_NEAR(yaw[3], std::sqrt(0.5), 1e-15);
  // Roll, then yaw about fixed axes: y of the inner frame points along -x, its z stays.
  const Pose pose{{0, 0, 0}, from_rpy({M_PI / 2, 0, M_PI / 2})};
  const Vector3 z = outer_direction(pose, {0, 0, 1});
  EXPECT_NEAR(z[0], 1, 1e-15);  // roll takes z to -y, yaw takes -y to x
  for (const Vector3& d : {Vector3{0, 0, -1}, Vector3{0.3, -0.4, 0.2}, Vector3{0, 0, 2}}) {
    const Vector3 turned = outer_direction({{0, 0, 0}, from_z(d)}, {0, 0, 1});
    const double length = std::sqrt(dot(d, d));
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(turned[k], d[k] / length, 1e-15);
  }
}

}  // namespace
}  // namespace tangere
