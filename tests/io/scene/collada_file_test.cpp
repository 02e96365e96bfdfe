// SPDX-License-Identifier: Apache-2.0
// Surfaces of COLLADA files: faces, nodes, units, and what is refused.
#include "io/scene/collada_file.hpp"

#include <gmock/gmock.h>

#include <fstream>

#include "engine/base/error.hpp"
#include "io/scene/surface_files.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

/// A tetrahedron with corners at the origin and at 1 along each axis.
std::string dae(const std::string& faces, const std::string& scene = "",
                const std::string& unit = "<unit meter=\"1\"/>") {
  return "<COLLADA version=\"1.4.1\">\n<asset>" + unit +
         "<up_axis>Y_UP</up_axis></asset>\n<library_geometries><geometry id=\"g\"><mesh>\n"
         "<source id=\"p\"><float_array id=\"a\" count=\"12\">0 0 0 1 0 0 0 1 0 0 0 1</float_array>"
         "<technique_common><accessor source=\"#a\" count=\"4\" stride=\"3\"/></technique_common>"
         "</source>\n<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>\n" +
         faces + "\n</mesh></geometry></library_geometries>" + scene + "</COLLADA>\n";
}
const std::string kInput = "<input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>";
const std::string kTriangles =
    "<triangles count=\"4\">" + kInput + "<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles>";
std::string placed(const std::string& node) {
  return "<library_visual_scenes><visual_scene id=\"s\"><node>" + node +
         "<instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes>"
         "<scene><instance_visual_scene url=\"#s\"/></scene>";
}

