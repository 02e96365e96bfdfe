// SPDX-License-Identifier: Apache-2.0
// Layout: captions, a row for each bar with its name on the left and its number on the right, the
// axis, and what the colours mean. Lengths are in SVG units (pixels at 96 dpi).
#include "io/picture/share_plot.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/error.hpp"
#include "io/picture/svg.hpp"

namespace tangere {
namespace {

using svg::text;

constexpr double kWidth = 760, kNames = 230, kNumbers = 100, kRow = 18, kBar = 12;
constexpr double kAxis = 34, kLegend = 18;
constexpr const char* kColours[] = {"#1e708e", "#8fbcd0", "#c9822b", "#9a9a9a"};
constexpr const char* kEnd = "text-anchor=\"end\" font-size=\"11\"";
constexpr const char* kMiddle = "text-anchor=\"middle\" font-size=\"11\"";
constexpr const char* kSmall = "font-size=\"11\"";

class SharePicture {
 public:
  explicit SharePicture(const ShareBars& shares)
      : shares_(shares),
        top_(svg::kHead + svg::kLine * static_cast<double>(shares.captions.size()) + 12),
        bottom_(top_ + kRow * static_cast<double>(shares.bars.size())) {
    for (const ShareBar& bar : shares.bars) {
      low_ = std::min(low_, bar.share - bar.spread);
      high_ = std::max(high_, bar.share + bar.spread);
    }
    high_ = std::max(high_, 0.01);
  }

  std::string draw() {
    const double tall = bottom_ + kAxis + kLegend * static_cast<double>(shares_.groups.size()) + 10;
    out_ = svg::begin(kWidth, tall) + svg::heading(shares_.title, shares_.captions);
    grid();
    for (std::size_t k = 0; k < shares_.bars.size(); ++k)
      bar(shares_.bars[k], top_ + kRow * static_cast<double>(k));
    line(x(0), top_, x(0), bottom_, "#444");
    for (std::size_t g = 0; g < shares_.groups.size(); ++g) {
      const double at = bottom_ + kAxis + kLegend * static_cast<double>(g);
      box(kNames, at, kBar, kBar, kColours[g]);
      out_ += text(kNames + kBar + 8, at + kBar - 2, shares_.groups[g], kSmall);
    }
    out_ += "</svg>\n";
    return std::move(out_);
  }

 private:
  [[nodiscard]] double x(double share) const {
    return kNames + (kWidth - kNames - kNumbers) * (share - low_) / (high_ - low_);
  }
  void line(double x0, double y0, double x1, double y1, const char* colour) {
    out_ += fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"{}\"/>\n", x0, y0, x1,
                        y1, colour);
  }
  void box(double left, double high, double wide, double tall, const char* colour) {
    out_ += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>\n", left,
        high, wide, tall, colour);
  }

  void grid() {
    const double step = svg::round_down((high_ - low_) / 3);
    for (double k = std::ceil(low_ / step); k * step <= high_; ++k) {
      line(x(k * step), top_, x(k * step), bottom_ + 4, "#ddd");
      out_ +=
          text(x(k * step), bottom_ + 18, fmt::format("{:.4g} %", 100 * k * step + 0.0), kMiddle);
    }
  }

  void bar(const ShareBar& of, double at) {
    const double middle = at + kRow / 2, left = x(std::min(0.0, of.share));
    out_ += text(kNames - 10, middle + 4, of.label, kEnd);
    box(left, middle - kBar / 2, x(std::max(0.0, of.share)) - left, kBar,
        kColours[static_cast<std::size_t>(of.group)]);
    if (of.spread > 0)
      line(x(of.share - of.spread), middle, x(of.share + of.spread), middle, "#222");
    out_ +=
        text(kWidth - 12, middle + 4,
             of.spread > 0 ? fmt::format("{:.1f} % ± {:.1f}", 100 * of.share + 0.0, 100 * of.spread)
                           : fmt::format("{:.1f} %", 100 * of.share + 0.0),
             kEnd);
  }

  const ShareBars& shares_;
  double low_ = 0, high_ = 0, top_, bottom_;
  std::string out_;
};

}  // namespace

std::string render_share_svg(const ShareBars& shares) {
  if (shares.bars.empty()) throw InputError("a picture of shares without bars");
  if (shares.groups.empty() || shares.groups.size() > std::size(kColours))
    throw InputError(fmt::format("a picture of shares with {} groups; expected 1 to {}",
                                 shares.groups.size(), std::size(kColours)));
  for (const ShareBar& bar : shares.bars)
    if (!std::isfinite(bar.share) || !std::isfinite(bar.spread) || bar.spread < 0 ||
        bar.group < 0 || static_cast<std::size_t>(bar.group) >= shares.groups.size())
      throw InputError(fmt::format(
          "share '{}' is {} ± {} of group {}; expected finite numbers and one of {} groups",
          bar.label, bar.share, bar.spread, bar.group, shares.groups.size()));
  return SharePicture(shares).draw();
}

}  // namespace tangere
