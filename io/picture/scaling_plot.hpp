// SPDX-License-Identifier: Apache-2.0
// Draws speed against threads, with the ideal straight line, as SVG. It opens no window.
#pragma once

#include <string>
#include <vector>

namespace tangere {

struct ScalingPoint {
  int threads = 1;
  double best = 0, median = 0;  ///< environment steps per second of wall clock
};

struct ScalingCurve {
  std::string title;
  std::vector<std::string> captions;  ///< lines below the title: machine, what was run
  std::vector<ScalingPoint> points;   ///< at least one, in any order
};

/// Draws a dot for the best speed of each thread count, and a bar down to the median. Both axes
/// start at zero. The ideal line goes through zero and the point with the fewest threads. Throws
/// InputError without points, or for one that is not finite and positive.
std::string render_scaling_svg(const ScalingCurve& curve);

}  // namespace tangere
