// SPDX-License-Identifier: Apache-2.0
// Layout: captions, then panels of one size. Lengths are in SVG units (pixels at 96 dpi).
#include "io/picture/series_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "engine/base/error.hpp"
#include "io/picture/svg.hpp"

namespace tangere {
namespace {

using svg::text;

constexpr double kWidth = 720, kPanel = 190, kLeft = 88, kRight = 24;
constexpr double kAbove = 46,
                 kBelow = 50;    // in a panel: space for title and curve names; for the x axis
constexpr double kLetter = 6.2;  // mean width at 11 px
constexpr std::array<const char*, 6> kColours = {"#1e708e", "#c8553d", "#588b3a",
                                                 "#8a5aa8", "#b58a1b", "#555555"};
constexpr const char* kEnd = "text-anchor=\"end\" font-size=\"11\"";
constexpr const char* kMiddle = "text-anchor=\"middle\" font-size=\"11\"";

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void take(double a) { low = std::min(low, a), high = std::max(high, a); }
  /// Gives a range of one value, or of none, a width.
  void widen() {
    const double more = high > low ? 0.04 * (high - low) : 0.5 * std::max(std::abs(low), 1e-9);
    low -= more, high += more;
  }
};

class Panel {
 public:
  Panel(const CurvePanel& panel, double top) : panel_(panel), top_(top) {
    for (const Curve& c : panel.curves) {
      if (c.x.size() != c.y.size())
        throw InputError(fmt::format("curve '{}' has {} x and {} y; expected equal numbers", c.name,
                                     c.x.size(), c.y.size()));
      for (std::size_t k = 0; k < c.x.size(); ++k)
        if (drawn(c, k)) x_.take(c.x[k]), y_.take(scaled(c.y[k]));
    }
    if (!(x_.low <= x_.high))
      throw InputError("panel '" + panel.title + "' has no point to draw; expected at least one");
    y_.widen();
    if (x_.low == x_.high) x_.widen();
  }

  std::string draw() {
    out_ += text(kLeft, top_ - 26, panel_.title, "font-weight=\"bold\"");
    axes();
    names();
    for (const Curve& c : panel_.curves) c.dots ? dots(c) : line_of(c);
    return std::move(out_);
  }

 private:
  [[nodiscard]] double scaled(double y) const { return panel_.logarithmic ? std::log10(y) : y; }
  [[nodiscard]] bool drawn(const Curve& c, std::size_t k) const {
    return std::isfinite(c.x[k]) && std::isfinite(scaled(c.y[k]));
  }
  [[nodiscard]] double x(double a) const {
    return kLeft + (kWidth - kLeft - kRight) * (a - x_.low) / (x_.high - x_.low);
  }
  [[nodiscard]] double y(double a) const {
    return top_ + kPanel * (y_.high - a) / (y_.high - y_.low);
  }

  void line(double x0, double y0, double x1, double y1, const char* style) {
    out_ += fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" {}/>\n", x0, y0, x1, y1, style);
  }
  static double step_of(const Range& r, bool whole) {
    const double step = svg::round_down((r.high - r.low) / 4);
    return whole ? std::max(step, 1.0) : step;
  }

  void axes() {
    const double below = top_ + kPanel, right = kWidth - kRight;
    const double dy = panel_.logarithmic ? std::ceil(step_of(y_, true)) : step_of(y_, false);
    for (double k = std::ceil(y_.low / dy) + 0.0; k * dy <= y_.high; ++k) {
      line(kLeft, y(k * dy), right, y(k * dy), "stroke=\"#ddd\"");
      const std::string label = panel_.logarithmic ? fmt::format("1e{:.0f}", k * dy)
                                                   : fmt::format("{:.4g}", k * dy + 0.0);
      out_ += text(kLeft - 8, y(k * dy) + 4, label, kEnd);
    }
    const double dx = step_of(x_, false);
    for (double k = std::ceil(x_.low / dx - 1e-9) + 0.0; k * dx <= x_.high * (1 + 1e-9); ++k) {
      line(x(k * dx), below, x(k * dx), below + 4, "stroke=\"#444\"");
      out_ += text(x(k * dx), below + 16, fmt::format("{:.4g}", k * dx + 0.0), kMiddle);
    }
    line(kLeft, below, right, below, "stroke=\"#444\"");
    line(kLeft, top_, kLeft, below, "stroke=\"#444\"");
    out_ += text((kLeft + right) / 2, below + 32, panel_.x_label, kMiddle);
    out_ += fmt::format("<text transform=\"translate({:.1f} {:.1f}) rotate(-90)\" {}>{}</text>\n",
                        kLeft - 62, top_ + kPanel / 2, kMiddle, svg::escape(panel_.y_label));
  }

  void names() {
    double at = kLeft;
    for (const Curve& c : panel_.curves) {
      if (c.name.empty()) continue;
      const char* const colour = kColours[std::size_t(c.colour) % kColours.size()];
      if (c.dots) {
        out_ += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\" fill=\"{}\"/>\n", at + 8,
                            top_ - 12, colour);
      } else {
        line(at, top_ - 12, at + 16, top_ - 12,
             fmt::format("stroke=\"{}\" stroke-width=\"1.6\"", colour).c_str());
      }
      out_ += text(at + 21, top_ - 8, c.name, "font-size=\"11\"");
      at += 36 + kLetter * static_cast<double>(c.name.size());
    }
  }

  void line_of(const Curve& c) {
    std::string d;
    bool broken = true;
    for (std::size_t k = 0; k < c.x.size(); ++k) {
      if (drawn(c, k))
        d += fmt::format("{}{:.1f} {:.1f}", broken ? "M" : "L", x(c.x[k]), y(scaled(c.y[k])));
      broken = !drawn(c, k);
    }
    out_ += fmt::format("<path d=\"{}\" stroke=\"{}\" stroke-width=\"1.4\" fill=\"none\"/>\n", d,
                        kColours[std::size_t(c.colour) % kColours.size()]);
  }

  void dots(const Curve& c) {
    for (std::size_t k = 0; k < c.x.size(); ++k)
      if (drawn(c, k))
        out_ += fmt::format(
            "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2\" fill=\"{}\" fill-opacity=\"0.6\"/>\n",
            x(c.x[k]), y(scaled(c.y[k])), kColours[std::size_t(c.colour) % kColours.size()]);
  }

  const CurvePanel& panel_;
  double top_;
  Range x_, y_;  // y as drawn: in decades on a logarithmic scale
  std::string out_;
};

}  // namespace

std::string render_curves_svg(const std::string& title, std::span<const std::string> captions,
                              std::span<const CurvePanel> panels) {
  const double head = svg::kHead + svg::kLine * static_cast<double>(captions.size()) + 8;
  const double tall = head + (kAbove + kPanel + kBelow) * static_cast<double>(panels.size());
  std::string out = svg::begin(kWidth, tall) + svg::heading(title, captions);
  for (std::size_t k = 0; k < panels.size(); ++k)
    out += Panel(panels[k], head + kAbove + static_cast<double>(k) * (kAbove + kPanel + kBelow))
               .draw();
  return out + "</svg>\n";
}

}  // namespace tangere
