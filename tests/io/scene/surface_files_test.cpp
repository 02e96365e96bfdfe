// SPDX-License-Identifier: Apache-2.0
// Tests meshes and contact points from files: the results, and the messages for malformed files.
#include "io/scene/surface_files.hpp"

#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "engine/model/compile.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/scene/mass_properties.hpp"
#include "engine/scene/shapes.hpp"
#include "io/scene/scene_reader.hpp"
#include "io/scene/tactile_layouts.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using kernels::Vec3;
using ::testing::HasSubstr;

/// The box [0, 1] × [0, 2] × [0, 3]: quadrilaterals, comments, texture indices, an index counted
/// from the end.
const std::string kBox = R"(# a box
o box
v 0 0 0
v 1 0 0
v 1 2 0
v 0 2 0
v 0 0 3
v 1 0 3
v 1 2 3
v 0 2 3
v 9 9 9
vn 0 0 1
s off
f 1 4 3 2
f 5/1/1 6/2/1 7//1 -2   # the top; vertex 8
f 1 2 6 5
f 2 3 7 6
f 3 4 8 7
f 4 1 5 8
)";

class SurfaceFiles : public ::testing::Test {
 protected:
  SurfaceFiles()
      : folder_(::testing::TempDir() + "tangere_surface_" + std::to_string(getpid()) + "/") {
    std::filesystem::create_directories(folder_);
  }
  ~SurfaceFiles() override { std::filesystem::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ + name, std::ios::binary) << text;
    return folder_ + name;
  }
  template <class F>
  std::string error_of(const F& f) {
    try {
      f();
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }
  std::string obj_error(const std::string& text) {
    return error_of([&] { read_surface(write("a.obj", text)); });
  }
  /// kBox with one piece replaced.
  std::string box_error(const std::string& what, const std::string& by) {
    std::string text = kBox;
    return obj_error(text.replace(text.find(what), what.size(), by));
  }
  std::string points_error(const std::string& text) {
    return error_of([&] { read_contact_points(write("p.txt", text)); });
  }
  SceneFile scene(const std::string& body) {
    const std::string text = R"(<tangere><option unit="cm-g"/><ground/><robot><link name="a">
<joint name="a" type="free3d" pos="1 0 0" quat="1 0 0 1"/>
)" + body + "\n</link></robot></tangere>";
    return parse_scene(text, folder_ + "s.xml");
  }
  std::string scene_error(const std::string& body) {
    return error_of([&] { scene(body); });
  }

  std::string folder_;
};

TEST_F(SurfaceFiles, ABoxHasTheMassOfTheCuboid) {
  const MeshShape mesh = read_surface(write("box.obj", kBox));
  EXPECT_EQ(mesh.vertices.size(), 24U);  // without the one that no face uses
  EXPECT_EQ(mesh.triangles.size(), 12U);
  const MassProperties got = mass_properties(mesh, 700),
                       box = mass_properties(CuboidShape{{1, 2, 3}, {2, 2, 2}}, 700);
  EXPECT_NEAR(got.mass, box.mass, 1e-12 * box.mass);
  EXPECT_NEAR(got.centre.x, 0.5, 1e-15);
  EXPECT_NEAR(got.centre.y, 1, 1e-15);
  EXPECT_NEAR(got.centre.z, 1.5, 1e-15);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      EXPECT_NEAR(got.inertia.m[i][j], box.inertia.m[i][j], 1e-12 * box.mass);
}

