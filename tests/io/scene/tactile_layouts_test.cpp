// SPDX-License-Identifier: Apache-2.0
// Tests points of curved pads: evenly spread, in order, with axes that turn the right way. Also
// tests messages for malformed files.
#include "io/scene/tactile_layouts.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <set>

#include "engine/base/error.hpp"
#include "engine/model/model.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

void expect_frame(const TactilePoint& p) {
  EXPECT_NEAR(dot(p.normal, p.normal), 1, 1e-14);
  EXPECT_NEAR(dot(p.axis0, p.axis0), 1, 1e-14);
  const Vector3 third = cross(p.axis0, p.axis1);
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(third[k], p.normal[k], 1e-14);
}

class TacFile {
 public:
  explicit TacFile(const std::string& text)
      : path_(std::filesystem::path(::testing::TempDir()) /
              (std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) +
               ".txt")) {
    std::ofstream(path_) << text;
  }
  ~TacFile() { std::filesystem::remove(path_); }
  [[nodiscard]] std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

std::string points_error(const std::string& text) {
  const TacFile file(text);
  try {
    read_tactile_points(file.path());
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(TactileLayouts, AHemisphereIsCoveredEvenly) {
  for (const int count : {1, 302, 2000}) {
    const std::vector<TactilePoint> points = hemisphere_points(0.01, count);
    ASSERT_EQ(points.size(), std::size_t(count));
    Vector3 mean{};
    for (const TactilePoint& p : points) {
      expect_frame(p);
      EXPECT_GT(p.position[2], 0);
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_NEAR(p.position[k], 0.01 * p.normal[k], 1e-16);
        mean[k] += p.normal[k] / count;
      }
      EXPECT_LE(p.axis0[2], 0);  // away from the pole
    }
    // The mean normal of a hemisphere is half its axis.
    if (count > 100) {
      EXPECT_NEAR(mean[0], 0, 5e-3);
      EXPECT_NEAR(mean[1], 0, 5e-3);
      EXPECT_NEAR(mean[2], 0.5, 1e-12);
      double nearest_of_all = 1;
      for (std::size_t i = 0; i < points.size(); ++i)
        for (std::size_t j = 0; j < i; ++j) {
          Vector3 d{};
          for (std::size_t k = 0; k < 3; ++k) d[k] = points[i].position[k] - points[j].position[k];
          nearest_of_all = std::min(nearest_of_all, std::sqrt(dot(d, d)));
        }
      EXPECT_GT(nearest_of_all, 0.6 * 0.01 * std::sqrt(2 * M_PI / count));
    }
  }
}

TEST(TactileLayouts, AHemisphereIsDrawnWithOnePixelAPoint) {
  std::vector<TactilePoint> points = hemisphere_points(0.01, 302);
  draw_hemisphere(20, 20, points);
  std::set<std::array<int, 2>> taken;
  std::array<std::array<int, 2>, 2> halves{};
  for (const TactilePoint& p : points) {
    const auto [row, col] = p.pixel;
    ASSERT_TRUE(row >= 0 && row < 20 && col >= 0 && col < 20);
    EXPECT_TRUE(taken.insert(p.pixel).second) << row << ' ' << col;
    // Lower rows are at negative x and lower columns at negative y, except for displaced points.
    if (std::abs(p.position[0]) > 2e-3) {
      EXPECT_EQ(row >= 10, p.position[0] > 0);
    }
    if (std::abs(p.position[1]) > 2e-3) {
      EXPECT_EQ(col >= 10, p.position[1] > 0);
    }
    // A square ring holds the same share of points as of area.
    const double ring = std::max(std::abs(row - 9.5), std::abs(col - 9.5)) / 10;
    EXPECT_NEAR(ring, std::sqrt(1 - p.normal[2]), 0.15);
    ++halves[0][row >= 10], ++halves[1][col >= 10];
  }
  for (const auto& half : halves) EXPECT_NEAR(half[0], 151, 5);
  points = hemisphere_points(0.01, 400);
  draw_hemisphere(20, 20, points);
  taken.clear();
  for (const TactilePoint& p : points) taken.insert(p.pixel);
  EXPECT_EQ(taken.size(), 400U) << "every pixel is some point's";
  points = hemisphere_points(1, 1);
  draw_hemisphere(1, 1, points);
  EXPECT_EQ(points[0].pixel, (std::array<int, 2>{0, 0}));
}

TEST(TactileLayouts, ACylinderIsAnImageRolledUp) {
  const std::vector<TactilePoint> points = cylinder_points(0.02, 0.06, 4, 12);
  ASSERT_EQ(points.size(), 48U);
  for (const TactilePoint& p : points) expect_frame(p);
  EXPECT_EQ(points[0].pixel, (std::array<int, 2>{0, 0}));
  EXPECT_EQ(points[47].pixel, (std::array<int, 2>{3, 11}));
  EXPECT_NEAR(points[15].position[0], 0, 1e-16);
  EXPECT_NEAR(points[15].position[1], 0.02, 1e-16);
  EXPECT_NEAR(points[15].position[2], -0.01, 1e-16);
  EXPECT_EQ(cylinder_points(0.02, 0.06, 1, 3)[1].position[2], 0);
}

TEST(TactileLayouts, AMeshIsCutAtThePitch) {
  MeshShape mesh;
  mesh.vertices = {0, 0, 0, 3, 0, 0, 0, 3, 0, 0, 0, 1};
  mesh.triangles = {{0, 1, 2}};
  const std::vector<TactilePoint> points =
      mesh_points(mesh, 1.5, 100);  // the long edge is 4.24: three cuts
  ASSERT_EQ(points.size(), 9U);
  Vector3 mean{};
  for (const TactilePoint& p : points) {
    expect_frame(p);
    EXPECT_EQ(p.normal, (Vector3{0, 0, 1}));
    EXPECT_GT(p.position[0], 0);
    EXPECT_GT(p.position[1], 0);
    EXPECT_LT(p.position[0] + p.position[1], 3);
    for (std::size_t k = 0; k < 3; ++k) mean[k] += p.position[k] / 9;
  }
  EXPECT_NEAR(mean[0], 1, 1e-14);
  EXPECT_NEAR(mean[1], 1, 1e-14);
  EXPECT_TRUE(mesh_points(mesh, 1e-3, 100).empty());
}

TEST(TactileLayouts, AFileGivesPlacesAxesAndFactors) {
  const TacFile file(
      "# a finger\n2\n\"0.1 0.2 0.3\" \"4 5\" \"0 0 2\" \"1 0 0\" \"0 3 0\"\n"
      "\"+1 0 0\" \"-1 -1\" \"1 0 0\" \"0 1 0\" \"0 0 1\" \"2 1 0.5 0\"\n\n");
  std::vector<TactilePoint> points = read_tactile_points(file.path());
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points[0].position, (Vector3{0.1, 0.2, 0.3}));
  EXPECT_EQ(points[0].pixel, (std::array<int, 2>{4, 5}));
  EXPECT_EQ(points[0].normal, (Vector3{0, 0, 1}));
  EXPECT_EQ(points[0].axis1, (Vector3{0, 1, 0}));
  EXPECT_EQ(points[1].factors, (std::array<double, 4>{2, 1, 0.5, 0}));
  move_points({{1, 0, 0}, {M_SQRT1_2, 0, 0, M_SQRT1_2}}, points);  // a quarter turn about z
  EXPECT_NEAR(points[0].position[0], 1 - 0.2, 1e-15);
  EXPECT_NEAR(points[0].position[1], 0.1, 1e-15);
  EXPECT_NEAR(points[0].axis0[1], 1, 1e-15);  // directions turn and do not shift
}

