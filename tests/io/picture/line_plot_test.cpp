// SPDX-License-Identifier: Apache-2.0
// Tests pictures of curves: well-formed, every mark at the place of its numbers, whatever a name
// contains, and what has no place is left out.
#include "io/picture/line_plot.hpp"

#include <gmock/gmock.h>
#include <tinyxml2.h>

#include <cmath>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

struct Mark {
  double x, y;
  std::string fill;
};

/// Marks of a picture, in their order. Curves without a name have none in the legend.
std::vector<Mark> marks(const std::string& svg) {
  tinyxml2::XMLDocument document;
  EXPECT_EQ(document.Parse(svg.c_str()), tinyxml2::XML_SUCCESS) << svg;
  std::vector<Mark> all;
  for (const auto* dot = document.RootElement()->FirstChildElement("circle"); dot != nullptr;
       dot = dot->NextSiblingElement("circle"))
    all.push_back({dot->DoubleAttribute("cx"), dot->DoubleAttribute("cy"), dot->Attribute("fill")});
  return all;
}

PlotPanel panel_of(std::vector<PlotPoint> points, bool decades = false) {
  PlotPanel panel{"left & right", {"x [m]", decades}, {"force <N>", decades}, {}};
  panel.curves.push_back({"", std::move(points), PlotMark::dot});
  return panel;
}
std::string draw(const PlotPanel& panel) {
  return render_line_plot_svg({"a<b", {"noise < 1 %", "\"two\""}, {panel}, "a note"});
}

TEST(LinePlot, MarksLieInProportion) {
  const auto at = marks(draw(panel_of({{0, 5}, {1, 6}, {3, 4}})));
  ASSERT_EQ(at.size(), 3U);
  EXPECT_NEAR(at[2].x - at[0].x, 3 * (at[1].x - at[0].x), 0.3);
  EXPECT_NEAR(at[2].y - at[0].y, at[0].y - at[1].y, 0.2) << "one up, one down";
  EXPECT_GT(at[2].y, at[0].y);
}

TEST(LinePlot, DecadesAreEquallyWideAndZeroHasNoPlace) {
  const auto at = marks(
      draw(panel_of({{1e-1, 1e-6}, {1e-2, 1e-3}, {0, 1}, {1, 0}, {1e-3, 1, "", true}}, true)));
  ASSERT_EQ(at.size(), 3U);
  EXPECT_NEAR(at[0].x - at[1].x, at[1].x - at[2].x, 0.2);
  EXPECT_NEAR(at[0].y - at[1].y, at[1].y - at[2].y, 0.2);
  EXPECT_NE(at[0].fill, "#ffffff");
  EXPECT_EQ(at[2].fill, "#ffffff") << "hollow";
}

TEST(LinePlot, AxesFromZeroHaveRoomForEveryPointAndBar) {
  PlotPanel panel = panel_of({{1, 100, "", false, 90}, {2, 200, "", false, 150}, {4, 200}});
  panel.x.from_zero = panel.y.from_zero = panel.x.whole = true;
  const std::string svg = draw(panel);
  const auto at = marks(svg);
  ASSERT_EQ(at.size(), 3U);
  EXPECT_NEAR(at[2].x - at[1].x, 2 * (at[1].x - at[0].x), 0.2);
  EXPECT_NEAR(at[1].y, at[2].y, 0.1);
  for (const char* label : {">0<", ">1<", ">4<", ">100<", ">200<"})
    EXPECT_THAT(svg, HasSubstr(label));
  EXPECT_THAT(svg, Not(HasSubstr(">0.5<")));
}

TEST(LinePlot, LinesHaveGapsAndTextIsEscaped) {
  PlotPanel panel = panel_of({{0, 1}, {1, 2}, {2, NAN}, {3, 1}});
  panel.curves[0].mark = PlotMark::none;
  panel.curves[0].name = "k<n";
  const std::string svg = draw(panel);
  EXPECT_EQ(marks(svg).size(), 0U);
  for (const char* part : {"a&lt;b", "noise &lt; 1 %", "&quot;two&quot;", "left &amp; right",
                           "x [m]", "force &lt;N&gt;", "k&lt;n", "a note"})
    EXPECT_THAT(svg, HasSubstr(part));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
}

TEST(LinePlot, VerticalsBeyondTheAxisAreLeftOut) {
  PlotPanel panel = panel_of({{1e-1, 1e-3}, {1e-2, 1e-2}}, true);
  panel.curves.push_back({"", {{5e-2, 2e-3}}, PlotMark::star, false});
  for (const double beyond : {HUGE_VAL, 10.0, 1e-5, 0.0}) {
    panel.verticals = {{beyond, "reference"}};
    EXPECT_THAT(draw(panel), Not(HasSubstr("reference"))) << beyond;
  }
  panel.verticals = {{2e-2, "reference"}, {1e-4, "target", true}};
  for (const char* part : {"reference", "target", "#f2c500", ">1e-4<"})
    EXPECT_THAT(draw(panel), HasSubstr(part));
  EXPECT_THAT(draw(panel), Not(HasSubstr(">1e-5<")));
}

TEST(LinePlot, DrawsWhatDoesNotChange) { EXPECT_EQ(marks(draw(panel_of({{2, 0}}))).size(), 1U); }

TEST(LinePlot, RefusesAPanelWithoutAPoint) {
  EXPECT_THROW(draw(panel_of({})), InputError);
  EXPECT_THROW(draw(panel_of({{0, 1}, {HUGE_VAL, 1}}, true)), InputError);
}

}  // namespace
}  // namespace tangere