/// Any affine image A x + b of a solid has volume det A, centre A c + b and second moments A S Aᵀ.
TEST_F(SurfaceFiles, MovedAndShearedMeshesFollowTheirVertices) {
  testing::Random random(3);
  const MeshShape box = read_surface(write("box.obj", kBox));
  for (int trial = 0; trial < 20; ++trial) {
    kernels::Mat3<double> A;
    for (auto& row : A.m)
      for (double& x : row) x = random.uniform(-1, 1);
    const auto& m = A.m;
    const double det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                       m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                       m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    if (det < 0.05) continue;
    const Vec3<double> b = random.vector(1000);
    MeshShape moved = box;
    for (std::size_t k = 0; k < moved.vertices.size(); k += 3) {
      double* p = &moved.vertices[k];
      const Vec3<double> at = A * Vec3<double>{p[0], p[1], p[2]} + b;
      p[0] = at.x, p[1] = at.y, p[2] = at.z;
    }
    const MassProperties got = mass_properties(moved, 2);
    EXPECT_NEAR(got.mass, 2 * 6 * det, 1e-9);
    const Vec3<double> centre = A * Vec3<double>{0.5, 1, 1.5} + b;
    EXPECT_NEAR(dot(got.centre - centre, got.centre - centre), 0, 1e-20);
    const kernels::Mat3<double> S =
        A * (kernels::Mat3<double>{{{1, 0, 0}, {0, 4, 0}, {0, 0, 9}}}) * transpose(A);
    const double trace = S.m[0][0] + S.m[1][1] + S.m[2][2];
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        EXPECT_NEAR(got.inertia.m[i][j], 2 * 6 * det / 12 * ((i == j ? trace : 0) - S.m[i][j]),
                    1e-8);
  }
}

/// Every point stands for nearly the same area: each face has its share of them, and none is much
/// nearer to its neighbour than a grid's.
TEST_F(SurfaceFiles, PointsAreSpreadByArea) {
  const MeshShape box = read_surface(write("box.obj", kBox));
  const double area = area_of(box);
  for (const int count : {1, 7, 60, 500}) {
    const std::vector<double> p = points_by_area(box, count);
    ASSERT_EQ(p.size(), std::size_t(3 * count));
    EXPECT_EQ(p, points_by_area(box, count));
    for (std::size_t a = 0; a < p.size(); a += 3)
      for (std::size_t b = 0; b < a; b += 3)
        EXPECT_GT(std::hypot(p[a] - p[b], p[a + 1] - p[b + 1], p[a + 2] - p[b + 2]),
                  0.5 * std::sqrt(area / count));
  }
}

TEST_F(SurfaceFiles, StlFilesAreTheSameSurfaceInTextAndInBytes) {
  const MeshShape box = read_surface(write("box.obj", kBox));
  std::string text = "solid box\n", bytes(80, 'x');
  const auto put = [&](const auto& x) {
    bytes.append(reinterpret_cast<const char*>(&x), sizeof x);
  };
  put(static_cast<std::uint32_t>(box.triangles.size()));
  for (const std::array<int, 3>& t : box.triangles) {
    text += "facet normal 0 0 0\n outer loop\n";
    for (int k = 0; k < 3; ++k) put(0.0F);
    for (const int v : t) {
      text += "  vertex";
      for (std::size_t c = 0; c < 3; ++c) {
        const double x = box.vertices[3 * std::size_t(v) + c];
        text += " " + std::to_string(x);
        put(static_cast<float>(x));
      }
      text += "\n";
    }
    text += " endloop\nendfacet\n";
    put(std::uint16_t{0});
  }
  for (const MeshShape& mesh : {read_surface(write("a.stl", text + "endsolid box\n")),
                                read_surface(write("b.STL", bytes))}) {
    EXPECT_EQ(mesh.vertices.size(), 24U);
    EXPECT_EQ(mesh.triangles.size(), 12U);
    EXPECT_NEAR(mass_properties(mesh, 700).mass, 700 * 6, 1e-9);
  }
  const auto refusal = [&](const std::string& what) {
    return error_of([&] { read_surface(write("c.stl", what)); });
  };
  EXPECT_THAT(refusal(bytes.substr(0, 300)), HasSubstr("c.stl: neither starts with 'solid'"));
  EXPECT_THAT(refusal("solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0\n"),
              HasSubstr("c.stl:4: a vertex of 2 numbers; expected x y z"));
  EXPECT_THAT(refusal("solid\nouter loop\nvertex 0 0 0\nendloop\n"),
              HasSubstr("c.stl:4: a facet of 1 vertices"));
  EXPECT_THAT(refusal("solid\nouter loop\nvertex 0 0 0\n"), HasSubstr("ends within a facet"));
  EXPECT_THAT(refusal("solid\nv 0 0 0\n"), HasSubstr("c.stl:2: 'v'; expected vertex"));
  EXPECT_THAT(refusal("solid\nendsolid\n"), HasSubstr("no faces"));
  const float endless = 1e30F;
  bytes.replace(96, 4, reinterpret_cast<const char*>(&endless), 4);
  EXPECT_THAT(refusal(bytes), HasSubstr("c.stl: triangle 0 has the number 1"));
}