TEST(TactileLayouts, FilesSayWhatIsWrongAndWhere) {
  const std::string good = "\"0 0 0\" \"0 0\" \"0 0 1\" \"1 0 0\" \"0 1 0\"\n";
  EXPECT_THAT(points_error(""), HasSubstr("empty"));
  EXPECT_THAT(points_error("many\n"), HasSubstr(":1: 'many'; expected a count of points"));
  EXPECT_THAT(points_error("0\n"), HasSubstr(":1: the first line is no count"));
  EXPECT_THAT(points_error("2\n" + good), HasSubstr("ends after 1 of 2"));
  EXPECT_THAT(points_error("1\n" + good + good), HasSubstr(":3: more than the 1 points"));
  EXPECT_THAT(points_error("1\n\"0 0 0\" \"0 0\" \"0 0 1\" \"1 0 0\"\n"),
              HasSubstr(":2: 11 numbers; expected"));
  EXPECT_THAT(points_error("1\n\"0 0 nan\" \"0 0\" \"0 0 1\" \"1 0 0\" \"0 1 0\"\n"),
              HasSubstr(":2: 'nan'; expected a number of at most"));
  EXPECT_THAT(points_error("1\n\"0 0 0\" \"0 0.5\" \"0 0 1\" \"1 0 0\" \"0 1 0\"\n"),
              HasSubstr("'0.5'; expected a whole number"));
  EXPECT_THAT(points_error("1\n\"0 0 0\" \"0 0\" \"0 0 0\" \"1 0 0\" \"0 1 0\"\n"),
              HasSubstr("normal has no length"));
  EXPECT_THAT(points_error("1\n\"0 0 0\" \"0 0\" \"0 0 1\" \"1 0 0\" \"0 1 0\" \"1 1 1 -1\"\n"),
              HasSubstr("factor -1"));
  EXPECT_THROW(read_tactile_points("/nowhere/points.txt"), IoError);
}

