// SPDX-License-Identifier: Apache-2.0
// Tests the picture of cost against error: decades are equally wide, and what has no place is left
// out.
#include "io/picture/precision_plot.hpp"

#include <gmock/gmock.h>
#include <tinyxml2.h>

#include <cmath>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

PrecisionPlot plot_of(std::vector<PrecisionDot> dots) {
  PrecisionPlot plot;
  plot.title = "t<1>";
  plot.x_label = "error [1]";
  plot.y_label = "cost [s]";
  plot.curves.push_back({"SDIRK2", std::move(dots)});
  return plot;
}

struct Drawn {
  double x, y;
  std::string fill;
};
std::vector<Drawn> drawn(const std::string& svg) {
  tinyxml2::XMLDocument document;
  EXPECT_EQ(document.Parse(svg.c_str()), tinyxml2::XML_SUCCESS) << svg;
  std::vector<Drawn> all;
  for (const auto* dot = document.RootElement()->FirstChildElement("circle"); dot != nullptr;
       dot = dot->NextSiblingElement("circle"))
    all.push_back({dot->DoubleAttribute("cx"), dot->DoubleAttribute("cy"), dot->Attribute("fill")});
  return all;
}

TEST(PrecisionPlot, DecadesAreEquallyWide) {
  const auto at = drawn(render_precision_svg(
      plot_of({{1e-1, 1e-3, false, "25"}, {1e-2, 1e-2, false, "5"}, {1e-3, 1e-1, true, "1"}})));
  ASSERT_EQ(at.size(), 4U) << "three dots and the one of the legend";
  EXPECT_GT(at[0].x, at[1].x);
  EXPECT_GT(at[0].y, at[1].y) << "small costs are at the bottom";
  EXPECT_NEAR(at[0].x - at[1].x, at[1].x - at[2].x, 0.2);
  EXPECT_NEAR(at[0].y - at[1].y, at[1].y - at[2].y, 0.2);
  EXPECT_NE(at[0].fill, "#ffffff");
  EXPECT_EQ(at[2].fill, "#ffffff") << "hollow";
}

TEST(PrecisionPlot, SaysWhatIsDrawn) {
  PrecisionPlot plot = plot_of({{1e-1, 1e-3, false, "25"}});
  plot.floor = 2e-2;
  plot.target = 1e-2;
  plot.marked = {5e-2, 2e-3, false, ""};
  const std::string svg = render_precision_svg(plot);
  for (const char* part : {"t&lt;1&gt;", "error [1]", "cost [s]", ">25<", ">SDIRK2<", ">target<",
                           ">0.01<", ">reference<", "#f2c500"})
    EXPECT_THAT(svg, HasSubstr(part));
}

TEST(PrecisionPlot, DrawsNoLineBeyondTheAxes) {
  PrecisionPlot plot = plot_of({{1e-1, 1e-3, false, ""}, {1e-2, 1e-2, false, ""}});
  for (const double floor : {HUGE_VAL, 10.0, 1e-5, 0.0}) {
    plot.floor = floor;
    EXPECT_THAT(render_precision_svg(plot), ::testing::Not(HasSubstr("reference"))) << floor;
  }
}

TEST(PrecisionPlot, LeavesOutWhatHasNoPlace) {
  EXPECT_EQ(
      drawn(render_precision_svg(plot_of({{1e-1, 1, false, ""}, {HUGE_VAL, 1, false, ""}}))).size(),
      2U);
  EXPECT_THROW(render_precision_svg(plot_of({{0, 1, false, ""}, {HUGE_VAL, 1, false, ""}})),
               InputError);
}

}  // namespace
}  // namespace tangere
