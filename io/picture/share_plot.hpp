// SPDX-License-Identifier: Apache-2.0
// Draws where the time of a step goes, a bar for each part, as SVG. It opens no window.
#pragma once

#include <string>
#include <vector>

namespace tangere {

struct ShareBar {
  std::string label;
  double share = 0;   ///< of the whole; may be negative, which is noise, or above 1
  double spread = 0;  ///< standard deviation; 0: not known
  int group = 0;      ///< index into ShareBars::groups
};

struct ShareBars {
  std::string title;
  std::vector<std::string> captions;  ///< lines below the title
  std::vector<std::string> groups;    ///< what the colours mean, 1 to 4
  std::vector<ShareBar> bars;         ///< at least one, from top to bottom
};

/// Draws a bar from 0 to each share, and a line of one spread to both sides of its end. Throws
/// InputError without bars, for numbers that are not finite, and for a group that is not there.
std::string render_share_svg(const ShareBars& shares);

}  // namespace tangere
