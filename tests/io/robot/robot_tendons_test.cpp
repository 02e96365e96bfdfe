// SPDX-License-Identifier: Apache-2.0
// Spatial tendons, actuators at sites and sites of the world, as import writes them, and what it
// lists of them.
#include <gmock/gmock.h>

#include <cmath>
#include <fstream>

#include "engine/model/model.hpp"
#include "io/robot/robot_import.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A body on a hinge with a ball as its shape, sites, and a drum in the world.
ImportedScene tendon_model(const std::string& after) {
  const testing::Folder folder;
  const std::string path = folder / "robot.xml";
  std::ofstream(path)
      << "<mujoco><compiler angle=\"radian\"/><worldbody>\n"
         "<site name=\"base\" pos=\"0 0 0.3\"/>\n"
         "<geom name=\"drum\" type=\"cylinder\" size=\"0.02 0.1\" pos=\"0 0 0.1\"\n"
         " euler=\"1.5707963267948966 0 0\" contype=\"0\" conaffinity=\"0\"/>\n"
         "<site name=\"side\" pos=\"0.1 0 0.1\"/><site name=\"middle\" pos=\"0 0 0.1\"/>\n"
         "<body name=\"b\"><joint name=\"j\" axis=\"0 1 0\" stiffness=\"1\" "
         "springref=\"0.2\"/>\n"
         "<geom name=\"ball\" size=\"0.05\" pos=\"0.1 0 0\"/>\n"
         "<site name=\"tip\" pos=\"0.2 0 0\" euler=\"0 0 0.3\"/></body>\n"
         "</worldbody>\n"
      << after << "</mujoco>\n";
  return import_robot(path, folder / "scene.xml", {});
}

Scene tendon_scene(const ImportedScene& made) { return parse_scene(made.text, "scene.xml").scene; }

TEST(RobotTendons, GoOverSitesGeomsAndPulleys) {
  const ImportedScene whole = tendon_model(
      R"(<tendon><spatial name="cord" stiffness="5" damping="2" range="0.1 0.9" limited="true">
<site site="base"/><geom geom="drum" sidesite="side"/><site site="tip"/><pulley divisor="2"/>
<site site="tip"/><site site="base"/></spatial></tendon>
<actuator><motor name="pull" tendon="cord" gear="-3"/></actuator>)");
  EXPECT_THAT(whole.lost, IsEmpty());
  const Scene s = tendon_scene(whole);
  ASSERT_EQ(s.transmissions.size(), 1U);
  const std::vector<PathPart>& path = s.transmissions[0].path;
  ASSERT_EQ(path.size(), 6U);
  EXPECT_EQ(path[0].body, "");
  EXPECT_EQ(path[1].kind, PathPart::Kind::cylinder);
  EXPECT_NEAR(std::abs(path[1].axis[1]), 1, 1e-12);
  EXPECT_NEAR((*path[1].side)[0], 0.1, 1e-12);
  EXPECT_EQ(path[2].body, "b");
  EXPECT_EQ(path[3].divisor, 2);
  const JointDescription& joint = s.links.back().joint;
  EXPECT_EQ(joint.stiffness, 5);
  EXPECT_EQ((*joint.limits)[1], 0.9);
  EXPECT_GT(joint.limit_stiffness, 0);
  // The spring rests at the length where that of the hinge does.
  Scene resting = s;
  resting.initial = {{"j", {0.2}, {}, {}}};
  EXPECT_NEAR(joint.rest.at(0), Model(resting).initial_q().back(), 1e-12);
}

TEST(RobotTendons, ActuatorsAtSitesPushInTheirAxes) {
  const ImportedScene whole = tendon_model(
      R"(<actuator><motor name="push" site="tip" gear="0 2 0 0 0 4"/>
<position name="reach" site="tip" refsite="base" kp="9" gear="1 0 0 0 0 0"/></actuator>)");
  EXPECT_THAT(whole.lost, IsEmpty());
  const Scene s = tendon_scene(whole);
  ASSERT_EQ(s.transmissions.size(), 2U);
  EXPECT_NEAR(s.transmissions[0].force[0], -2 * std::sin(0.3), 1e-12);
  EXPECT_NEAR(s.transmissions[0].force[1], 2 * std::cos(0.3), 1e-12);
  EXPECT_NEAR(s.transmissions[0].torque[2], 4, 1e-12);
  EXPECT_EQ(s.transmissions[1].reference, "");
  EXPECT_NEAR(s.transmissions[1].reference_position[2], 0.3, 1e-12);
  EXPECT_NEAR(Model(s).initial_q().back(), 0.2, 1e-12) << "the way along x";
}

TEST(RobotTendons, LoopsMayEndAtSitesOfTheWorld) {
  const ImportedScene whole =
      tendon_model(R"(<equality><connect site1="tip" site2="base"/></equality>)");
  EXPECT_THAT(whole.lost, IsEmpty());
  const Scene s = tendon_scene(whole);
  ASSERT_EQ(s.loops.size(), 1U);
  EXPECT_EQ(s.loops[0].body2, "");
  EXPECT_NEAR((*s.loops[0].position2)[2], 0.3, 1e-12);
}

TEST(RobotTendons, ListWhatScenesDoNotHave) {
  const auto lost = [](const std::string& inside) {
    return tendon_model("<tendon><spatial name=\"cord\">" + inside + "</spatial></tendon>").lost;
  };
  EXPECT_THAT(lost(R"(<site site="base"/><geom geom="drum" sidesite="middle"/><site site="tip"/>)"),
              ElementsAre(HasSubstr("a path on its inside")));
  EXPECT_THAT(lost(R"(<site site="none"/><site site="tip"/>)"),
              ElementsAre(HasSubstr("a site that is not of a body")));
  EXPECT_THAT(lost(R"(<site site="base"/><geom geom="b"/><site site="tip"/>)"),
              ElementsAre(HasSubstr("no named sphere or cylinder")));
  EXPECT_THAT(
      tendon_model(R"(<actuator><motor site="tip" refsite="base" gear="0 0 0 1 0 0"/></actuator>)")
          .lost,
      Contains(HasSubstr("refsite: a torque")));
}

}  // namespace
}  // namespace tangere
