// SPDX-License-Identifier: Apache-2.0
// Skins that a URDF file has: places of taxels, stiffness by area, and mistakes.
#include <gmock/gmock.h>

#include <fstream>

#include "engine/model/model.hpp"
#include "engine/scene/outer_pose.hpp"
#include "engine/scene/skin_material.hpp"
#include "io/robot/robot_import.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class UrdfSkins : public ::testing::Test {
 protected:
  /// A finger on a hinge with a box that stands away from the link's frame.
  ImportedScene import(const std::string& sensors) {
    std::ofstream(folder_ / "robot.urdf")
        << R"(<robot name="r"><link name="base"/><link name="tip"><inertial><mass value="0.1"/>
<inertia ixx="1e-4" iyy="1e-4" izz="1e-4"/></inertial><collision><origin xyz="0.03 0 0"
rpy="0 0 1.5707963267948966"/><geometry><box size="0.02 0.06 0.02"/></geometry></collision></link>
<joint name="j" type="continuous"><parent link="base"/><child link="tip"/></joint>
)" + sensors + "</robot>";
    return import_robot(folder_ / "robot.urdf", folder_ / "scene.xml", {});
  }
  std::string fault_of(const std::string& sensors) {
    try {
      import(sensors);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }
  /// Places of the points and directions of their normals in the link's frame.
  static std::vector<std::array<Vector3, 2>> points(const Scene& scene) {
    const TactileDescription& sensor = scene.sensors.at(0);
    const Pose& body = scene.links.at(1).body.pose;
    std::vector<std::array<Vector3, 2>> out;
    for (const TactilePoint& p : tactile_points(sensor))
      out.push_back({outer_point(body, p.position), outer_direction(body, p.normal)});
    return out;
  }
  Scene scene(const std::string& sensors) {
    return parse_scene(import(sensors).text, folder_ / "scene.xml").scene;
  }

  testing::Folder folder_;
};

std::string sensor(const std::string& inside) {
  return "<sensor name=\"tip/skin\" update_rate=\"100\"><parent link=\"tip\"/>"
         "<origin xyz=\"0.06 0 0.01\" rpy=\"0 0 0\"/><tactile channel=\"x\">" +
         inside + "</tactile></sensor>";
}

void expect_near(const Vector3& ours, const Vector3& wanted) {
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(ours[k], wanted[k], 1e-12);
}

TEST_F(UrdfSkins, AnArrayLiesWhereItsReaderPutsIt) {
  const ImportedScene made =
      import(sensor("<array rows=\"3\" cols=\"4\" size=\"0.003 0.002\" spacing=\"0.004 -0.003\" "
                    "offset=\"0.001 0.002\" order=\"row-major\"/>"));
  EXPECT_THAT(made.lost, IsEmpty());
  EXPECT_THAT(made.changed, Contains(HasSubstr("a skin, whose stiffness is a guess")));
  EXPECT_EQ(made.sensors, 1U);
  const Scene s = parse_scene(made.text, folder_ / "scene.xml").scene;
  EXPECT_EQ(s.sensors[0].name, "tip_skin");
  const auto at = points(s);
  ASSERT_EQ(at.size(), 12U);
  for (int row = 0; row < 3; ++row)
    for (int col = 0; col < 4; ++col) {
      const auto& [place, normal] = at[std::size_t(4 * row + col)];
      expect_near(place, {0.06 + row * 0.004 - 0.001, -col * 0.003 - 0.002, 0.01});
    }
  EXPECT_NEAR(s.sensors[0].coefficients.kn, 2.3 * 5e5 / 1.5e-3 * 0.004 * 0.003, 1e-9);
}

TEST_F(UrdfSkins, TaxelsKeepTheirOrderPlacesAndNormals) {
  const Scene s =
      scene(sensor("<taxel idx=\"7\" xyz=\"0 0 0.001\" rpy=\"0 1.5707963267948966 0\"><geometry>"
                   "<mesh filename=\"none.stl\"/></geometry></taxel>"
                   "<taxel idx=\"2\" xyz=\"0 0.005 0\"/><taxel idx=\"3\" xyz=\"0 0.002 0\"/>"));
  const auto at = points(s);
  ASSERT_EQ(at.size(), 3U);
  expect_near(at[0][0], {0.06, 0.005, 0.01});
  expect_near(at[0][1], {0, 0, 1});
  expect_near(at[1][0], {0.06, 0.002, 0.01});
  expect_near(at[2][0], {0.06, 0, 0.011});
  expect_near(at[2][1], {1, 0, 0});
  // The nearest neighbours are 3, 2.236 and 2.236 mm away.
  EXPECT_NEAR(s.sensors[0].coefficients.kn, 2.3 * 5e5 / 1.5e-3 * 5e-6, 1);
  static_cast<void>(Model(s));
}

TEST_F(UrdfSkins, OneRowIsAList) {
  const auto at = points(scene(sensor("<array rows=\"1\" cols=\"3\" size=\"0.004 0.002\"/>")));
  ASSERT_EQ(at.size(), 3U);
  expect_near(at[2][0], {0.06, 0.004, 0.01});
}

TEST_F(UrdfSkins, MistakesNameTheLine) {
  EXPECT_THAT(fault_of("\n\n<sensor name=\"s\"><parent link=\"tp\"/><tactile><taxel idx=\"0\"/>"
                       "</tactile></sensor>"),
              HasSubstr("robot.urdf:7: <parent>: no link is named 'tp'; did you mean 'tip'"));
  EXPECT_THAT(fault_of(sensor("")), HasSubstr("has no <array> and no <taxel>"));
  EXPECT_THAT(fault_of(sensor("<taxel idx=\"3\" xyz=\"0 0 0\"/><taxel idx=\"3\" xyz=\"0 1 0\"/>")),
              HasSubstr("idx=\"3\": a taxel before has this number"));
  EXPECT_THAT(fault_of(sensor("<taxel xyz=\"0 0 0\"/>")), HasSubstr("'idx' is missing"));
  EXPECT_THAT(fault_of(sensor("<array rows=\"2\" cols=\"2\" size=\"0.1 0\"/>")),
              HasSubstr("expected lengths above 0"));
  EXPECT_THAT(import("<sensor name=\"eye\"><camera/></sensor>").idle,
              Contains(HasSubstr("no sensor of touch")));
}

}  // namespace
}  // namespace tangere