TEST_F(SurfaceFiles, PlyFilesAreTheSameSurfaceInTextAndInBytes) {
  const MeshShape box = read_surface(write("box.obj", kBox));
  const auto header = [](const std::string& format) {
    return "ply\r\nformat " + format +
           " 1.0\r\ncomment by hand\nelement vertex 8\nproperty double x\nproperty uchar red\n"
           "property double y\nproperty double z\nelement edge 1\nproperty int v\n"
           "element face 12\nproperty list uchar int vertex_indices\nend_header\n";
  };
  std::string text = header("ascii"), little = header("binary_little_endian"),
              big = header("binary_big_endian");
  const auto put = [&](const auto& x) {
    std::string raw(reinterpret_cast<const char*>(&x), sizeof x);
    little += raw;
    big += std::string(raw.rbegin(), raw.rend());
    text += std::to_string(x) + " ";
  };
  for (std::size_t k = 0; k < box.vertices.size(); k += 3) {
    put(box.vertices[k]);
    put(static_cast<unsigned char>(7));
    put(box.vertices[k + 1]);
    put(box.vertices[k + 2]);
    text += "\n";
  }
  put(std::int32_t{5});
  for (const std::array<int, 3>& t : box.triangles) {
    put(static_cast<unsigned char>(3));
    for (const int v : t) put(static_cast<std::int32_t>(v));
    text += "\n";
  }
  for (const std::string& all : {text, little, big}) {
    const MeshShape mesh = read_surface(write("a.ply", all));
    EXPECT_EQ(mesh.vertices.size(), 24U);
    EXPECT_NEAR(mass_properties(mesh, 700).mass, 700 * 6, 1e-9);
  }
  const auto refusal = [&](const std::string& what) {
    return error_of([&] { read_surface(write("c.ply", what)); });
  };
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string wrong = text;
    return refusal(wrong.replace(wrong.find(from), from.size(), to));
  };
  EXPECT_THAT(refusal("plot\n"), HasSubstr("c.ply:1: expected 'ply'"));
  EXPECT_THAT(refusal("ply\nformat ascii 1.0\n"), HasSubstr("no 'end_header'"));
  EXPECT_THAT(refusal(little.substr(0, little.size() - 3)), HasSubstr("ends within its elements"));
  EXPECT_THAT(refusal(text.substr(0, text.size() - 3)), HasSubstr("ends within its elements"));
  EXPECT_THAT(changed("format ascii", "format utf8"),
              HasSubstr("c.ply:2: format 'utf8'; expected ascii, binary_little_endian"));
  EXPECT_THAT(changed("double x", "real x"), HasSubstr("c.ply:5: type 'real'"));
  EXPECT_THAT(changed("double x", "double w"), HasSubstr("a vertex without x, y or z"));
  EXPECT_THAT(changed("vertex_indices", "corners"), HasSubstr("list of vertex_indices"));
  EXPECT_THAT(changed("element vertex 8", "element vertex many"), HasSubstr("c.ply:4: 'many'"));
  EXPECT_THAT(changed("element vertex 8", "elements vertex 8"), HasSubstr("c.ply:4: 'elements'"));
  EXPECT_THAT(changed("3 0 1 2", "3 0 1 8"), HasSubstr("vertex 8; expected one of 0 to 7"));
  EXPECT_THAT(changed("3 0 1 2", "2 0 1 2"), HasSubstr("c.ply:22: a face of 2 vertices"));
  EXPECT_THAT(changed("3 0 1 2", "70000 0 1 2"),
              HasSubstr("c.ply:22: a list of 70000 numbers; expected 0 to the 107 that the rest"));
  std::string remarks;
  for (int k = 0; k < 1001; ++k) remarks += "comment\n";
  EXPECT_THAT(changed("comment by hand\n", remarks), HasSubstr("a header of more than 1000 lines"));
  EXPECT_THAT(changed("\n1.000000", "\nnan"), HasSubstr("c.ply:16: vertex 2 has nan"));
  EXPECT_THAT(changed("\n1.000000", "\none"), HasSubstr("c.ply:16: 'one'; expected a number"));
}

