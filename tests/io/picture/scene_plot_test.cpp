// SPDX-License-Identifier: Apache-2.0
// Tests the picture of a scene: faces close their bodies and look outward, places on the page
// follow the camera, and what the scene names is named.
#include "io/picture/scene_plot.hpp"

#include <gmock/gmock.h>
#include <tinyxml2.h>

#include <cmath>
#include <filesystem>

#include "io/picture/body_faces.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/engine/meshes.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

/// Volume and sum of area vectors of closed faces: ∫ x·dA / 3 and ∫ dA.
struct Closed {
  double volume = 0;
  Vector3 area{};
};
Closed closed(const std::vector<Face>& faces) {
  Closed sum;
  for (const Face& face : faces)
    for (std::size_t k = 1; k + 1 < face.size(); ++k) {
      const Vector3 twice = cross(face[k] - face[0], face[k + 1] - face[0]);
      sum.volume += dot(face[0], twice) / 6;
      sum.area = sum.area + 0.5 * twice;
    }
  return sum;
}

TEST(BodyFaces, CloseTheBodyAndLookOutward) {
  struct Case {
    const char* name;
    Shape shape;
    double volume, error;
  };
  MeshShape scaled = testing::cuboid_mesh({0.1, 0.2, 0.3});
  scaled.scale = 2;
  const double ball = 4.0 / 3 * M_PI;
  for (const Case& c : {Case{"sphere", SphereShape{0.2}, ball * 0.008, 0.04},
                        Case{"cuboid", CuboidShape{{0.1, 0.2, 0.3}}, 0.006, 1e-12},
                        Case{"cylinder", CylinderShape{0.3, 0.1}, M_PI * 0.003, 0.02},
                        Case{"capsule", CapsuleShape{0.3, 0.1}, M_PI * 0.003 + ball * 0.001, 0.04},
                        Case{"ellipsoid", EllipsoidShape{{0.2, 0.4, 0.6}}, ball * 0.006, 0.04},
                        Case{"mesh", scaled, 8 * 8 * 0.006, 1e-12}}) {
    SCOPED_TRACE(c.name);
    const Closed is = closed(faces_of(c.shape, 1));
    EXPECT_NEAR(is.volume, c.volume, c.error * c.volume);
    for (const double a : is.area) EXPECT_NEAR(a, 0, 1e-12);
  }
  EXPECT_EQ(faces_of(PlaneShape{}, 0.5).size(), 1U);
}

TEST(BodyFaces, ALargeMeshIsThinned) {
  const MeshShape mesh = testing::ellipsoid_mesh(5, {0.1, 0.1, 0.1});  // 20 480 triangles
  EXPECT_EQ(faces_of(mesh, 1, 30000).size(), mesh.triangles.size());
  const std::vector<Face> few = faces_of(mesh, 1, 2000);
  EXPECT_LE(few.size(), 2000U);
  EXPECT_GT(few.size(), 400U);
  EXPECT_NEAR(closed(few).volume, 4.0 / 3 * M_PI * 1e-3, 1e-4);
}

Scene scene_of(const std::string& inside) {
  return parse_scene(
             "<tangere model=\"a &lt;b&gt;\"><option unit=\"m-kg\"/>" + inside + "</tangere>",
             "test.xml")
      .scene;
}

/// Opposite corners of each filled path, in the order of drawing.
std::vector<std::array<double, 4>> filled(const std::string& svg) {
  tinyxml2::XMLDocument document;
  EXPECT_EQ(document.Parse(svg.c_str()), tinyxml2::XML_SUCCESS) << svg;
  std::vector<std::array<double, 4>> all;
  for (const auto* path = document.RootElement()->FirstChildElement("path"); path != nullptr;
       path = path->NextSiblingElement("path")) {
    if (path->Attribute("fill-opacity") == nullptr) continue;
    std::array<double, 4> box = {1e9, 1e9, -1e9, -1e9};
    std::string text = path->Attribute("d");
    for (char& c : text)
      if (c == 'M' || c == 'L' || c == 'Z') c = ' ';
    std::istringstream numbers(text);
    for (double x = 0, y = 0; numbers >> x >> y;)
      box = {std::min(box[0], x), std::min(box[1], y), std::max(box[2], x), std::max(box[3], y)};
    all.push_back(box);
  }
  return all;
}

