// SPDX-License-Identifier: Apache-2.0
// Layout: captions, the axes, a line that explains the marks. Lengths are in SVG units (pixels at
// 96 dpi).
#include "io/picture/scaling_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/error.hpp"
#include "io/picture/svg.hpp"

namespace tangere {
namespace {

using svg::text;

constexpr double kWidth = 640, kPlotHeight = 320, kLeft = 88, kRight = 28;
constexpr double kBottom = 78;
constexpr double kLabelWidth = 26;  // labels of threads closer than this would touch
constexpr const char* kEnd = "text-anchor=\"end\" font-size=\"11\"";
constexpr const char* kMiddle = "text-anchor=\"middle\" font-size=\"11\"";

/// Writes "250 k" instead of "250000".
std::string short_number(double x) {
  if (x >= 1e6) return fmt::format("{:.3g} M", x / 1e6);
  if (x >= 1e3) return fmt::format("{:.3g} k", x / 1e3);
  return fmt::format("{:.3g}", x);
}

std::vector<ScalingPoint> by_threads(std::vector<ScalingPoint> points) {
  std::sort(points.begin(), points.end(),
            [](const auto& a, const auto& b) { return a.threads < b.threads; });
  return points;
}

class Picture {
 public:
  explicit Picture(const ScalingCurve& curve)
      : curve_(curve),
        points_(by_threads(curve.points)),
        slope_(points_.front().best / points_.front().threads),
        most_threads_(points_.back().threads),
        highest_(slope_ * most_threads_),
        top_(svg::kHead + svg::kLine * static_cast<double>(curve.captions.size()) + 12) {
    for (const ScalingPoint& p : points_) highest_ = std::max(highest_, p.best);
    highest_ *= 1.06;  // so that the frame does not cut the highest dot
  }

  std::string draw() {
    const double tall = top_ + kPlotHeight + kBottom;
    out_ = svg::begin(kWidth, tall) + svg::heading(curve_.title, curve_.captions);
    axes();
    curves();
    marks();
    out_ += text(kLeft, tall - 12,
                 "dots: best pass; bars: down to the median; dashed: ideal, in proportion to "
                 "threads",
                 "font-size=\"11\"");
    out_ += "</svg>\n";
    return std::move(out_);
  }

 private:
  [[nodiscard]] double x(double threads) const {
    return kLeft + (kWidth - kLeft - kRight) * threads / (1.04 * most_threads_);
  }
  [[nodiscard]] double y(double rate) const { return top_ + kPlotHeight * (1 - rate / highest_); }

  void line(double x0, double y0, double x1, double y1, const char* style) {
    out_ += fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" {}/>\n", x0, y0, x1, y1, style);
  }

  void axes() {
    const double below = top_ + kPlotHeight, right = kWidth - kRight;
    const double step = svg::round_down(highest_ / 4);
    for (int k = 0; k * step <= highest_; ++k) {
      const double at = y(k * step);
      line(kLeft, at, right, at, "stroke=\"#ddd\"");
      out_ += text(kLeft - 8, at + 4, short_number(k * step), kEnd);
    }
    double labelled = x(0);
    out_ += text(labelled, below + 16, "0", kMiddle);
    for (const ScalingPoint& p : points_) {
      line(x(p.threads), below, x(p.threads), below + 4, "stroke=\"#444\"");
      if (x(p.threads) - labelled < kLabelWidth) continue;
      labelled = x(p.threads);
      out_ += text(labelled, below + 16, std::to_string(p.threads), kMiddle);
    }
    line(kLeft, below, right, below, "stroke=\"#444\"");
    line(kLeft, top_, kLeft, below, "stroke=\"#444\"");
    out_ += text((kLeft + right) / 2, below + 36, "threads", "text-anchor=\"middle\"");
    out_ += fmt::format(
        "<text transform=\"translate({:.1f} {:.1f}) rotate(-90)\" text-anchor=\"middle\">"
        "environment steps per second [1/s]</text>\n",
        kLeft - 58, top_ + kPlotHeight / 2);
  }

  void curves() {
    line(x(0), y(0), x(most_threads_), y(slope_ * most_threads_),
         "stroke=\"#888\" stroke-dasharray=\"5 4\" fill=\"none\"");
    std::string d;
    for (const ScalingPoint& p : points_)
      d += fmt::format("{}{:.1f} {:.1f}", d.empty() ? "M" : "L", x(p.threads), y(p.best));
    out_ += "<path d=\"" + d + "\" stroke=\"#1e708e\" stroke-width=\"1.6\" fill=\"none\"/>\n";
  }

  void marks() {
    for (const ScalingPoint& p : points_) {
      const double at = x(p.threads), median = y(p.median);
      line(at, y(p.best), at, median, "stroke=\"#1e708e\"");
      line(at - 4, median, at + 4, median, "stroke=\"#1e708e\"");
      out_ += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"#1e708e\"/>\n", at,
                          y(p.best));
    }
  }

  const ScalingCurve& curve_;
  std::vector<ScalingPoint> points_;  // sorted by threads
  double slope_;                      // of the ideal line [1/s per thread]
  double most_threads_, highest_, top_;
  std::string out_;
};

}  // namespace

std::string render_scaling_svg(const ScalingCurve& curve) {
  if (curve.points.empty()) throw InputError("a scaling curve without points");
  for (const ScalingPoint& p : curve.points)
    if (p.threads < 1 || !(p.median > 0) || !(p.best > 0) || !std::isfinite(p.best + p.median))
      throw InputError(
          fmt::format("a scaling curve with {} steps per second (median {}) on {} threads; "
                      "expected positive numbers",
                      p.best, p.median, p.threads));
  return Picture(curve).draw();
}

}  // namespace tangere