/// A box with a fine side keeps its mass and touches with points that are far from each other.
TEST_F(SurfaceFiles, AMeshMayTouchWithFewerPoints) {
  write("box.obj", kBox);
  const auto body = [](const std::string& count) {
    return R"(<body name="a" type="mesh" filename="box.obj" transform_type="OBJ_TO_JOINT" )"
           R"(scale="2 1 1")" +
           count + "/>";
  };
  const Scene all = scene(body("")).scene,
              few = scene(body(" general_contact_resolution=\"3\"")).scene;
  const auto points = [](const Scene& s) { return contact_points(s.links[0].body.shape); };
  EXPECT_EQ(points(all).size(), 24U);
  ASSERT_EQ(points(few).size(), 9U);
  // The first vertex of the file's faces is the origin, the farthest is (2 2 3), then (0 0 3) or
  // (2 2 0), which are equally far from both: the first in the order of faces is (2 2 0).
  const std::vector<double> expected = {0, 0, 0, 0.02, 0.02, 0.03, 0.02, 0.02, 0};
  for (std::size_t k = 0; k < 9; ++k) EXPECT_NEAR(points(few)[k], expected[k], 1e-15) << k;
  EXPECT_EQ(compile(few)->links.back().mass, compile(all)->links.back().mass);
  EXPECT_THAT(scene_error(body(" general_contact_resolution=\"9\"")),
              HasSubstr("s.xml:3: <body>: general_contact_resolution=\"9\"; expected at most the 8 "
                        "vertices"));
  EXPECT_THAT(scene_error(body(" general_contact_resolution=\"0\"")), HasSubstr("from 1 to 1000"));
}

TEST_F(SurfaceFiles, SeamsAreWelded) {
  // The top has its own copies of its four vertices.
  std::string text = kBox;
  text.replace(text.find("f 5/1/1 6/2/1 7//1 -2"), 21,
               "v 0 0 3\nv 1 0 3\nv 1 2 3\nv -0 2 3\nf 10 11 12 13");
  EXPECT_EQ(read_surface(write("box.obj", text)).vertices.size(), 24U);
}

TEST_F(SurfaceFiles, WhatIsNoClosedSurfaceIsRefusedWithItsPlace) {
  EXPECT_THAT(box_error("f 4 1 5 8\n", ""), HasSubstr("a.obj: the surface is open"));
  EXPECT_THAT(box_error("f 4 1 5 8\n", ""), HasSubstr("edge from (0 0 0) to (0 2 0)"));
  EXPECT_THAT(box_error("f 4 1 5 8\n", "f 8 5 1 4\n"), HasSubstr("disagree on what is outside"));
  EXPECT_THAT(box_error("v 1 2 3", "v 1 2 nan"), HasSubstr("a.obj:9: 'nan'; expected a number"));
  EXPECT_THAT(box_error("v 1 2 3", "v 1 2 1e300"), HasSubstr("a.obj:9: '1e300'"));
  EXPECT_THAT(box_error("v 1 2 3", "v 1 2"),
              HasSubstr("a.obj:9: a vertex of 2 numbers; expected x y z"));
  EXPECT_THAT(box_error("f 4 1 5 8", "f 4 1 5 18"),
              HasSubstr("a.obj:19: vertex 18; expected one of the 9"));
  EXPECT_THAT(box_error("f 4 1 5 8", "f 4 1 5 0"), HasSubstr("a.obj:19: vertex 0"));
  EXPECT_THAT(box_error("f 4 1 5 8", "f 4 1 5 -10"), HasSubstr("a.obj:19: vertex -10"));
  EXPECT_THAT(box_error("f 4 1 5 8", "f 4 1"), HasSubstr("a.obj:19: a face of 2 vertices"));
  EXPECT_THAT(box_error("f 4 1 5 8", "f 4 1 x"),
              HasSubstr("a.obj:19: 'x'; expected the number of a vertex"));
  EXPECT_THAT(box_error("s off", "solid box"), HasSubstr("a.obj:13: 'solid'; expected v, f"));
  EXPECT_THAT(obj_error(""), HasSubstr("a.obj: no faces"));
  EXPECT_THAT(obj_error("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 3 2 1\n"),
              HasSubstr("encloses no volume"));
  EXPECT_THAT(obj_error("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 4 2\nf 2 4 3\nf 3 4 1\n"),
              HasSubstr("the faces point inwards"));
  EXPECT_THROW(read_surface(folder_ + "none.obj"), IoError);
  EXPECT_THROW(read_surface(folder_), IoError);
}