TEST(ScenePlot, PlacesFollowTheCamera) {
  const Scene scene = scene_of(
      R"(<robot><link name="box"><joint name="box" type="prismatic" axis="0 0 1"/>
         <body name="box" type="cuboid" size="0.4 0.1 0.2"/></link></robot>)");
  const auto front = filled(render_scene_svg(scene, {0, 0}));
  ASSERT_EQ(front.size(), 1U) << "the other faces look away or are seen on edge";
  EXPECT_NEAR((front[0][2] - front[0][0]) / (front[0][3] - front[0][1]), 2, 0.01);
  const auto side = filled(render_scene_svg(scene, {90, 0}));
  ASSERT_EQ(side.size(), 1U);
  EXPECT_NEAR((side[0][2] - side[0][0]) / (side[0][3] - side[0][1]), 0.5, 0.01);
  const auto above = filled(render_scene_svg(scene, {0, 90}));
  ASSERT_EQ(above.size(), 1U);
  EXPECT_NEAR((above[0][2] - above[0][0]) / (above[0][3] - above[0][1]), 4, 0.02);
  EXPECT_EQ(filled(render_scene_svg(scene, {30, 25})).size(), 3U);
}

/// The nearer body is painted last, and above in the picture is above in the scene.
TEST(ScenePlot, NearBodiesHideFarOnes) {
  const Scene scene = scene_of(
      R"(<robot><link name="near"><joint name="near" type="prismatic" axis="0 0 1" pos="0 -1 0"/>
         <body name="near" type="cuboid" size="0.2 0.2 0.2"/></link></robot>
         <robot><link name="far"><joint name="far" type="prismatic" axis="0 0 1" pos="0 1 0.5"/>
         <body name="far" type="cuboid" size="0.4 0.2 0.2"/></link></robot>)");
  const auto drawn = filled(render_scene_svg(scene, {0, 0}));
  ASSERT_EQ(drawn.size(), 2U);
  EXPECT_NEAR(drawn[0][2] - drawn[0][0], 2 * (drawn[1][2] - drawn[1][0]), 0.3);
  EXPECT_LT(drawn[0][3], drawn[1][3]);
}

TEST(ScenePlot, NamesWhatTheSceneHas) {
  const SceneFile file = read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball_small.xml");
  const std::string svg = render_scene_svg(file.scene, {});
  for (const char* part : {">rolling_ball_small<", ">pad_joint<", ">ball_joint<", ">pad<",
                           "2 bodies, 9 dofs, 1 sensor<", ">axis0<"})
    EXPECT_THAT(svg, HasSubstr(part));
  EXPECT_THAT(render_scene_svg(scene_of(R"(<robot><link name="a"><joint name="a" type="free3d"/>
      <body name="a" type="sphere" radius="1"/></link></robot>)"),
                               {}),
              Not(HasSubstr("axis0")));
}

TEST(ScenePlot, DrawsEverySceneHere) {
  int drawn = 0;
  for (const char* folder : {"/scenes", "/scenes/hard", "/docs/images"})
    for (const auto& entry :
         std::filesystem::directory_iterator(std::string(TANGERE_SOURCE_DIR) + folder)) {
      if (entry.path().extension() != ".xml") continue;
      SCOPED_TRACE(entry.path());
      tinyxml2::XMLDocument document;
      const std::string svg = render_scene_svg(read_scene(entry.path()).scene, {});
      EXPECT_EQ(document.Parse(svg.c_str()), tinyxml2::XML_SUCCESS);
      EXPECT_THAT(svg, Not(HasSubstr("nan")));
      EXPECT_LT(svg.size(), 3'000'000U);
      ++drawn;
    }
  EXPECT_GT(drawn, 10);
}

}  // namespace
}  // namespace tangere
