// SPDX-License-Identifier: Apache-2.0
// Tests surface files as programs of all kinds write them: corners that differ by rounding, parts
// that lie flush on each other, faces that are not convex, and words, marks and orders of elements
// beyond the common ones. Volumes and areas are those of the solid in closed form.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>
#include <vector>

#include "engine/base/error.hpp"
#include "engine/model/model.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/step/stepper.hpp"
#include "io/files/csv.hpp"
#include "io/hdf5/h5.hpp"
#include "io/scene/polygons.hpp"
#include "io/scene/scene_reader.hpp"
#include "io/scene/surface_files.hpp"
#include "io/scene/tactile_layouts.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using kernels::Vec3;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kMark = "\xEF\xBB\xBF";
constexpr const char* kPointer =
    "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n";

/// A box as an OBJ file whose first vertex has the number `first`. `diagonal`: how its face at the
/// lower x is cut into triangles.
std::string box(const Vector3& low, const Vector3& high, int first = 1, int diagonal = 0) {
  std::string text;
  for (int k = 0; k < 8; ++k)
    text += fmt::format("v {} {} {}\n", k & 1 ? high[0] : low[0], k & 2 ? high[1] : low[1],
                        k & 4 ? high[2] : low[2]);
  for (const auto& [a, b, c, d] : std::vector<std::array<int, 4>>{
           {0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {1, 3, 7, 5}})
    text += fmt::format("f {} {} {} {}\n", first + a, first + b, first + c, first + d);
  constexpr int kLower[] = {0, 4, 6, 2};
  const auto at = [&](int k) { return first + kLower[(k + diagonal) % 4]; };
  return text + fmt::format("f {} {} {}\nf {} {} {}\n", at(0), at(1), at(2), at(0), at(2), at(3));
}

class SurfaceKinds : public ::testing::Test {
 protected:
  SurfaceKinds()
      : folder_(::testing::TempDir() + "tangere_kinds_" + std::to_string(getpid()) + "/") {
    std::filesystem::create_directories(folder_);
  }
  ~SurfaceKinds() override { std::filesystem::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ + name, std::ios::binary) << text;
    return folder_ + name;
  }
  MeshShape read(const std::string& name, const std::string& text) {
    return read_surface(write(name, text));
  }
  template <class F>
  static std::string error_of(const F& f) {
    try {
      f();
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  }
  std::string refusal(const std::string& name, const std::string& text) {
    return error_of([&] { read(name, text); });
  }
  /// A cube as a text STL file, with the first corner of one triangle moved along x.
  static std::string stl_cube(double moved, double size = 1) {
    constexpr int kFaces[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                  {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    std::string text = "solid\n";
    for (const auto& f : kFaces)
      for (const int k : {1, 2}) {
        text += "facet normal 0 0 0\nouter loop\n";
        for (const int v : {f[0], f[k], f[k + 1]}) {
          const double x = (v & 1) * size + std::exchange(moved, 0.0);
          text += fmt::format("vertex {} {} {}\n", x, (v >> 1 & 1) * size, (v >> 2) * size);
        }
        text += "endloop\nendfacet\n";
      }
    return text + "endsolid\n";
  }

  std::string folder_;
};

TEST_F(SurfaceKinds, CornersThatDifferByRoundingAreOne) {
  for (const double size : {1e-3, 1.0, 1e3})
    for (const double part : {1e-17, -3e-14, 9e-9}) {
      const MeshShape cube = read("a.stl", stl_cube(part * size, size));
      EXPECT_EQ(cube.vertices.size(), 24U) << size << " " << part;
      EXPECT_NEAR(volume_of(cube) / (size * size * size), 1, 1e-8);
    }
  EXPECT_THAT(refusal("a.stl", stl_cube(3e-7)),
              AllOf(HasSubstr("the surface is open"), HasSubstr("(0 0 0)"),
                    HasSubstr("are 3e-07 apart, 3e-07 of the longest side"),
                    HasSubstr("up to 1e-08 of it counts as rounding")));
  EXPECT_THAT(refusal("a.stl", stl_cube(0.2)), ::testing::Not(HasSubstr("apart")));
}

/// The edge of 1e-9 between two corners of a closed surface is no rounding.
TEST_F(SurfaceKinds, CornersOfAClosedSurfaceStayApart) {
  const std::string text =
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1e-9 0 1\n"
      "f 1 3 2\nf 1 4 3\nf 3 4 5\nf 2 3 5\nf 1 2 5\nf 1 5 4\n";
  EXPECT_EQ(read("a.obj", text).vertices.size(), 15U);
}

TEST_F(SurfaceKinds, WallsBetweenFlushBlocksGo) {
  const std::string left = box({-1, 0, 0}, {0, 2, 1});
  for (const int diagonal : {0, 1})
    for (const double gap : {0.0, 1e-17}) {
      const MeshShape both = read("a.obj", left + box({gap, 0, 0}, {3, 2, 1}, 9, diagonal));
      EXPECT_NEAR(area_of(both), 28, 1e-12) << diagonal << " " << gap;  // of the box of 4 × 2 × 1
      EXPECT_NEAR(volume_of(both), 8, 1e-12);
      EXPECT_EQ(both.triangles.size(), 20U) << diagonal << " " << gap;
      EXPECT_EQ(both.vertices.size(), 36U);
      EXPECT_EQ(surface_fault(both), "");
    }
  // A row of three, whose middle one loses two walls; a block apart from it stays.
  const MeshShape row =
      read("a.obj", left + box({0, 0, 0}, {1, 2, 1}, 9, 1) + box({1, 0, 0}, {2, 2, 1}, 17) +
                        box({5, 0, 0}, {6, 1, 1}, 25));
  EXPECT_NEAR(area_of(row), 22 + 6, 1e-12);
  EXPECT_NEAR(volume_of(row), 7, 1e-12);
  // A thin plate is no wall.
  EXPECT_NEAR(area_of(read("a.obj", box({0, 0, 0}, {1, 1, 1e-6}))), 2 + 4e-6, 1e-12);
}

TEST_F(SurfaceKinds, WallsThatCoverEachOtherInPartAreCut) {
  const std::string low = box({0, 0, 0}, {4, 4, 1});
  const auto area = [&](const std::string& other) { return area_of(read("a.obj", low + other)); };
  EXPECT_NEAR(area(box({1, 1, 1}, {2, 2, 2}, 9)), 48 + 4, 1e-12);       // on the top
  EXPECT_NEAR(area(box({2, 2, 1}, {5, 5, 2}, 9)), 48 + 30 - 8, 1e-12);  // over its edges
  EXPECT_NEAR(area(box({2, 2, 1 + 1e-6}, {5, 5, 2}, 9)), 70, 1e-5);
  EXPECT_NEAR(area(box({1, 1, 1.001}, {2, 2, 2}, 9)), 48 + 2 + 4 * 0.999, 1e-12);  // a gap
  EXPECT_NEAR(area(box({4, 4, 0}, {5, 5, 1}, 9)), 48 + 6, 1e-12);  // an edge in common
}

/// Cuboids of a grid that do not overlap. Volume and area of their union are counted by its cells.
TEST_F(SurfaceKinds, HeapsOfFlushBlocksAreOneSolid) {
  testing::Random random(5);
  constexpr int kSide = 6;
  for (int trial = 0; trial < 40; ++trial) {
    std::array<int, kSide * kSide * kSide> owner{};
    const auto cell = [&](int x, int y, int z) -> int {
      const bool inside = std::min({x, y, z}) >= 0 && std::max({x, y, z}) < kSide;
      return inside ? owner[std::size_t((x * kSide + y) * kSide + z)] : 0;
    };
    const bool turned = trial % 2 == 1, rounded = trial % 4 == 3;
    kernels::Mat3<double> R = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    if (turned) R = {{{0.36, 0.48, -0.8}, {-0.8, 0.6, 0}, {0.48, 0.64, 0.6}}};
    std::string text;
    int blocks = 0;
    for (int attempt = 0; attempt < 30; ++attempt) {
      Vector3 low{}, high{};
      for (std::size_t c = 0; c < 3; ++c) {
        low[c] = std::floor(random.uniform(0, kSide - 1e-9));
        high[c] = std::min(low[c] + std::floor(random.uniform(1, 4)), double(kSide));
      }
      bool is_free = true;
      const auto each = [&](const auto& f) {
        for (int x = int(low[0]); x < high[0]; ++x)
          for (int y = int(low[1]); y < high[1]; ++y)
            for (int z = int(low[2]); z < high[2]; ++z) f(x, y, z);
      };
      each([&](int x, int y, int z) { is_free &= cell(x, y, z) == 0; });
      if (!is_free) continue;
      each([&](int x, int y, int z) {
        owner[std::size_t((x * kSide + y) * kSide + z)] = blocks + 1;
      });
      std::istringstream lines(box(low, high, 1 + 8 * blocks++, attempt % 2));
      for (std::string line; std::getline(lines, line);) {
        std::istringstream words(line);
        std::string word;
        Vec3<double> p;
        words >> word >> p.x >> p.y >> p.z;
        if (word == "v") {
          p = R * p;
          if (rounded) p = {double(float(p.x)), double(float(p.y)), double(float(p.z))};
          line = fmt::format("v {} {} {}", p.x, p.y, p.z);
        }
        text += line + "\n";
      }
    }
    int volume = 0, area = 0;
    for (int x = 0; x < kSide; ++x)
      for (int y = 0; y < kSide; ++y)
        for (int z = 0; z < kSide; ++z) {
          if (cell(x, y, z) == 0) continue;
          ++volume;
          for (const int step : {-1, 1})
            area += (cell(x + step, y, z) == 0) + (cell(x, y + step, z) == 0) +
                    (cell(x, y, z + step) == 0);
        }
    const FileSurface surface = read_faces(write("a.obj", text));
    EXPECT_EQ(surface.fault, "") << trial;
    EXPECT_EQ(surface_fault(surface.closed), "") << trial;
    const double close = rounded ? 1e-4 : 1e-9;
    EXPECT_NEAR(volume_of(surface.closed), volume, close) << trial;
    EXPECT_NEAR(area_of(surface.closed), area, close) << trial;
  }
}

/// A table of this outline, 80 mm thick, as an OBJ file.
std::string slab(const std::vector<std::array<double, 2>>& outline) {
  std::string text, top = "f", bottom, sides;
  const std::size_t n = outline.size();
  for (std::size_t k = 0; k < n; ++k) {
    for (const double z : {-0.08, 0.0})
      text += fmt::format("v {} {} {}\n", outline[k][0], outline[k][1], z);
    const std::size_t next = (k + 1) % n;
    top += fmt::format(" {}", 2 * k + 2);
    bottom = fmt::format(" {}", 2 * k + 1) + bottom;
    sides += fmt::format("f {} {} {} {}\n", 2 * k + 1, 2 * next + 1, 2 * next + 2, 2 * k + 2);
  }
  return text + top + "\nf" + bottom + "\n" + sides;
}

/// A slider crosses the plane where two blocks of a table meet, as it slides on one block:
/// x = v t - mu g t²/2, at a constant height.
TEST_F(SurfaceKinds, ASliderCrossesFlushBlocksAsOneBlock) {
  const auto run = [&](const std::string& table) {
    write("table.obj", table);
    const Model model(
        parse_scene(R"(<tangere><option unit="m-kg" gravity="0 0 -9.81" timestep="0.001"/>
<robot><link name="table"><joint name="table" type="fixed"/><body name="table" type="mesh"
  transform_type="OBJ_TO_JOINT" filename="table.obj" density="1000" resolution="40"/></link></robot>
<robot><link name="slider"><joint name="slider" type="free3d" pos="-0.06 0.003 0.01"/>
  <body name="slider" type="cuboid" size="0.04 0.04 0.02" density="500"
    general_contact_resolution="2 2 2"/></link></robot>
<initial><joint name="slider" q="0 0 0 1 0 0 0" v="0.5 0 0 0 0 0"/></initial>
<contact><general_primitive_contact general_body="slider" primitive_body="table" kn="5000" kt="20"
  mu="0.1" damping="300"/></contact></tangere>)",
                    folder_ + "s.xml")
            .scene);
    Batch batch(model, 1, 1);
    Stepper stepper(model);
    for (int k = 0; k < 300; ++k) stepper.step(batch, {});
    std::array<double, 7> q{};
    batch.get_q(0, q);
    return q;
  };
  const std::string left = box({-0.2, -0.1, -0.08}, {0, 0.1, 0});
  const auto compare = [&](const std::string& right, const std::string& whole) {
    const std::array<double, 7> two = run(left + right), one = run(whole);
    EXPECT_NEAR(one[0], 0.5 * 0.3 - 0.5 * 0.981 * 0.09, 3e-3);
    for (std::size_t k = 0; k < 7; ++k) EXPECT_NEAR(two[k], one[k], 1e-8) << k;
  };
  compare(box({0, -0.1, -0.08}, {0.2, 0.1, 0}, 9),
          slab({{-0.2, -0.1}, {0.2, -0.1}, {0.2, 0.1}, {-0.2, 0.1}}));
  compare(box({0, -0.15, -0.08}, {0.2, 0.07, 0}, 9, 1), slab({{-0.2, -0.1},
                                                              {0, -0.1},
                                                              {0, -0.15},
                                                              {0.2, -0.15},
                                                              {0.2, 0.07},
                                                              {0, 0.07},
                                                              {0, 0.1},
                                                              {-0.2, 0.1}}));
}

// --- polygons ---

using Outline = std::vector<std::array<double, 2>>;

double signed_area(const Outline& p) {
  double twice = 0;
  for (std::size_t k = 0; k < p.size(); ++k) {
    const auto &a = p[k], &b = p[(k + 1) % p.size()];
    twice += a[0] * b[1] - b[0] * a[1];
  }
  return 0.5 * twice;
}

/// Cuts the outline, tilted in space, and compares the sum of the areas of all triangles, each
/// above 0, with that inside the outline: they agree only if the triangles do not overlap.
void expect_exact_cut(Outline p, const std::string& what) {
  for (std::size_t turn = 0; turn < p.size(); ++turn) {
    std::vector<Vector3> at;
    std::vector<int> corners;
    for (const auto& [x, y] : p) {
      corners.push_back(static_cast<int>(at.size()));
      at.push_back({0.6 * x + 2, y, 0.8 * x - 1});
    }
    std::vector<std::array<int, 3>> triangles;
    EXPECT_EQ(cut_polygon(at, corners, triangles), "") << what << " " << turn;
    ASSERT_EQ(triangles.size(), p.size() - 2);
    MeshShape mesh;
    mesh.triangles = triangles;
    for (const Vector3& v : at) mesh.vertices.insert(mesh.vertices.end(), v.begin(), v.end());
    EXPECT_NEAR(area_of(mesh), signed_area(p), 1e-12) << what << " " << turn;
    std::rotate(p.begin(), p.begin() + 1, p.end());
  }
}

TEST(Polygons, AreCutExactlyFromAnyCorner) {
  expect_exact_cut({{0, 0}, {4, 0}, {4, 3}, {3, 3}, {3, 1}, {1, 1}, {1, 3}, {0, 3}}, "channel");
  expect_exact_cut({{0, 0}, {2, 0}, {2, 1}, {1, 1}, {1, 2}, {0, 2}}, "angle");
  expect_exact_cut({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {3, 2}, {2, 1}, {1, 1}, {0, 2}}, "straight");
  expect_exact_cut({{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {1, 1}},
                   "hole");
  Outline comb = {{0, 0}, {20, 0}};
  for (int k = 19; k >= 0; --k) comb.push_back({k + 0.5 * (k % 2), k % 2 == 1 ? 0.1 : 3.0});
  expect_exact_cut(comb, "comb");
  Outline spiral;
  for (const bool back : {false, true})
    for (int k = 0; k <= 60; ++k) {
      const double turn = 0.3 * (back ? 60 - k : k), r = 1 + 0.1 * turn + (back ? 0 : 0.3);
      spiral.push_back({r * std::cos(turn), r * std::sin(turn)});
    }
  expect_exact_cut(spiral, "spiral");
}

TEST_F(SurfaceKinds, ReentrantFacesCoverTheirFaceAlone) {
  const Outline channel = {{0, 0}, {4, 0}, {4, 3}, {3, 3}, {3, 1}, {1, 1}, {1, 3}, {0, 3}};
  std::string obj, ply =
                       "ply\nformat ascii 1.0\nelement vertex 16\nproperty float x\n"
                       "property float y\nproperty float z\nelement face 10\n"
                       "property list uchar int vertex_indices\nend_header\n";
  const auto corner = [&](const std::string& text) {
    obj += "v " + text;
    ply += text;
  };
  for (const double z : {0.0, 5.0})
    for (const auto& [x, y] : channel) corner(fmt::format("{} {} {}\n", x, y, z));
  const auto face = [&](const std::vector<int>& vertices) {
    obj += "f";
    ply += fmt::format("{}", vertices.size());
    for (const int v : vertices) {
      obj += fmt::format(" {}", v + 1);
      ply += fmt::format(" {}", v);
    }
    obj += "\n";
    ply += "\n";
  };
  face({7, 6, 5, 4, 3, 2, 1, 0});
  face({8, 9, 10, 11, 12, 13, 14, 15});
  for (int k = 0; k < 8; ++k) face({k, (k + 1) % 8, 8 + (k + 1) % 8, 8 + k});
  for (const MeshShape& mesh : {read("a.obj", obj), read("a.ply", ply)}) {
    EXPECT_NEAR(volume_of(mesh), 40, 1e-12);
    EXPECT_NEAR(area_of(mesh), 2 * 8 + 18 * 5, 1e-12);
    const std::vector<double> points = points_by_area(mesh, 500);
    for (std::size_t k = 0; k < points.size(); k += 3)  // none in the groove
      EXPECT_FALSE(points[k] > 1.001 && points[k] < 2.999 && points[k + 1] > 1.001) << k;
  }
}

TEST_F(SurfaceKinds, AFaceThatCrossesItselfIsRefusedWithItsLine) {
  const std::string text = "v 0 0 0\nv 3 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 9\nf 1 5 2\nf 1 2 3 4\n";
  EXPECT_THAT(refusal("a.obj", text),
              HasSubstr("a.obj:7: a face of 4 corners has edges that cross each other; expected"));
  EXPECT_NEAR(volume_of(read_hull(write("a.obj", text))), 6, 1e-12);
}

// --- words, marks and orders ---

TEST_F(SurfaceKinds, ObjFilesMayHaveAMarkLongLinesAndWordsOfOthers) {
  std::string text = kMark + box({0, 0, 0}, {1, 2, 3});
  text.replace(text.find("f 1 3 4 2"), 9, "f 1 3 \\\r\n 4 \\\n2 # a remark \\");
  for (const char* word : {"mg 1 0.5", "lod 3", "usemap off", "vw 1", "t 0 1", "bevel on", "g a\\b",
                           "cstype bezier", "curv 0 1 1 2", "shadow_obj x", "# C:\\models\\"})
    text += std::string(word) + "\n";
  text += "vt 0 0\n";
  EXPECT_NEAR(volume_of(read("a.obj", text)), 6, 1e-12);
  EXPECT_THAT(refusal("a.obj", text + "f 1 3 \\\n4 99\n"), HasSubstr("a.obj:31: vertex 99"));
  EXPECT_THAT(refusal("a.obj", text + "surf 0 1 0 1 1\n"), HasSubstr("'surf', a free-form"));
  EXPECT_THAT(refusal("a.obj", text + "face 1 2 3\n"), HasSubstr("'face'; expected v, f"));
  std::string backwards = box({0, 0, 0}, {1, 2, 3});
  backwards.replace(backwards.find("f 1 3 4 2"), 9, "f -8 -6 \\\n -5 -7");
  EXPECT_NEAR(volume_of(read("a.obj", backwards)), 6, 1e-12);
}

TEST_F(SurfaceKinds, StlFilesInTextMayBeInCapitals) {
  std::string text = stl_cube(0);
  std::string capitals = text;
  for (char& c : capitals) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  for (const std::string& other : {"  " + capitals, kMark + text, "\r\n\t" + text})
    EXPECT_NEAR(volume_of(read("a.stl", other)), 1, 1e-12);
  for (const char* end : {"endsolid", "endfacet", "endloop"})
    for (std::size_t at = 0; (at = text.find(end, at)) != std::string::npos;)
      text.insert(at + 3, " ");
  EXPECT_NEAR(volume_of(read("a.stl", text)), 1, 1e-12);
  EXPECT_THAT(refusal("a.stl", "solids"), HasSubstr("a.stl:1: 'solids'"));
}

TEST_F(SurfaceKinds, PlyFilesMayHaveStripsAndFacesBeforeVertices) {
  const std::string header = std::string(kMark) + "ply\nformat ascii 1.0\n",
                    vertex =
                        "element vertex 4\nproperty float x\nproperty float y\n"
                        "property float z\n",
                    vertices = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
  const std::string faces = "element face 4\nproperty list uchar int vertex_index\n";
  EXPECT_NEAR(
      volume_of(read("a.ply", header + faces + vertex +
                                  "end_header\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n" + vertices)),
      1.0 / 6, 1e-15);
  EXPECT_THAT(refusal("a.ply", header + faces + vertex +
                                   "end_header\n3 0 2 1\n3 0 1 3\n3 1 2 4\n3 0 3 2\n" + vertices),
              HasSubstr("a.ply:12: vertex 4; expected one of 0 to 3"));
  // The tetrahedron as one strip, and as two.
  const std::string strips = "element tristrips 1\nproperty list int int vertex_indices\n";
  for (const char* list : {"6 0 2 1 3 0 2", "9 0 2 1 3 -1 1 3 0 2"})
    EXPECT_EQ(refusal("a.ply", header + vertex + strips + "end_header\n" + vertices + list), "")
        << list;
  EXPECT_THAT(refusal("a.ply", header + vertex + strips + "end_header\n" + vertices + "3 0 1 -2"),
              HasSubstr("vertex -2; expected one of 0 to 3"));
}

TEST_F(SurfaceKinds, PointsWithoutFacesHaveAHull) {
  std::string points;
  for (int k = 0; k < 8; ++k) points += fmt::format("v {} {} {}\n", k & 1, k >> 1 & 1, k >> 2);
  write("a.obj", points);
  EXPECT_NEAR(volume_of(read_hull(folder_ + "a.obj")), 1, 1e-12);
  EXPECT_THAT(refusal("a.obj", points), HasSubstr("a.obj: no faces; expected a closed surface"));
  write("a.obj", box({0, 0, 0}, {1, 1, 1}) + "v 0.5 0.5 4\n");  // one that no face uses
  EXPECT_NEAR(volume_of(read_hull(folder_ + "a.obj")), 2, 1e-12);
  write("a.ply",
        "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n");
  EXPECT_NEAR(volume_of(read_hull(folder_ + "a.ply")), 1.0 / 6, 1e-12);
}

TEST_F(SurfaceKinds, EveryTextMayBeginWithAByteOrderMark) {
  EXPECT_EQ(read_contact_points(write("a.txt", std::string(kMark) + "1\n1 2 3\n")).size(), 3U);
  EXPECT_EQ(read_tactile_points(write("b.txt", std::string(kMark) +
                                                   "1\n\"0 0 0\" \"0 0\" \"0 0 1\" \"1 0 0\" \"0 "
                                                   "1 0\"\n"))
                .size(),
            1U);
  EXPECT_EQ(read_csv(write("c.csv", std::string(kMark) + "1,2\n"), 2).size(), 1U);
  EXPECT_THAT(refusal("a.obj", std::string("\xFF\xFEv\0 \0", 6)), HasSubstr("text in UTF-16"));
}

TEST_F(SurfaceKinds, APointerOfGitLfsIsNamed) {
  const std::string named = ":1: a pointer of Git LFS to a file that was not fetched; expected ";
  for (const char* name : {"a.obj", "a.stl", "a.ply"})
    EXPECT_THAT(refusal(name, kPointer), AllOf(HasSubstr(name + named), HasSubstr("git lfs pull")));
  write("a.txt", kPointer);
  EXPECT_THAT(error_of([&] { read_contact_points(folder_ + "a.txt"); }), HasSubstr(named));
  EXPECT_THAT(error_of([&] { read_tactile_points(folder_ + "a.txt"); }), HasSubstr(named));
  EXPECT_THAT(error_of([&] { read_csv(folder_ + "a.txt", 2); }), HasSubstr(named));
  EXPECT_THAT(error_of([&] { read_scene(folder_ + "a.txt"); }), HasSubstr(named));
  EXPECT_THAT(error_of([&] { h5::open_file(folder_ + "a.txt"); }), HasSubstr(named));
}

}  // namespace
}  // namespace tangere