TEST_F(SurfaceFiles, AHullClosesAnOpenSurface) {
  std::string open = kBox;
  open.erase(open.find("f 4 1 5 8"));
  open.erase(open.find("v 9 9 9\n"), 8);
  write("open.obj", open);
  const auto text = [](const std::string& more) {
    return "<redmax><robot><link name=\"l\"><joint name=\"j\" type=\"prismatic\" axis=\"0 0 1\"/>"
           "<body name=\"b\" type=\"mesh\" filename=\"open.obj\" "
           "transform_type=\"OBJ_TO_JOINT\" density=\"1\" " +
           more + "/></link></robot></redmax>";
  };
  const auto volume = [&](const std::string& more) {
    return volume_of(parse_scene(text(more), folder_ + "s.xml").scene.links[0].body.shape);
  };
  const double unit = volume("hull=\"true\"");
  EXPECT_THROW(volume(""), InputError);
  EXPECT_THROW(volume("hull=\"false\""), InputError);
  EXPECT_THROW(volume("hull=\"yes\""), InputError);
  EXPECT_THROW(volume("hull=\"true\" scale=\"1 0 1\""), InputError);
  EXPECT_NEAR(volume("hull=\"true\" scale=\"-1 2 1\""), 2 * unit, 1e-12 * unit);
  write("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  EXPECT_THROW(read_hull(folder_ + "flat.obj"), InputError);
  EXPECT_NEAR(volume_of(read_hull(folder_ + "open.obj")), 6, 1e-12);
}

TEST_F(SurfaceFiles, ContactPointsFollowTheirCount) {
  EXPECT_THAT(read_contact_points(write("p.txt", "2\n1 +2 3\n\n-1e-3 0 5\n")),
              ::testing::ElementsAre(1, 2, 3, -1e-3, 0, 5));
  EXPECT_THAT(points_error("2\n1 2 3\n"), HasSubstr("p.txt: 1 points follow the count of 2"));
  EXPECT_THAT(points_error("1\n1 2 3\n4 5 6\n"), HasSubstr("2 points follow the count of 1"));
  EXPECT_THAT(points_error("1\n1 2\n"), HasSubstr("p.txt:2: 2 numbers; expected x y z"));
  EXPECT_THAT(points_error("1\n1 2 +-3\n"), HasSubstr("p.txt:2: '+-3'"));
  EXPECT_THAT(points_error("1\n1 2 inf\n"), HasSubstr("p.txt:2: 'inf'"));
  EXPECT_THAT(points_error("x\n"), HasSubstr("p.txt:1: 'x'; expected the number of points"));
  EXPECT_THAT(points_error("0\n"), HasSubstr("p.txt:1: 0 points; expected one or more"));
  EXPECT_THAT(points_error("1 2 3\n"), HasSubstr("p.txt:1: 3 words"));
  EXPECT_THAT(points_error(""), HasSubstr("p.txt: empty"));
}

/// A mesh whose origin is at a corner moves exactly like the cuboid in the same place.
TEST_F(SurfaceFiles, ACompiledMeshIsTheCuboidInItsPlace) {
  write("box.obj", kBox);
  const std::string mesh =
      R"(<body name="a" type="mesh" filename="box.obj" density="2" quat="1 0 1 0" pos="1 2 3" )"
      R"(transform_type=)";
  const Scene placed = scene(mesh + "\"OBJ_TO_JOINT\" scale=\"2 1 1\"/>").scene;
  const Scene cuboid =
      scene(
          R"(<body name="a" type="cuboid" size="2 2 3" density="2" quat="1 0 1 0" pos="2.5 3 2"/>)")
          .scene;
  const auto a = compile(placed), b = compile(cuboid);
  const kernels::Link &x = a->links.back(), &y = b->links.back();
  EXPECT_NEAR(x.mass, y.mass, 1e-14);
  EXPECT_NEAR(x.mass_times_com.x, y.mass_times_com.x, 1e-15);
  EXPECT_NEAR(x.mass_times_com.y, y.mass_times_com.y, 1e-15);
  EXPECT_NEAR(x.mass_times_com.z, y.mass_times_com.z, 1e-15);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) EXPECT_NEAR(x.inertia.m[i][j], y.inertia.m[i][j], 1e-16);
  // In the world: the joint stands at (1 0 0) cm, turned by 90° about z.
  const Scene world =
      scene(R"(<body name="a" type="mesh" filename="box.obj" quat="1 0 0 1" pos="1 5 0" )"
            R"(transform_type="OBJ_TO_WORLD"/>)")
          .scene;
  const Pose& pose = world.links[0].body.pose;
  EXPECT_NEAR(pose.position[0], 0.05, 1e-16);
  EXPECT_NEAR(pose.position[1], 0, 1e-16);
  EXPECT_NEAR(pose.orientation[0], 1, 1e-15);
}

