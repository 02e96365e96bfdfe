// SPDX-License-Identifier: Apache-2.0
// <replicate> and <attach>: names, which MuJoCo 4.0.0 gave, files and mistakes.
// tests/data/robots/models.xml compares the motion.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "io/robot/robot_import.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::string kBox = "<geom type=\"box\" size=\"0.01 0.01 0.01\"/>";

class RobotCopies : public ::testing::Test {
 protected:
  ImportedScene import(const std::string& text, const RobotOptions& options = {}) {
    write("robot.xml", text);
    return import_robot(folder_ / "robot.xml", folder_ / "scene.xml", options);
  }
  std::string fault_of(const std::string& text) {
    try {
      import(text);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  void write(const std::string& name, const std::string& text) {
    std::filesystem::create_directories(std::filesystem::path(folder_ / name).parent_path());
    std::ofstream(folder_ / name) << text;
  }
  /// The names of joints that move, and of the motors' joints.
  std::vector<std::string> joints(const std::string& text) {
    std::vector<std::string> names;
    const Scene scene = parse_scene(import(text).text, folder_ / "scene.xml").scene;
    for (const LinkDescription& link : scene.links)
      if (link.joint.type != JointType::fixed) names.push_back(link.joint.name);
    for (const MotorDescription& motor : scene.motors) names.push_back("motor " + motor.joint);
    return names;
  }

  testing::Folder folder_;
};

std::string world(const std::string& inside, const std::string& more = "") {
  return "<mujoco>" + more + "<worldbody>\n" + inside + "</worldbody>\n</mujoco>";
}
std::string body(const std::string& joint, const std::string& more = "") {
  return "<body name=\"b" + joint + "\"><joint name=\"" + joint + "\"/>" + kBox + more + "</body>";
}
std::string copies(const std::string& attributes, const std::string& inside) {
  return "<replicate " + attributes + ">" + inside + "</replicate>\n";
}

TEST_F(RobotCopies, SuffixesHaveTheDigitsOfTheCount) {
  EXPECT_THAT(joints(world(copies("count=\"2\"", body("j")))), ElementsAre("j0", "j1"));
  const std::vector<std::string> ten = joints(world(copies("count=\"10\" sep=\"_\"", body("j"))));
  EXPECT_EQ(ten.size(), 10U);
  EXPECT_EQ(ten.back(), "j_09");
  EXPECT_THAT(joints(world(copies("count=\"0\"", body("j")) + body("k"))), ElementsAre("k"));
}

/// Copies of an actuator follow the others, and those of inner copies those of outer ones.
TEST_F(RobotCopies, ActuatorsAreThereForEachCopy) {
  const std::string nested =
      copies("count=\"2\" sep=\"-\"", body("r", copies("count=\"2\"", body("k"))));
  EXPECT_THAT(joints(world(nested + body("z"),
                           "<actuator><motor joint=\"k\"/><motor joint=\"r\"/>"
                           "<motor joint=\"z\"/></actuator>")),
              ElementsAre("r-0", "k0-0", "k1-0", "r-1", "k0-1", "k1-1", "z", "motor z", "motor r-0",
                          "motor k0-0", "motor k1-0", "motor r-1", "motor k0-1", "motor k1-1"));
}

/// Each copy of an <exclude> names bodies of one copy, or what is not copied.
TEST_F(RobotCopies, ExcludesAreThereForEachCopy) {
  RobotOptions options;
  options.pads = {{"bj1",
                   "skin.xml",
                   "<sensor unit=\"m-kg\"><tactile name=\"skin\" type=\"rect_array\" "
                   "rect_pos0=\"-0.01 -0.01 0\" rect_pos1=\"0.01 0.01 0\" axis0=\"1 0 0\" "
                   "axis1=\"0 1 0\" resolution=\"2 2\" kn=\"1\"/></sensor>",
                   {},
                   "+x"}};
  const std::string text = world(copies("count=\"2\"", body("j", body("k"))) + body("z"),
                                 "<contact><exclude body1=\"bj\" body2=\"bk\"/>"
                                 "<exclude body1=\"bz\" body2=\"bj\"/></contact>");
  EXPECT_THAT(
      parse_scene(import(text, options).text, folder_ / "scene.xml").scene.sensors.at(0).ignores,
      ElementsAre("bk1", "bz"));
}

/// An <attach> without a model is of the same file.
TEST_F(RobotCopies, APartOfTheFileIsAttachedAgain) {
  EXPECT_THAT(
      joints(world(
          body("o") + copies("count=\"2\"", "<attach body=\"bo\" prefix=\"q_\"/>") + body("z"),
          "<actuator><motor joint=\"o\"/><motor joint=\"z\"/></actuator>")),
      ElementsAre("o", "q_o0", "q_o1", "z", "motor o", "motor z", "motor q_o0", "motor q_o1"));
  EXPECT_THAT(fault_of(world(body("o", "<attach body=\"bo\" prefix=\"q_\"/>"))),
              HasSubstr("<body>: bodies nested deeper than 90"));
  EXPECT_THAT(fault_of(world(body("o") + "<attach body=\"bp\" prefix=\"q_\"/>")),
              HasSubstr("<attach>: body=\"bp\": no body of this file has this name"));
  EXPECT_THAT(fault_of(world(body("o") + "<attach prefix=\"q_\"/>")),
              HasSubstr("<attach>: none of 'model', 'body' and 'frame'"));
}

TEST_F(RobotCopies, MistakesInCopiesNameTheLine) {
  EXPECT_THAT(fault_of(world(copies("", body("j")))), HasSubstr(":2: <replicate>: "));
  EXPECT_THAT(fault_of(world(copies("count=\"-1\"", body("j")))), HasSubstr(":2: <replicate>: "));
  EXPECT_THAT(fault_of(world(copies("count=\"2\" offst=\"0 0 1\"", body("j")))),
              HasSubstr("did you mean 'offset'"));
  EXPECT_THAT(fault_of(world("<body>" + copies("count=\"2\"", "<joint/>") + kBox + "</body>")),
              HasSubstr("<joint>: unknown element inside <replicate>"));
  EXPECT_THAT(fault_of(world(copies("count=\"2\"", body("j")) + body("j0"))),
              HasSubstr(":3: <body>: body name 'bj0' is used twice, first in line 2"));
  EXPECT_THAT(fault_of(world(copies("count=\"9000\"", copies("count=\"2\"", body("j"))))),
              HasSubstr("more than 10000 copies and attached models"));
}

/// A part with its own units, folder of meshes and included file.
class RobotAttached : public RobotCopies {
 protected:
  RobotAttached() {
    write("parts/part.xml",
          world("<frame name=\"f\" pos=\"9 9 9\">" + body("j", body("k")) + "</frame>" + body("o") +
                    "<body name=\"m\"><joint name=\"mj\"/><geom type=\"mesh\" mesh=\"t\"/></body>",
                "<include file=\"common.xml\"/><asset><mesh name=\"t\" file=\"t.obj\"/></asset>"
                "<option timestep=\"0.5\"/><keyframe><key name=\"home\"/></keyframe>"
                "<actuator><motor joint=\"o\"/><motor joint=\"k\"/></actuator>"));
    write("parts/common.xml",
          "<mujoco><compiler angle=\"radian\" meshdir=\"m\"/>"
          "<default><joint range=\"-1 1\"/></default></mujoco>");
    write("parts/m/t.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n");
  }
  static std::string whole(const std::string& attached, const std::string& more = "") {
    return world("<body>" + kBox + attached + "</body>\n",
                 "<asset><model name=\"p\" file=\"parts/part.xml\"/></asset>" + more);
  }
};
std::string attach(const std::string& attributes) {
  return "<attach model=\"p\" " + attributes + "/>\n";
}

TEST_F(RobotAttached, APrefixStandsBeforeAllNames) {
  EXPECT_THAT(joints(whole(attach("body=\"bj\" prefix=\"a_\""))),
              ElementsAre("a_j", "a_k", "motor a_k"));
  EXPECT_THAT(joints(whole(copies("count=\"2\"", attach("body=\"bj\" prefix=\"a_\"")),
                           "<actuator><motor joint=\"a_j\"/></actuator>")),
              ElementsAre("a_j0", "a_k0", "a_j1", "a_k1", "motor a_j0", "motor a_k0", "motor a_j1",
                          "motor a_k1"));
  EXPECT_THAT(
      joints(whole(attach("prefix=\"a_\"") + attach("body=\"bk\" prefix=\"c_\""))),
      ElementsAre("a_j", "a_k", "a_o", "a_mj", "c_k", "motor a_o", "motor a_k", "motor c_k"));
  EXPECT_THAT(joints(whole(attach("body=\"world\" prefix=\"\""))),
              ElementsAre("j", "k", "o", "mj", "motor o", "motor k"));
}

TEST_F(RobotAttached, APartKeepsItsSettingsAndFolder) {
  const ImportedScene made = import(whole(attach("prefix=\"a_\"")));
  EXPECT_THAT(made.lost, IsEmpty());
  EXPECT_THAT(made.text, AllOf(HasSubstr("parts/m/t.obj"), HasSubstr("lim=\"-1 1\"")));
  EXPECT_THAT(made.idle, AllOf(Contains(HasSubstr("part.xml: <option> of an attached model")),
                               Contains(HasSubstr("part.xml: <keyframe> of an attached model"))));
  const Scene scene = parse_scene(made.text, folder_ / "scene.xml").scene;
  EXPECT_EQ(scene.timestep, 0.002);
  EXPECT_THAT(import(whole(attach("prefix=\"a_\""), "<compiler conflict=\"merge\"/>")).lost,
              ElementsAre(HasSubstr("<option> of an attached model, which conflict=\"merge\"")));
}

/// MuJoCo takes the body without the frames around it.
TEST_F(RobotAttached, ABodyComesWithoutTheFramesAroundIt) {
  const auto place = [&](const std::string& attributes) {
    return parse_scene(import(whole(attach(attributes))).text, folder_ / "scene.xml")
        .scene.links.at(1)
        .joint.pose.position;
  };
  EXPECT_EQ(place("body=\"bj\" prefix=\"a\""), (Vector3{0, 0, 0}));
  EXPECT_EQ(place("frame=\"f\" prefix=\"a\""), (Vector3{9, 9, 9}));
}

TEST_F(RobotAttached, MistakesNameTheLine) {
  EXPECT_THAT(fault_of(whole(attach("body=\"bi\" prefix=\"a\""))),
              HasSubstr("robot.xml:2: <attach>: body=\"bi\": no body of model 'p' has this name; "
                        "did you mean 'bj'"));
  EXPECT_THAT(fault_of(whole("<attach model=\"q\" prefix=\"a\"/>")),
              HasSubstr(":2: <attach>: model=\"q\": no <model> has this name; did you mean 'p'"));
  EXPECT_THAT(fault_of(whole(attach("body=\"bj\""))),
              HasSubstr(":2: <attach>: attribute 'prefix' is missing"));
  EXPECT_THAT(fault_of(whole(attach("prefix=\"a\"") + attach("prefix=\"a\""))),
              HasSubstr("body name 'abj' is used twice"));
  write("parts/part.xml",
        world("", "<asset><model name=\"r\" file=\"../parts/part.xml\"/></asset>"));
  EXPECT_THAT(fault_of(whole(attach("prefix=\"a\""))),
              AllOf(HasSubstr("part.xml:1: <model>: "), HasSubstr("is part of itself")));
  std::filesystem::remove(folder_ / "parts/part.xml");
  EXPECT_THROW(import(whole(attach("prefix=\"a\""))), IoError);
}

}  // namespace
}  // namespace tangere
