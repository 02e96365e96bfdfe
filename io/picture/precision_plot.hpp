// SPDX-License-Identifier: Apache-2.0
// Draws cost against error as SVG, both in decades: one curve per scheme, one dot per step size.
#pragma once

#include <string>
#include <vector>

namespace tangere {

struct PrecisionDot {
  double error = 0, cost = 0;  ///< left out if not positive and finite
  bool hollow = false;         ///< the reference cannot tell the error well
  std::string label;           ///< beside the dot; "": none
};

struct PrecisionCurve {
  std::string name;
  std::vector<PrecisionDot> points;  ///< joined by a line in this order
};

struct PrecisionPlot {
  std::string title, x_label, y_label;
  std::vector<std::string> captions;
  double floor = 0;                    ///< error of the reference: a line, if on the axis
  double target = 0;                   ///< a dashed line; 0: none
  std::vector<PrecisionCurve> curves;  ///< at most six
  PrecisionDot marked;                 ///< a star; error 0: none
};

/// Throws InputError for a plot without a dot to draw.
std::string render_precision_svg(const PrecisionPlot& plot);

}  // namespace tangere
