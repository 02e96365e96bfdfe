// SPDX-License-Identifier: Apache-2.0
// Tests pictures of curves: well-formed, every mark at the place of its numbers, gaps left out,
// whatever a name contains.
#include "io/picture/series_plot.hpp"

#include <gmock/gmock.h>
#include <tinyxml2.h>

#include <array>
#include <cmath>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

std::string draw(CurvePanel panel) {
  const std::array<CurvePanel, 1> panels = {std::move(panel)};
  const std::array<std::string, 1> captions = {"noise < 1 %"};
  return render_curves_svg("a & b", captions, panels);
}

/// Centres of measured points, without the one in the list of names.
std::vector<std::pair<double, double>> dots(const std::string& svg) {
  tinyxml2::XMLDocument document;
  EXPECT_EQ(document.Parse(svg.c_str()), tinyxml2::XML_SUCCESS) << svg;
  std::vector<std::pair<double, double>> centres;
  for (const auto* dot = document.RootElement()->FirstChildElement("circle"); dot != nullptr;
       dot = dot->NextSiblingElement("circle"))
    centres.emplace_back(dot->DoubleAttribute("cx"), dot->DoubleAttribute("cy"));
  return centres;
}

TEST(SeriesPlot, DotsLieInProportion) {
  const auto at = dots(draw({"p", "x", "y", false, {{"", {0, 1, 3}, {5, 6, 4}, true, 0}}}));
  ASSERT_EQ(at.size(), 3U);
  EXPECT_NEAR(at[2].first - at[0].first, 3 * (at[1].first - at[0].first), 0.3);
  EXPECT_NEAR(at[2].second - at[0].second, at[0].second - at[1].second, 0.2) << "one up, one down";
  EXPECT_GT(at[2].second, at[0].second);
}

TEST(SeriesPlot, DecadesAreEquallyFarAndZeroHasNoPlace) {
  const auto at =
      dots(draw({"p", "x", "y", true, {{"", {0, 1, 2, 3}, {1e-6, 1e-3, 0, 1}, true, 0}}}));
  ASSERT_EQ(at.size(), 3U);
  EXPECT_NEAR(at[0].second - at[1].second, at[1].second - at[2].second, 0.2);
}

TEST(SeriesPlot, LinesHaveGapsAndNamesAreEscaped) {
  const std::string svg = draw({"left & right",
                                "time [s]",
                                "force <N>",
                                false,
                                {{"k<n", {0, 1, 2, 3}, {1, 2, NAN, 1}, false, 1}}});
  EXPECT_EQ(dots(svg).size(), 0U);
  for (const char* part :
       {"a &amp; b", "noise &lt; 1 %", "left &amp; right", "time [s]", "force &lt;N&gt;", "k&lt;n"})
    EXPECT_THAT(svg, HasSubstr(part));
  EXPECT_THAT(svg, testing::Not(HasSubstr("nan")));
}

TEST(SeriesPlot, DrawsWhatDoesNotChange) {
  EXPECT_EQ(dots(draw({"p", "x", "y", false, {{"", {2}, {0}, true, 0}}})).size(), 1U);
}

TEST(SeriesPlot, RefusesWhatCannotBeDrawn) {
  EXPECT_THROW(draw({"p", "x", "y", false, {}}), InputError);
  EXPECT_THROW(draw({"p", "x", "y", true, {{"c", {0, 1}, {0, -1}, false, 0}}}), InputError);
  EXPECT_THROW(draw({"p", "x", "y", false, {{"c", {0, 1}, {0}, false, 0}}}), InputError);
}

}  // namespace
}  // namespace tangere
