// SPDX-License-Identifier: Apache-2.0
// Materials of MJCF in pictures of cameras.
#include <gmock/gmock.h>

#include <fstream>

#include "io/robot/robot_import.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/files.hpp"

namespace tangere {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Geoms that name a material look as it does; one that gives no highlight has none.
TEST(RobotMaterials, OfGeomsAreKept) {
  const testing::Folder folder;
  std::ofstream(folder / "robot.xml")
      << "<mujoco><asset><material name=\"metal\" rgba=\"0.5 0.6 0.7 1\" specular=\"0.9\"/>"
         "<material name=\"lamp\" shininess=\"0.25\" emission=\"3\"/>"
         "<material name=\"plain\" rgba=\"1 0 0 1\"/></asset><worldbody><body name=\"a\">"
         "<joint name=\"j\" axis=\"0 1 0\"/><geom size=\"0.01\" material=\"metal\"/>"
         "<geom size=\"0.01\" pos=\"0.1 0 0\" material=\"lamp\" rgba=\"1 1 0 1\"/>"
         "<geom size=\"0.01\" pos=\"0.2 0 0\" material=\"plain\"/>"
         "<geom size=\"0.01\" pos=\"0.3 0 0\" material=\"plane\"/></body></worldbody></mujoco>";
  const ImportedScene made = import_robot(folder / "robot.xml", folder / "scene.xml", {});
  const Scene scene = parse_scene(made.text, "scene.xml").scene;
  ASSERT_EQ(scene.links.size(), 4U);
  const auto looks = [&](std::size_t k) {
    const BodyDescription& b = scene.links[k].body;
    return std::vector<double>{b.rgba[0], b.rgba[2], b.specular, b.shininess, b.emission};
  };
  EXPECT_THAT(looks(0), ElementsAre(0.5, 0.7, 0.9, 0.5, 0));
  EXPECT_THAT(looks(1), ElementsAre(1, 0, 0.5, 0.25, 1));
  EXPECT_THAT(looks(2), ElementsAre(1, 0, 0, 0.5, 0));
  EXPECT_THAT(made.changed, ElementsAre(HasSubstr("<material> emission=\"3\": 1"),
                                        HasSubstr("<geom> of material 'plane': the usual grey")));
}

}  // namespace
}  // namespace tangere
