// SPDX-License-Identifier: Apache-2.0
// Layout: title, captions, the axes, a legend on the right. Lengths are in SVG units (pixels at 96
// dpi). Small errors are on the left, small costs at the bottom: the lower left is best.
#include "io/picture/precision_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/base/error.hpp"
#include "io/picture/svg.hpp"

namespace tangere {
namespace {

using svg::text;

constexpr double kWidth = 760, kPlotHeight = 380, kLeft = 84, kRight = 150;
constexpr double kBottom = 84;
constexpr std::array kColours = {"#1e708e", "#c8553d", "#5b8c3e", "#7a5195", "#b8860b", "#555555"};
constexpr const char* kMiddle = "text-anchor=\"middle\" font-size=\"11\"";
constexpr const char* kEnd = "text-anchor=\"end\" font-size=\"11\"";

bool drawable(const PrecisionDot& dot) {
  return dot.error > 0 && dot.cost > 0 && std::isfinite(dot.error) && std::isfinite(dot.cost);
}

/// An axis in decades, from `low` to `high`.
struct Axis {
  double low = HUGE_VAL, high = -HUGE_VAL;

  void cover(double value) {
    low = std::min(low, std::log10(value));
    high = std::max(high, std::log10(value));
  }
  /// Extends both ends to whole decades.
  void round() {
    low = std::floor(low + 1e-9);
    high = std::max(low + 1, std::ceil(high - 1e-9));
  }
  [[nodiscard]] double at(double value) const { return (std::log10(value) - low) / (high - low); }
};

std::string power_of_ten(int exponent) {
  return exponent >= -3 && exponent <= 3 ? fmt::format("{:g}", std::pow(10.0, exponent))
                                         : fmt::format("1e{}", exponent);
}

class Picture {
 public:
  explicit Picture(const PrecisionPlot& plot) : plot_(plot) {
    for (const PrecisionCurve& curve : plot.curves)
      for (const PrecisionDot& dot : curve.points) cover(dot);
    cover(plot.marked);
    if (plot.target > 0) x_.cover(plot.target);
    x_.round();
    y_.round();
    top_ = svg::kHead + svg::kLine * static_cast<double>(plot.captions.size()) + 16;
  }

  std::string draw() {
    const double tall = top_ + kPlotHeight + kBottom;
    out_ = svg::begin(kWidth, tall) + svg::heading(plot_.title, plot_.captions);
    axes();
    verticals();
    for (std::size_t k = 0; k < plot_.curves.size(); ++k)
      curve(plot_.curves[k], kColours[k % kColours.size()], k);
    if (drawable(plot_.marked)) star();
    out_ += text(kLeft, tall - 12,
                 "numbers: step size [ms]; the lower left is best; star: the setting of the scene",
                 "font-size=\"11\"");
    out_ += "</svg>\n";
    return std::move(out_);
  }

 private:
  void cover(const PrecisionDot& dot) {
    if (!drawable(dot)) return;
    x_.cover(dot.error);
    y_.cover(dot.cost);
  }
  [[nodiscard]] double x(double error) const {
    return kLeft + (kWidth - kLeft - kRight) * x_.at(error);
  }
  [[nodiscard]] double y(double cost) const { return top_ + kPlotHeight * (1 - y_.at(cost)); }

  void line(double x0, double y0, double x1, double y1, const char* style) {
    out_ += fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" {}/>\n", x0, y0, x1, y1, style);
  }

  void axes() {
    const double below = top_ + kPlotHeight, right = kWidth - kRight;
    for (int k = static_cast<int>(x_.low); k <= static_cast<int>(x_.high); ++k) {
      const double at = x(std::pow(10.0, k));
      line(at, top_, at, below, "stroke=\"#ddd\"");
      out_ += text(at, below + 16, power_of_ten(k), kMiddle);
    }
    for (int k = static_cast<int>(y_.low); k <= static_cast<int>(y_.high); ++k) {
      const double at = y(std::pow(10.0, k));
      line(kLeft, at, right, at, "stroke=\"#ddd\"");
      out_ += text(kLeft - 8, at + 4, power_of_ten(k), kEnd);
    }
    line(kLeft, below, right, below, "stroke=\"#444\"");
    line(kLeft, top_, kLeft, below, "stroke=\"#444\"");
    out_ += text((kLeft + right) / 2, below + 38, plot_.x_label, "text-anchor=\"middle\"");
    out_ += fmt::format(
        "<text transform=\"translate({:.1f} {:.1f}) rotate(-90)\" text-anchor=\"middle\">{}"
        "</text>\n",
        kLeft - 56, top_ + kPlotHeight / 2, svg::escape(plot_.y_label));
  }

  void verticals() {
    const double below = top_ + kPlotHeight;
    if (plot_.target > 0) {
      line(x(plot_.target), top_, x(plot_.target), below,
           "stroke=\"#888\" stroke-dasharray=\"5 4\"");
      out_ += text(x(plot_.target), top_ - 4, "target", kMiddle);
    }
    const double floor = std::log10(plot_.floor);  // NaN or infinite: no line
    if (floor > x_.low && floor < x_.high) {
      line(x(plot_.floor), top_, x(plot_.floor), below, "stroke=\"#c33\"");
      out_ += text(x(plot_.floor), top_ - 4, "reference", kMiddle);
    }
  }

  void curve(const PrecisionCurve& curve, const char* colour, std::size_t k) {
    std::string path;
    for (const PrecisionDot& dot : curve.points)
      if (drawable(dot))
        path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x(dot.error), y(dot.cost));
    if (path.empty()) return;
    out_ += fmt::format("<path d=\"{}\" stroke=\"{}\" stroke-width=\"1.6\" fill=\"none\"/>\n", path,
                        colour);
    for (const PrecisionDot& dot : curve.points) {
      if (!drawable(dot)) continue;
      out_ +=
          fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\" stroke=\"{}\"/>\n",
                      x(dot.error), y(dot.cost), dot.hollow ? "#ffffff" : colour, colour);
      if (!dot.label.empty())
        out_ += text(x(dot.error) + 6, y(dot.cost) - 6, dot.label, "font-size=\"9\"");
    }
    const double at = top_ + 12 + 18 * static_cast<double>(k), left = kWidth - kRight + 16;
    out_ += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"/>\n", left, at - 4,
                        colour);
    out_ += text(left + 10, at, curve.name);
  }

  void star() {
    const double cx = x(plot_.marked.error), cy = y(plot_.marked.cost);
    std::string path;
    for (int k = 0; k < 10; ++k) {
      const double r = k % 2 == 0 ? 9 : 4, angle = 0.6283185307179586 * k;
      path += fmt::format("{}{:.1f} {:.1f}", k == 0 ? "M" : "L", cx + r * std::sin(angle),
                          cy - r * std::cos(angle));
    }
    out_ += "<path d=\"" + path + "Z\" fill=\"#f2c500\" stroke=\"#222\"/>\n";
  }

  const PrecisionPlot& plot_;
  Axis x_, y_;
  double top_ = 0;
  std::string out_;
};

}  // namespace

std::string render_precision_svg(const PrecisionPlot& plot) {
  for (const PrecisionCurve& curve : plot.curves)
    if (std::ranges::any_of(curve.points, drawable)) return Picture(plot).draw();
  throw InputError("a plot of cost against error without a point that has both");
}

}  // namespace tangere
