// SPDX-License-Identifier: Apache-2.0
// Tests pictures of fields: well-formed, every value in its place, and correct without contact.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tinyxml2.h>

#include "io/picture/tactile_drawing.hpp"
#include "io/picture/tactile_plot.hpp"
#include "tests/io/synthetic_run.hpp"

namespace tangere {
namespace {

using testing::Folder;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::recording;

std::string picture(const Folder& folder, const PlotOptions& options, double force = 1e-3) {
  const Recording r = recording();
  {
    TrajectoryFile file(folder / "run.h5", r, true);
    testing::write_run(file, r, force);
    file.commit();
  }
  std::string svg = render_tactile_svg(TrajectoryReader(folder / "run.h5"), options);
  tinyxml2::XMLDocument document;
  EXPECT_EQ(document.Parse(svg.c_str()), tinyxml2::XML_SUCCESS);
  EXPECT_STREQ(document.RootElement()->Name(), "svg");
  return svg;
}

TEST(TactilePlot, AStripShowsEveryFrameWithUnitsAndScale) {
  const Folder folder;
  const std::string svg = picture(folder, {});
  EXPECT_THAT(svg, HasSubstr("t = 0.020 s (step 2)"));
  EXPECT_THAT(svg, HasSubstr("t = 0.040 s (step 4)"));
  EXPECT_THAT(svg, HasSubstr(">mN<"));  // 2 mN at most
  EXPECT_THAT(svg, HasSubstr(">2<"));   // top of the colour bar
  EXPECT_THAT(svg,
              HasSubstr("pressure 2 mN"));  // the sum, positive although it was written negative
  EXPECT_THAT(svg, HasSubstr("sensor 'skin'"));
}

TEST(TactilePlot, TheTouchedPointHasTheTopColourAtItsPlace) {
  const Folder folder;
  PlotOptions one;
  one.frame = 1;
  const std::string svg = picture(folder, one);
  // 3 × 4 points on 2 × 3 mm: panels are 240 wide, so cells are 60 wide; point (1, 2) starts at 64
  // + 120.
  EXPECT_THAT(svg, HasSubstr("<rect x=\"184.00\" y=\"137.33\""));
  EXPECT_THAT(svg, HasSubstr("fill=\"#faec82\""));
  EXPECT_THAT(svg, Not(HasSubstr("step 2)")));
}

TEST(TactilePlot, ShearAlongAxis1PointsToTheRight) {
  const Folder folder;
  PlotOptions one;
  one.frame = 0;
  const std::string svg = picture(folder, one);
  const std::size_t at = svg.find("<path d=\"M");
  ASSERT_NE(at, std::string::npos);
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  ASSERT_EQ(std::sscanf(svg.c_str() + at, "<path d=\"M%lf %lfL%lf %lf", &x0, &y0, &x1, &y1), 4);
  EXPECT_GT(x1 - x0, 10);
  EXPECT_NEAR(y1, y0, 1e-6);
}

TEST(TactilePlot, NoContactIsSaid) {
  const Folder folder;
  EXPECT_THAT(picture(folder, {}, 0.0), HasSubstr("no contact"));
}

TEST(TactilePlot, DrawsTheFirstRectangularArrayAndNamesThemAll) {
  const Folder folder;
  SensorLayout rod = testing::skin(), second = rod;
  rod.name = "rod";
  rod.rows = rod.cols = 0;
  second.name = "second";
  // Naming the sensors that can be drawn needs no field.
  const Recording r = recording(0, {}, {rod, testing::skin(), second});
  TrajectoryFile file(folder / "run.h5", r, false);
  testing::write_run(file, r);
  file.commit();
  const TrajectoryReader reader(folder / "run.h5");
  EXPECT_THAT(drawable_sensors(reader), ::testing::ElementsAre("second", "skin"));
  const auto message = [&](const std::string& sensor) {
    PlotOptions o;
    o.sensor = sensor;
    try {
      (void)render_tactile_svg(reader, o);
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_THAT(message(""), HasSubstr("'second' has no frame"));
  EXPECT_THAT(message("rod"), HasSubstr("'rod' is not a rectangular array and has no image; those "
                                        "that can be drawn: second, skin"));
}

/// Points around a body: down is -z of the body, right is y, whatever the points' own axes are.
TEST(TactilePlot, AnImageHasItsPointsAtTheirPixelsAndShearAlongRowsAndColumns) {
  SensorLayout s = testing::skin();
  s.rows = s.cols = 0;
  for (int k = 0; k < 5; ++k) {
    TactilePoint p;
    const int row = k / 2, col = k % 2;
    p.position = {0.001, 0.004 * col, -0.002 * row};
    p.normal = {1, 0, 0}, p.axis0 = {0, 0, 1}, p.axis1 = {0, -1, 0};
    p.pixel = k == 4 ? std::array{-1, -1} : std::array{row, col};
    s.list.push_back(p);
  }
  s.points = 5;
  const TactileDrawing d = drawing_of(s);
  EXPECT_TRUE(drawable(s));
  EXPECT_EQ(d.rows * 10 + d.cols, 22);
  EXPECT_NEAR(d.height, 0.002, 1e-15);
  EXPECT_NEAR(d.width, 0.004, 1e-15);
  EXPECT_EQ(d.cell[3], (std::array{1, 1}));
  EXPECT_EQ(d.cell[4][0], -1);
  EXPECT_NEAR(d.shear(2, 3, 5)[0], -3, 1e-15);
  EXPECT_NEAR(d.shear(2, 3, 5)[1], -5, 1e-15);
  for (TactilePoint& p : s.list) p.pixel = {-1, -1};
  EXPECT_FALSE(drawable(s));

  const Folder folder;
  for (std::size_t k = 0; k < 4; ++k)
    s.list[k].pixel = {static_cast<int>(k / 2), static_cast<int>(k % 2)};
  const Recording r = recording(0, {}, {s});
  TrajectoryFile file(folder / "run.h5", r, false);
  testing::write_run(file, r);
  file.commit();
  const TrajectoryReader reader(folder / "run.h5");
  ASSERT_THAT(drawable_sensors(reader), ::testing::ElementsAre("skin"));
  const TactileDrawing again = drawing_of(reader.sensors()[0]);
  EXPECT_EQ(again.cell[3], (std::array{1, 1}));
  EXPECT_EQ(again.turn, drawing_of(s).turn);
}

TEST(TactilePlot, WhatIsNotThereIsNamed) {
  const Folder folder;
  picture(folder, {});
  const TrajectoryReader file(folder / "run.h5");
  const auto message = [&](const PlotOptions& o) -> std::string {
    try {
      (void)render_tactile_svg(file, o);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  PlotOptions o;
  o.sensor = "skim";
  EXPECT_THAT(message(o), HasSubstr("did you mean 'skin'"));
  o = {};
  o.environment = 2;
  EXPECT_THAT(message(o), HasSubstr("0 to 1"));
  o = {};
  o.frame = 2;
  EXPECT_THAT(message(o), HasSubstr("frames 0 to 1"));
  o = {};
  o.strip = 0;
  EXPECT_THAT(message(o), HasSubstr("at least 1"));
}

}  // namespace
}  // namespace tangere