TEST(TactileLayouts, ScenesPutThemOnBodiesInTheirUnit) {
  const std::string scene =
      R"(<redmax><option unit="cm-g"/><robot><link name="a"><joint name="a" type="free3d"/>
<body name="a" type="sphere" radius="2"/></link></robot><sensor>
<tactile name="h" body="a" type="hemisphere" radius="2" count="100" resolution="10 12" pos="0 0 1"/>
<tactile name="c" body="a" type="cylinder" radius="1" length="3" resolution="5 8" )"
      R"(quat="0.7071067811865476 0 0.7071067811865476 0"/>
</sensor></redmax>)";
  const Scene s = parse_scene(scene, "s.xml").scene;
  ASSERT_EQ(s.sensors.size(), 2U);
  EXPECT_NEAR(s.sensors[0].points[0].position[2], 0.01 + 0.02 * (1 - 0.5 / 100), 1e-15);
  EXPECT_NEAR(s.sensors[1].points[0].position[0], -0.015, 1e-15);  // its axis lies along x
  const Model model(s);
  EXPECT_EQ(model.sensors()[0].points, 100);
  EXPECT_EQ(model.sensors()[0].pressure_sign, 1);
  EXPECT_EQ(s.sensors[0].points[0].pixel, (std::array<int, 2>{5, 5})) << "next to the pole";
  std::string few = scene;
  few.replace(few.find("10 12"), 5, "9 11");
  try {
    parse_scene(few, "s.xml");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(
        error.what(),
        HasSubstr(
            "s.xml:3: <tactile>: resolution=\"9 11\" has 99 pixels for 100 points; expected"));
  }
}

TEST(TactileLayouts, AnElementMayHaveItsPoints) {
  const auto read = [](const std::string& points) {
    return parse_scene(R"(<redmax><option unit="cm-g"/><robot><link name="a"><joint name="a"
type="free3d"/><body name="a" type="sphere" radius="2"/></link></robot><sensor>
<tactile body="a" type="abstract" points=")" +
                           points + R"(" pos="0 0 1"/></sensor></redmax>)",
                       "s.xml")
        .scene;
  };
  const Scene s = read("1 2 3 0 0 2 1 0 5  0 0 1 3 0 0 0 0 1");
  ASSERT_EQ(s.sensors[0].points.size(), 2U);
  const TactilePoint &first = s.sensors[0].points[0], &second = s.sensors[0].points[1];
  EXPECT_DOUBLE_EQ(first.position[2], 0.04);
  EXPECT_EQ(first.normal, (Vector3{0, 0, 1}));
  EXPECT_EQ(first.axis0, (Vector3{1, 0, 0})) << "across the normal";
  EXPECT_EQ(second.axis0, (Vector3{0, 0, 1}));
  for (const TactilePoint& p : s.sensors[0].points) expect_frame(p);
  const auto refusal = [&](const std::string& points) {
    try {
      read(points);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_THAT(refusal("1 2 3 0 0 1"), HasSubstr("s.xml:3: <tactile>: points has 6 numbers"));
  EXPECT_THAT(refusal("0 0 0 0 0 1 0 0 2"), HasSubstr("axis0 of point 0"));
}

}  // namespace
}  // namespace tangere
