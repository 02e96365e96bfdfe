// SPDX-License-Identifier: Apache-2.0
// Draws the curves of a fit or a run as SVG, one panel below the other. It opens no window.
#pragma once

#include <span>
#include <string>
#include <vector>

namespace tangere {

struct Curve {
  std::string name;  ///< "": not explained
  std::vector<double> x,
      y;  ///< same length; left out if not finite, or not positive on a logarithmic scale
  bool dots = false;  ///< measured points instead of a line
  int colour = 0;     ///< one of six; curves that belong together share one
};

struct CurvePanel {
  std::string title, x_label, y_label;  ///< labels with their units
  bool logarithmic = false;             ///< y in decades
  std::vector<Curve> curves;
};

/// Every panel has its own axes, which cover all of its curves. Throws InputError for a panel
/// without a point to draw, or a curve with unequal numbers of x and y.
std::string render_curves_svg(const std::string& title, std::span<const std::string> captions,
                              std::span<const CurvePanel> panels);

}  // namespace tangere