TEST_F(SurfaceFiles, AnAbstractBodyIsWhatItsNumbersSay) {
  write("p.txt", "3\n1 0 0\n0 2 0\n0 0 3\n");
  const SceneFile file = scene(
      R"(<body name="a" type="abstract" mass="5" inertia="2 0.1 0 3 0 4"><visual mesh="no.obj"/>
<collision contacts="p.txt" pos="0 0 1" quat="1 0 0 1"/></body>)");
  EXPECT_TRUE(file.warnings.empty());
  const auto& shape = std::get<AbstractShape>(file.scene.links[0].body.shape);
  EXPECT_NEAR(shape.mass, 5e-3, 1e-18);
  EXPECT_NEAR(shape.inertia[1], 0.1e-7, 1e-22);
  EXPECT_NEAR(shape.inertia[5], 4e-7, 1e-21);
  ASSERT_EQ(shape.contact_points.size(), 9U);
  EXPECT_NEAR(shape.contact_points[1], 0.01, 1e-17);  // x turned onto y
  EXPECT_NEAR(shape.contact_points[2], 0.01, 1e-17);
  const auto model = compile(file.scene);
  EXPECT_NEAR(model->links.back().inertia.m[0][1], 0.1e-7, 1e-22);
}

/// An abstract body has the points of a tactile hemisphere of the same radius and count, in the
/// scene's unit, placed by pos and quat.
TEST_F(SurfaceFiles, AnAbstractBodyMayTouchWithAHemisphere) {
  const std::string text = R"(<body name="a" type="abstract" mass="5" inertia="2 2 3">
<collision radius="2" count="144" pos="0 0 -0.75" quat="1 0 0 1"/></body>)";
  const Scene s = scene(text).scene;
  const auto& points = std::get<AbstractShape>(s.links[0].body.shape).contact_points;
  const std::vector<TactilePoint> expected = hemisphere_points(0.02, 144);
  ASSERT_EQ(points.size(), 3 * expected.size());
  for (std::size_t k = 0; k < expected.size(); ++k) {
    const Vector3& p = expected[k].position;
    EXPECT_NEAR(points[3 * k], -p[1], 1e-16);  // a quarter turn about z
    EXPECT_NEAR(points[3 * k + 1], p[0], 1e-16);
    EXPECT_NEAR(points[3 * k + 2], p[2] - 0.0075, 1e-16);
  }
  const auto refusal = [&](const std::string& from, const std::string& to) {
    std::string wrong = text;
    return scene_error(wrong.replace(wrong.find(from), from.size(), to));
  };
  EXPECT_THAT(refusal(" radius=\"2\"", ""),
              HasSubstr("s.xml:4: <collision>: attribute 'radius' is missing"));
  EXPECT_THAT(refusal(" count=\"144\"", ""),
              HasSubstr("s.xml:4: <collision>: attribute 'count' is missing"));
  EXPECT_THAT(refusal("radius=\"2\" count=\"144\"", ""),
              HasSubstr("no contact points; expected 'contacts' (a file)"));
  EXPECT_THAT(refusal("radius=\"2\"", "radius=\"2\" contacts=\"p.txt\""),
              HasSubstr("both 'contacts' and a hemisphere"));
  EXPECT_THAT(refusal("radius=\"2\"", "radius=\"-2\""),
              HasSubstr("s.xml:4: <collision>: radius=\"-2\""));
  EXPECT_THAT(refusal("count=\"144\"", "count=\"0\""),
              HasSubstr("s.xml:4: <collision>: count=\"0\""));
  EXPECT_THAT(refusal("count=\"144\"", "count=\"1.5\""), HasSubstr("count=\"1.5\""));
  EXPECT_THAT(refusal("radius=\"2\"", "radus=\"2\""), HasSubstr("did you mean 'radius'"));
}

