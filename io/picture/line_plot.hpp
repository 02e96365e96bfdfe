// SPDX-License-Identifier: Apache-2.0
// Draws curves and marks over two axes as SVG, one panel below the other. It opens no window.
#pragma once

#include <cmath>
#include <string>
#include <vector>

namespace tangere {

struct PlotPoint {
  double x = 0, y = 0;     ///< left out if not finite, or not positive on an axis of decades
  std::string label = {};  ///< beside the mark; "": none
  bool hollow = false;     ///< the mark is not filled
  double bar = NAN;        ///< other end of a bar from y; NaN: no bar
};

enum class PlotMark { none, small_dot, dot, star };

struct PlotCurve {
  std::string name = {};  ///< in the legend; "": not there
  std::vector<PlotPoint> points = {};
  PlotMark mark = PlotMark::none;  ///< at every point
  bool line = true;                ///< joins neighbouring points; a point that is left out is a gap
  bool dashed = false;             ///< grey and dashed, for comparison
  int colour = 0;                  ///< one of six; curves that belong together share one
};

struct PlotAxis {
  std::string label;     ///< with its unit
  bool decades = false;  ///< logarithmic, ends at whole decades
  bool from_zero = false;
  bool whole = false;  ///< only whole numbers are labelled
};

/// A vertical line at x, left out where it is beyond the axis.
struct PlotVertical {
  double x = 0;
  std::string label;
  bool dashed = false;  ///< grey and dashed, and the axis covers it
};

struct PlotPanel {
  std::string title;
  PlotAxis x, y;
  std::vector<PlotCurve> curves;
  std::vector<PlotVertical> verticals = {};
  double height = 190;  ///< of the axes [px]
};

struct LinePlot {
  std::string title;
  std::vector<std::string> captions;  ///< lines below the title
  std::vector<PlotPanel> panels;
  std::string note = {};  ///< below the last panel
};

/// Every panel has its own axes, which cover all of its curves. Throws InputError for a panel
/// without a point to draw.
std::string render_line_plot_svg(const LinePlot& plot);

}  // namespace tangere