class ColladaFile : public ::testing::Test {
 protected:
  RawMesh read(const std::string& text) const {
    std::ofstream(folder_ / "a.dae") << text;
    return read_collada(folder_ / "a.dae");
  }
  /// Volume of the surface [m³], negative where its faces look inwards; a fault ends the test.
  double volume(const std::string& text) const {
    const RawMesh mesh = read(text);
    EXPECT_EQ(mesh.fault, "");
    double six = 0;
    for (const auto& t : mesh.triangles) {
      const Vector3 &a = mesh.positions[std::size_t(t[0])], &b = mesh.positions[std::size_t(t[1])],
                    &c = mesh.positions[std::size_t(t[2])];
      six += dot(a, cross(b, c));
    }
    return six / 6;
  }
  std::string error(const std::string& text) const {
    try {
      read(text);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }
  testing::Folder folder_;
};

TEST_F(ColladaFile, HasFacesOfEveryKind) {
  const double sixth = 1.0 / 6;
  EXPECT_NEAR(volume(dae(kTriangles)), sixth, 1e-15);
  EXPECT_NEAR(volume(dae("<polylist count=\"4\">" + kInput +
                         "<vcount>3 3 3 3</vcount><p>0 2 1 0 1 3 0 3 2 1 2 3</p></polylist>")),
              sixth, 1e-15);
  EXPECT_NEAR(volume(dae("<polygons count=\"4\">" + kInput +
                         "<p>0 2 1</p><p>0 1 3</p><p>0 3 2</p><p>1 2 3</p></polygons>")),
              sixth, 1e-15);
  EXPECT_NEAR(
      volume(dae("<trifans count=\"2\">" + kInput + "<p>0 2 1 3 2</p><p>1 2 3</p></trifans>")),
      sixth, 1e-15);
  EXPECT_NEAR(volume(dae("<tristrips count=\"1\">" + kInput + "<p>0 2 1 3 0 2</p></tristrips>")),
              sixth, 1e-15);
  // Normals of their own beside the vertices.
  EXPECT_NEAR(volume(dae("<triangles count=\"4\"><input semantic=\"NORMAL\" source=\"#p\" "
                         "offset=\"0\"/><input semantic=\"VERTEX\" source=\"#v\" offset=\"1\"/>"
                         "<p>9 0 9 2 9 1 9 0 9 1 9 3 9 0 9 3 9 2 9 1 9 2 9 3</p></triangles>")),
              sixth, 1e-15);
}

TEST_F(ColladaFile, CommentsDoNotEndNumbers) {
  std::string text = dae(kTriangles);
  text.replace(text.find("0 1 0 0 0 1<"), 5, "+0 <!-- so --> 1 0");
  EXPECT_NEAR(volume(text), 1.0 / 6, 1e-15);
}

TEST_F(ColladaFile, IsWhereItsNodesPutIt) {
  const RawMesh moved =
      read(dae(kTriangles,
               placed("<translate>1 2 3</translate><rotate>0 0 1 90</rotate><scale>2 1 1</scale>"),
               "<unit meter=\"0.01\"/>"));
  // (1, 0, 0) is stretched, turned and shifted, in centimetres.
  EXPECT_NEAR(moved.positions[1][0], 0.01, 1e-15);
  EXPECT_NEAR(moved.positions[1][1], 0.04, 1e-15);
  EXPECT_NEAR(moved.positions[1][2], 0.03, 1e-15);
  // A mirror keeps the outside outside.
  EXPECT_NEAR(volume(dae(kTriangles, placed("<scale>-1 1 1</scale>"))), 1.0 / 6, 1e-15);
  EXPECT_NEAR(volume(dae(kTriangles, placed("<node><matrix>2 0 0 0 0 2 0 0 0 0 2 1 0 0 0 1</matrix>"
                                            "<instance_geometry url=\"#g\"/></node>"))),
              9.0 / 6, 1e-14);
  EXPECT_NEAR(volume(dae(kTriangles,
                         "<library_nodes><node id=\"n\"><scale>2 2 2</scale>"
                         "<instance_geometry url=\"#g\"/></node></library_nodes>" +
                             placed("<instance_node url=\"#n\"/>"))),
              9.0 / 6, 1e-14);
}

TEST_F(ColladaFile, IsASurfaceFile) {
  const MeshShape box = read_surface(TANGERE_TEST_DATA "/robots/box.dae");
  EXPECT_EQ(box.triangles.size(), 12U);
  double low[3] = {1, 1, 1}, high[3] = {-1, -1, -1};
  for (std::size_t k = 0; k < box.vertices.size(); ++k) {
    low[k % 3] = std::min(low[k % 3], box.vertices[k]);
    high[k % 3] = std::max(high[k % 3], box.vertices[k]);
  }
  EXPECT_NEAR(high[0], 0.02, 1e-15);
  EXPECT_NEAR(high[1], 0.015, 1e-15);
  EXPECT_NEAR(low[2], 0.005, 1e-15);
  EXPECT_NEAR(high[2], 0.025, 1e-15);
}

TEST_F(ColladaFile, WhatCannotBeReadIsAnErrorWithItsLine) {
  EXPECT_THAT(error("<robot/>"), HasSubstr("a.dae:1: the root <robot>; expected <COLLADA>"));
  EXPECT_THAT(error("<COLLADA"), HasSubstr("not well-formed XML"));
  const auto faces = [&](const std::string& p) {
    return error(dae("<triangles count=\"1\">" + kInput + "<p>" + p + "</p></triangles>"));
  };
  EXPECT_THAT(faces("0 1 4"), HasSubstr("a.dae:6: vertex 4; expected one of 0 to 3"));
  EXPECT_THAT(faces("0 1 x"), HasSubstr("a.dae:6: <p> has 'x'; expected numbers"));
  EXPECT_THAT(faces("0 1 2 3"), HasSubstr("1 corners beyond the faces"));
  EXPECT_THAT(error(dae("<polylist>" + kInput + "<vcount>2</vcount><p>0 1</p></polylist>")),
              HasSubstr("a face of 2 corners"));
  EXPECT_THAT(error(dae("<polygons>" + kInput + "<ph><p>0 1 2</p><h>0 1 2</h></ph></polygons>")),
              HasSubstr("a polygon with a hole"));
  EXPECT_THAT(error(dae("<triangles><p>0 1 2</p></triangles>")),
              HasSubstr("<triangles> without an input VERTEX"));
  EXPECT_THAT(error(dae("<triangles><input semantic=\"VERTEX\" source=\"#q\"/></triangles>")),
              HasSubstr("<input> source=\"#q\"; expected # and the id of an element"));
  EXPECT_THAT(error(dae(kTriangles, placed("<skew>1 2 3 4 5 6 7</skew>"))),
              HasSubstr("<skew>; expected matrix, translate, rotate or scale"));
  EXPECT_THAT(error(dae(kTriangles, placed("<matrix>1 2</matrix>"))),
              HasSubstr("<matrix> has 2 numbers; expected 16"));
  EXPECT_THAT(error(dae(kTriangles, "", "<unit meter=\"0\"/>")),
              HasSubstr("<unit> has no positive length"));
  EXPECT_THAT(error(dae(kTriangles,
                        "<library_nodes><node id=\"n\"><instance_node url=\"#n\"/></node>"
                        "</library_nodes>" +
                            placed("<instance_node url=\"#n\"/>"))),
              HasSubstr("nodes nested deeper than 100"));
  std::string bomb;  // 2^32 nodes
  for (int k = 0; k < 32; ++k) {
    const std::string next = "<instance_node url=\"#n" + std::to_string(k + 1) + "\"/>";
    bomb += "<node id=\"n" + std::to_string(k) + "\">" + next + next + "</node>";
  }
  EXPECT_THAT(
      error(dae(kTriangles, "<library_nodes>" + bomb + "<node id=\"n32\"/></library_nodes>" +
                                placed("<instance_node url=\"#n0\"/>"))),
      HasSubstr("more than 100000 nodes"));
  std::string none = dae(kTriangles);
  none.replace(none.find("0 0 0 1 0 0 0 1 0 0 0 1"), 23, "");
  EXPECT_THAT(error(none), HasSubstr("0 numbers of positions"));
}

}  // namespace
}  // namespace tangere
