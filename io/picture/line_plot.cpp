// SPDX-License-Identifier: Apache-2.0
// Layout: title, captions, then panels: title, legend, axes. Lengths are in SVG units (pixels at 96
// dpi).
#include "io/picture/line_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numbers>

#include "engine/base/error.hpp"
#include "io/picture/svg.hpp"

namespace tangere {
namespace {

using svg::text;

constexpr double kWidth = 720, kLeft = 88, kRight = 40;
constexpr double kAbove = 46;    // in a panel: title and legend
constexpr double kBelow = 50;    // in a panel: labels of the x axis
constexpr double kLetter = 6.2;  // mean width at 11 px
constexpr double kLabelWidth = 30;
constexpr std::array kColours = {"#1e708e", "#c8553d", "#588b3a", "#8a5aa8", "#b58a1b", "#555555"};
constexpr const char* kEnd = "text-anchor=\"end\" font-size=\"11\"";
constexpr const char* kMiddle = "text-anchor=\"middle\" font-size=\"11\"";
constexpr const char* kComparison = "stroke=\"#888\" stroke-dasharray=\"5 4\" fill=\"none\"";

std::string line(double x0, double y0, double x1, double y1, const std::string& style) {
  return fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" {}/>\n", x0, y0, x1, y1, style);
}

/// "250 k" for 250000.
std::string short_number(double x) {
  if (std::abs(x) >= 1e6) return fmt::format("{:.3g} M", x / 1e6);
  if (std::abs(x) >= 1e4) return fmt::format("{:.3g} k", x / 1e3);
  return fmt::format("{:.4g}", x + 0.0);
}

/// Numbers of an axis. `low` and `high` are in decades where the axis is.
struct Scale {
  const PlotAxis& axis;
  double low = HUGE_VAL, high = -HUGE_VAL;

  [[nodiscard]] double of(double value) const { return axis.decades ? std::log10(value) : value; }
  [[nodiscard]] bool has(double value) const { return std::isfinite(of(value)); }
  [[nodiscard]] double share(double value) const { return (of(value) - low) / (high - low); }
  void cover(double value) { low = std::min(low, of(value)), high = std::max(high, of(value)); }
  /// Rounds the ends of decades, and gives every range a width. `margin`: of the width, at both
  /// ends.
  void close(double margin) {
    if (axis.decades) {
      low = std::floor(low + 1e-9);
      high = std::max(low + 1, std::ceil(high - 1e-9));
      return;
    }
    if (axis.from_zero) low = std::min(low, 0.0);
    if (low == high) margin = 0.5, high += 1e-9;
    const double more = margin * std::max(high - low, std::abs(low));
    high += more;
    if (!axis.from_zero) low -= more;
  }
  /// Values at which the axis has labels.
  [[nodiscard]] std::vector<double> ticks() const {
    double step = axis.decades ? std::max(1.0, std::ceil((high - low) / 8))
                               : svg::round_down((high - low) / 4);
    if (axis.whole) step = std::max(1.0, step);
    std::vector<double> values;
    for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k)
      values.push_back(axis.decades ? std::pow(10.0, k * step) : k * step);
    return values;
  }
  [[nodiscard]] std::string text(double value) const {
    const double exponent = std::round(of(value));
    if (axis.decades && std::abs(exponent) > 3) return fmt::format("1e{:.0f}", exponent);
    return short_number(value);
  }
};

class Panel {
 public:
  Panel(const PlotPanel& panel, double top) : panel_(panel), top_(top) {
    for (const PlotCurve& curve : panel.curves)
      for (const PlotPoint& p : curve.points) {
        if (!drawn(p)) continue;
        x_.cover(p.x);
        y_.cover(p.y);
        if (y_.has(p.bar)) y_.cover(p.bar);
      }
    if (!(x_.low <= x_.high))
      throw InputError("panel '" + panel.title + "' has no point to draw; expected at least one");
    for (const PlotVertical& v : panel.verticals)
      if (v.dashed && x_.has(v.x)) x_.cover(v.x);
    x_.close(panel.x.from_zero ? 0.04 : 0);
    y_.close(0.06);
  }

  std::string draw() {
    out_ += text(kLeft, top_ - 26, panel_.title, "font-weight=\"bold\"");
    axes();
    legend();
    for (const PlotVertical& v : panel_.verticals) vertical(v);
    for (const PlotCurve& curve : panel_.curves) {
      if (curve.line) path(curve);
      if (curve.mark != PlotMark::none)
        for (const PlotPoint& p : curve.points)
          if (drawn(p)) mark(curve, p);
    }
    return std::move(out_);
  }

 private:
  [[nodiscard]] bool drawn(const PlotPoint& p) const { return x_.has(p.x) && y_.has(p.y); }
  [[nodiscard]] double x(double value) const {
    return kLeft + (kWidth - kLeft - kRight) * x_.share(value);
  }
  [[nodiscard]] double y(double value) const {
    return top_ + panel_.height * (1 - y_.share(value));
  }
  static const char* colour_of(const PlotCurve& curve) {
    return kColours[std::size_t(curve.colour) % kColours.size()];
  }