TEST_F(SurfaceFiles, ScenesSayWhatIsWrongWithTheirBodies) {
  write("box.obj", kBox);
  EXPECT_THAT(scene_error(R"(<body name="a" type="mesh" filename="box.obj"/>)"),
              HasSubstr("s.xml:3: <body>: attribute 'transform_type' is missing"));
  EXPECT_THAT(
      scene_error(
          R"(<body name="a" type="mesh" filename="box.obj" transform_type="BODY_TO_JOINT"/>)"),
      HasSubstr("principal axes"));
  EXPECT_THAT(
      scene_error(
          R"(<body name="a" type="mesh" filename="box.obj" transform_type="OBJ_TO_JOIN"/>)"),
      HasSubstr("did you mean 'OBJ_TO_JOINT'"));
  EXPECT_THAT(scene_error(R"(<body name="a" type="mesh" transform_type="OBJ_TO_JOINT"/>)"),
              HasSubstr("'filename' is missing"));
  EXPECT_THAT(scene_error(R"(<body name="a" type="mesh" filename="box.obj" scale="1 0 1" )"
                          R"(transform_type="OBJ_TO_JOINT"/>)"),
              HasSubstr("scale has 0"));
  EXPECT_THAT(scene_error(R"(<body name="a" type="abstract" inertia="1 1 1"/>)"),
              HasSubstr("'mass' is missing"));
  EXPECT_THAT(scene_error(R"(<body name="a" type="abstract" mass="1" inertia="1 1"/>)"),
              HasSubstr("inertia has 2 numbers; expected 3"));
  EXPECT_EQ(scene_error(R"(<body name="a" type="abstract" mass="1" inertia="1 1 3"/>)"), "");
  EXPECT_THAT(scene_error(R"(<body name="a" type="abstract" mass="1" inertia="1 1 -3"/>)"),
              HasSubstr("inertia=\"1e-07 0 0 1e-07 0 -3e-07\" of mass 0.001; expected positive"));
  EXPECT_THAT(scene_error(R"(<body name="a" type="abstract" mass="1" inertia="1 2 0 1 0 1"/>)"),
              HasSubstr("expected positive principal moments"));
  EXPECT_THAT(scene_error(R"(<body name="a" type="abstract" mass="0" inertia="1 1 1"/>)"),
              HasSubstr("expected positive principal moments, or zeros: of a point, or of mass 0"));
}

class TouchedMesh : public SurfaceFiles {
 protected:
  /// A mesh and a box that touches, and a sensor on the box.
  SceneFile with_contact(const std::string& resolution, const std::string& general,
                         const std::string& primitive) {
    write("box.obj", kBox);
    const std::string contact =
        general.empty() ? ""
                        : "<contact><general_primitive_contact general_body=\"" + general +
                              "\" primitive_body=\"" + primitive + "\"/></contact>";
    return parse_scene(
        R"(<tangere><robot><link name="a"><joint name="a" type="free3d"/>
<body name="a" type="mesh" filename="box.obj" transform_type="OBJ_TO_JOINT" )" +
            resolution +
            R"(/></link>
<link name="b"><joint name="b" type="free3d"/><body name="b" type="cuboid" size="1 1 1"/>)"
            R"(</link></robot>)" +
            contact + R"(<sensor><tactile name="skin" body="b" type="rect_array" rect_pos0="0 0 0.5"
rect_pos1="0.1 0.1 0.5" axis0="1 0 0" axis1="0 1 0" resolution="2 2"/></sensor></tangere>)",
        folder_ + "s.xml");
  }
};

