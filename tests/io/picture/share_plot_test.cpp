// SPDX-License-Identifier: Apache-2.0
// Tests the picture of shares: well-formed, every bar as long as its number, whatever a name
// contains.
#include "io/picture/share_plot.hpp"

#include <gmock/gmock.h>
#include <tinyxml2.h>

#include <cmath>
#include <map>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

ShareBars some_shares() {
  ShareBars shares;
  shares.title = "where a step's time goes: <rolling> & \"ball\"";
  shares.captions = {"one line", "another"};
  shares.groups = {"effects", "parts", "runs"};
  shares.bars = {{"contact <pad>", 0.4, 0.02, 0},
                 {"friction", 0.2, 0.01, 1},
                 {"gravity", -0.1, 0.05, 0},
                 {"gradients", 1.6, 0, 2}};
  return shares;
}

TEST(SharePlot, BarsAreAsLongAsTheirShares) {
  const std::string svg = render_share_svg(some_shares());
  tinyxml2::XMLDocument document;
  ASSERT_EQ(document.Parse(svg.c_str()), tinyxml2::XML_SUCCESS);
  std::vector<double> left, wide;
  for (const auto* r = document.RootElement()->FirstChildElement("rect"); r != nullptr;
       r = r->NextSiblingElement("rect"))
    if (r->FindAttribute("x") != nullptr)
      left.push_back(r->DoubleAttribute("x")), wide.push_back(r->DoubleAttribute("width"));
  ASSERT_EQ(wide.size(), 4U + 3U) << "four bars, three colours";
  const double whole = wide[3] / 1.6;
  EXPECT_NEAR(wide[0], 0.4 * whole, 0.1);
  EXPECT_NEAR(wide[1], 0.2 * whole, 0.1);
  EXPECT_NEAR(wide[2], 0.1 * whole, 0.1);
  EXPECT_NEAR(left[2] + wide[2], left[0], 0.1) << "a negative share ends at zero";
  EXPECT_THAT(svg, ::testing::HasSubstr("40.0 % ± 2.0"));
  EXPECT_THAT(svg, ::testing::HasSubstr("160.0 %<"));
}

TEST(SharePlot, WhatCannotBeDrawnIsRefused) {
  ShareBars shares = some_shares();
  shares.bars.clear();
  EXPECT_THROW(render_share_svg(shares), InputError);
  shares = some_shares();
  shares.bars[0].share = NAN;
  EXPECT_THROW(render_share_svg(shares), InputError);
  shares = some_shares();
  shares.bars[0].group = 3;
  EXPECT_THROW(render_share_svg(shares), InputError);
}

}  // namespace
}  // namespace tangere