  void axes() {
    const double below = top_ + panel_.height, right = kWidth - kRight;
    for (const double value : y_.ticks()) {
      out_ += line(kLeft, y(value), right, y(value), "stroke=\"#ddd\"");
      out_ += text(kLeft - 8, y(value) + 4, y_.text(value), kEnd);
    }
    double labelled = -kLabelWidth;
    for (const double value : x_.ticks()) {
      out_ += line(x(value), below, x(value), below + 4, "stroke=\"#444\"");
      if (x(value) - labelled < kLabelWidth) continue;
      labelled = x(value);
      out_ += text(labelled, below + 16, x_.text(value), kMiddle);
    }
    out_ += line(kLeft, below, right, below, "stroke=\"#444\"");
    out_ += line(kLeft, top_, kLeft, below, "stroke=\"#444\"");
    out_ += text((kLeft + right) / 2, below + 34, panel_.x.label, kMiddle);
    out_ += fmt::format("<text transform=\"translate({:.1f} {:.1f}) rotate(-90)\" {}>{}</text>\n",
                        kLeft - 62, top_ + panel_.height / 2, kMiddle, svg::escape(panel_.y.label));
  }

  void legend() {
    double at = kLeft;
    for (const PlotCurve& curve : panel_.curves) {
      if (curve.name.empty()) continue;
      if (curve.line)
        out_ += line(at, top_ - 12, at + 16, top_ - 12, style_of(curve));
      else
        circle(at + 8, top_ - 12, 2, colour_of(curve), colour_of(curve));
      out_ += text(at + 21, top_ - 8, curve.name, "font-size=\"11\"");
      at += 36 + kLetter * static_cast<double>(curve.name.size());
    }
  }

  void vertical(const PlotVertical& v) {
    if (!x_.has(v.x) || x_.of(v.x) < x_.low || x_.of(v.x) > x_.high) return;
    out_ += line(x(v.x), top_, x(v.x), top_ + panel_.height,
                 v.dashed ? kComparison : "stroke=\"#c33\"");
    out_ += text(x(v.x) + 4, top_ + 12, v.label, "font-size=\"11\"");
  }

  static std::string style_of(const PlotCurve& curve) {
    if (curve.dashed) return kComparison;
    return fmt::format("stroke=\"{}\" stroke-width=\"1.6\" fill=\"none\"", colour_of(curve));
  }

  void path(const PlotCurve& curve) {
    std::string d;
    bool gap = true;
    for (const PlotPoint& p : curve.points) {
      if (drawn(p)) d += fmt::format("{}{:.1f} {:.1f}", gap ? "M" : "L", x(p.x), y(p.y));
      gap = !drawn(p);
    }
    if (!d.empty()) out_ += fmt::format("<path d=\"{}\" {}/>\n", d, style_of(curve));
  }

  void circle(double cx, double cy, double r, const char* fill, const char* stroke) {
    out_ +=
        fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:g}\" fill=\"{}\" stroke=\"{}\"/>\n",
                    cx, cy, r, fill, stroke);
  }

  void mark(const PlotCurve& curve, const PlotPoint& p) {
    const char* const colour = colour_of(curve);
    const double cx = x(p.x), cy = y(p.y);
    if (y_.has(p.bar)) {
      const std::string style = fmt::format("stroke=\"{}\"", colour);
      out_ += line(cx, cy, cx, y(p.bar), style) + line(cx - 4, y(p.bar), cx + 4, y(p.bar), style);
    }
    if (curve.mark == PlotMark::star) {
      std::string d;
      for (int k = 0; k < 10; ++k) {
        const double r = k % 2 == 0 ? 9 : 4, angle = std::numbers::pi / 5 * k;
        d += fmt::format("{}{:.1f} {:.1f}", k == 0 ? "M" : "L", cx + r * std::sin(angle),
                         cy - r * std::cos(angle));
      }
      out_ += "<path d=\"" + d + "Z\" fill=\"#f2c500\" stroke=\"#222\"/>\n";
    } else {
      circle(cx, cy, curve.mark == PlotMark::dot ? 4 : 2, p.hollow ? "#ffffff" : colour, colour);
    }
    if (!p.label.empty()) out_ += text(cx + 6, cy - 6, p.label, "font-size=\"9\"");
  }

  const PlotPanel& panel_;
  double top_;
  Scale x_{panel_.x}, y_{panel_.y};
  std::string out_;
};

}  // namespace

std::string render_line_plot_svg(const LinePlot& plot) {
  double at = svg::kHead + svg::kLine * static_cast<double>(plot.captions.size()) + 8;
  std::string panels;
  for (const PlotPanel& panel : plot.panels) {
    panels += Panel(panel, at + kAbove).draw();
    at += kAbove + panel.height + kBelow;
  }
  if (!plot.note.empty()) panels += text(kLeft, at += 12, plot.note, "font-size=\"11\"");
  return svg::begin(kWidth, at + 12) + svg::heading(plot.title, plot.captions) + panels +
         "</svg>\n";
}

}  // namespace tangere