/// Without a distance function a body can touch but not be touched, in a file or in a scene built
/// in code. No sensor feels it, and that is told.
TEST_F(TouchedMesh, NothingTouchesAMeshWithoutCells) {
  const std::string none = "resolution=\"0\"";
  EXPECT_THAT(error_of([&] { with_contact(none, "b", "a"); }),
              HasSubstr("primitive_body 'a' is a mesh body, which has no distance; expected a "
                        "resolution of 1 or more"));
  SceneFile file = with_contact(none, "a", "b");
  ASSERT_EQ(file.warnings.size(), 1U);
  EXPECT_THAT(file.warnings[0], HasSubstr("sensor 'skin' on body 'b' can feel nothing"));
  EXPECT_THAT(file.warnings[0], HasSubstr("'a' has none"));
  Scene& s = file.scene;
  const auto model = compile(s);
  EXPECT_EQ(model->pairs[0].n_points, 8);
  EXPECT_TRUE(model->sensors[0].targets.empty());
  std::swap(s.pair_contacts[0].general_body, s.pair_contacts[0].primitive_body);
  EXPECT_THAT(error_of([&] { compile(s); }),
              HasSubstr("primitive_body 'a' is a mesh body, which has no distance"));
}

TEST_F(TouchedMesh, AnErrorTakesThePlaceOfItsResolution) {
  const SceneFile file = with_contact("error=\"0.05\"", "b", "a");
  const auto& mesh = std::get<MeshShape>(file.scene.links[0].body.shape);
  EXPECT_GT(mesh.error, 0);
  EXPECT_LE(compile(file.scene)->mesh_info.at(0).error, mesh.error);
  EXPECT_THAT(error_of([&] { with_contact("error=\"0.05\" resolution=\"9\"", "b", "a"); }),
              HasSubstr("expected error or resolution, not both"));
  EXPECT_THAT(error_of([&] { with_contact("error=\"0\"", "b", "a"); }), HasSubstr("error"));
}

TEST_F(TouchedMesh, ItsDistanceIsMadeWhereSomethingAsksForIt) {
  const SceneFile file = with_contact("resolution=\"20\"", "b", "a");
  EXPECT_TRUE(file.warnings.empty());
  const auto model = compile(file.scene);
  ASSERT_EQ(model->mesh_grids.size(), 1U);
  EXPECT_EQ(model->sensors[0].targets.size(), 1U);
  EXPECT_EQ(model->pairs[0].grid, model->bodies[0].grid);
  const auto longest =
      *std::max_element(model->bodies[0].grid->cells, model->bodies[0].grid->cells + 3);
  EXPECT_EQ(longest, 20 + 8);
  Scene s = file.scene;
  s.sensors.clear();
  s.pair_contacts.clear();
  EXPECT_TRUE(compile(s)->mesh_grids.empty());
}

TEST_F(TouchedMesh, AWallThatIsFeltAndPassedThroughIsTold) {
  const SceneFile file = with_contact("", "", "");
  ASSERT_EQ(file.warnings.size(), 1U);
  EXPECT_THAT(file.warnings[0],
              HasSubstr("sensor 'skin' on body 'b' reads forces that nothing exerts"));
}

TEST_F(TouchedMesh, NumbersOfPointsAndCellsAreChecked) {
  for (const auto& [bad, message] : {std::pair{"count=\"0\"", "count"},
                                     {"count=\"5\" pitch=\"0.1\"", "both 'count' and 'pitch'"},
                                     {"pitch=\"1e-6\"", "points; expected 1 to 4096"},
                                     {"resolution=\"300\"", "resolution"}})
    EXPECT_THAT(error_of([&, text = bad] { with_contact(text, "b", "a"); }), HasSubstr(message))
        << bad;
  EXPECT_EQ(compile(with_contact("count=\"50\"", "a", "b").scene)->pairs[0].n_points, 50);
}

}  // namespace
}  // namespace tangere
