// SPDX-License-Identifier: Apache-2.0
// Tests the picture of speed by threads: well-formed, every mark at the place of its numbers,
// whatever a name contains.
#include "io/picture/scaling_plot.hpp"

#include <gmock/gmock.h>
#include <tinyxml2.h>

#include <limits>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using ::testing::HasSubstr;

std::vector<std::pair<double, double>> dots(const std::string& svg) {
  tinyxml2::XMLDocument document;
  EXPECT_EQ(document.Parse(svg.c_str()), tinyxml2::XML_SUCCESS) << svg;
  std::vector<std::pair<double, double>> centres;
  for (const auto* dot = document.RootElement()->FirstChildElement("circle"); dot != nullptr;
       dot = dot->NextSiblingElement("circle"))
    centres.emplace_back(dot->DoubleAttribute("cx"), dot->DoubleAttribute("cy"));
  return centres;
}

TEST(ScalingPlot, DotsLieInProportionToThreadsAndSpeed) {
  // Ideal speed up to 2 threads, half of it at 4: in any order.
  const auto at =
      dots(render_scaling_svg({"t", {"c"}, {{4, 200, 190}, {1, 100, 90}, {2, 200, 150}}}));
  ASSERT_EQ(at.size(), 3U);
  const double per_thread = at[1].first - at[0].first, per_hundred = at[0].second - at[1].second;
  EXPECT_GT(per_thread, 0);
  EXPECT_GT(per_hundred, 0);
  EXPECT_NEAR(at[2].first - at[1].first, 2 * per_thread, 0.2);
  EXPECT_NEAR(at[2].second, at[1].second, 0.1);
}

TEST(ScalingPlot, AxesHaveUnitsAndNamesAreEscaped) {
  const std::string svg =
      render_scaling_svg({"a<b", {"Fast & \"Furious\" 9000", "two"}, {{1, 250e3, 2e5}}});
  EXPECT_EQ(dots(svg).size(), 1U);
  for (const char* part : {"a&lt;b", "Fast &amp; &quot;Furious&quot; 9000", ">two<", ">threads<",
                           "[1/s]", "ideal", ">200 k<", ">1<"})
    EXPECT_THAT(svg, HasSubstr(part));
}

TEST(ScalingPlot, RefusesWhatCannotBeDrawn) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const auto draw = [](std::vector<ScalingPoint> points) {
    return render_scaling_svg({"t", {}, std::move(points)});
  };
  EXPECT_THROW(draw({}), InputError);
  EXPECT_THROW(draw({{0, 1, 1}}), InputError);
  EXPECT_THROW(draw({{1, 0, 0}}), InputError);
  EXPECT_THROW(draw({{1, kInfinity, 1}}), InputError);
}

}  // namespace
}  // namespace tangere
