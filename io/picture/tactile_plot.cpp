// SPDX-License-Identifier: Apache-2.0
// Layout: panels side by side, a colour bar at the right, captions below. Lengths are in SVG units
// (pixels at 96 dpi).
#include "io/picture/tactile_plot.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "engine/base/error.hpp"
#include "io/picture/svg.hpp"
#include "io/picture/tactile_drawing.hpp"

namespace tangere {

namespace {

using svg::round_down;
using svg::text;

constexpr int kMostCells = 80;   // cells along one side of a map; keeps files under a megabyte
constexpr int kMostArrows = 16;  // arrows along one side
constexpr double kPanel = 240, kGap = 28, kLeft = 64, kTop = 84, kBar = 110, kBottom = 86;

/// One panel: mean pressure per cell and mean shear per arrow, each with its own grid.
struct Panel {
  std::int64_t frame = 0, step = 0;
  int rows = 0, cols = 0, arrow_rows = 0, arrow_cols = 0;
  std::vector<double> pressure;              // (rows, cols) [N]
  std::vector<std::array<double, 2>> shear;  // (arrow_rows, arrow_cols): down, right [N]
  double total_pressure = 0, total_shear[2] = {0, 0};
  bool touched = false;
};

Panel make_panel(const TrajectoryReader& file, std::size_t sensor, std::int64_t frame,
                 std::int64_t environment) {
  const SensorLayout& s = file.sensors()[sensor];
  const TactileDrawing d = drawing_of(s);
  const std::vector<double> force = file.force(sensor, frame, environment);
  Panel p;
  p.frame = frame;
  p.step = file.step(sensor, frame);
  p.rows = std::min(d.rows, kMostCells);
  p.cols = std::min(d.cols, kMostCells);
  p.arrow_rows = std::min(d.rows, kMostArrows);
  p.arrow_cols = std::min(d.cols, kMostArrows);
  p.pressure.assign(std::size_t(p.rows) * p.cols, 0);
  p.shear.assign(std::size_t(p.arrow_rows) * p.arrow_cols, {0, 0});
  std::vector<int> cells(p.pressure.size(), 0), points(p.shear.size(), 0);
  for (std::size_t k = 0; k < d.cell.size(); ++k) {
    const double* f = &force[3 * k];
    const std::array<double, 2> shear = d.shear(k, f[0], f[1]);
    p.total_pressure += s.pressure_sign * f[2];
    for (int c = 0; c < 2; ++c) p.total_shear[c] += shear[c];
    p.touched = p.touched || f[0] != 0 || f[1] != 0 || f[2] != 0;
    if (d.cell[k][0] < 0) continue;
    const std::int64_t i = d.cell[k][0], j = d.cell[k][1];
    const std::size_t cell = std::size_t(i * p.rows / d.rows * p.cols + j * p.cols / d.cols);
    const std::size_t arrow =
        std::size_t(i * p.arrow_rows / d.rows * p.arrow_cols + j * p.arrow_cols / d.cols);
    p.pressure[cell] += s.pressure_sign * f[2];
    ++cells[cell];
    for (int c = 0; c < 2; ++c) p.shear[arrow][c] += shear[c];
    ++points[arrow];
  }
  for (std::size_t k = 0; k < cells.size(); ++k) p.pressure[k] /= std::max(cells[k], 1);
  for (std::size_t k = 0; k < points.size(); ++k)
    for (double& x : p.shear[k]) x /= std::max(points[k], 1);
  return p;
}

/// Goes from dark blue to pale yellow. Lightness rises evenly, so equal steps of force look equal.
std::string colour(double x) {
  static constexpr double kStops[][3] = {{20, 22, 60},   {42, 60, 120},  {30, 112, 142},
                                         {62, 162, 122}, {158, 200, 88}, {250, 236, 130}};
  x = std::clamp(x, 0.0, 1.0) * 5;
  const int k = std::min(4, static_cast<int>(x));
  int rgb[3];
  for (int c = 0; c < 3; ++c)
    rgb[c] =
        static_cast<int>(std::lround(kStops[k][c] + (x - k) * (kStops[k + 1][c] - kStops[k][c])));
  return fmt::format("#{:02x}{:02x}{:02x}", rgb[0], rgb[1], rgb[2]);
}

struct Unit {
  double factor;
  const char* name;
};
Unit unit_for(double largest) {
  if (largest >= 0.1 || largest == 0) return {1, "N"};
  if (largest >= 1e-4) return {1e3, "mN"};
  if (largest >= 1e-7) return {1e6, "µN"};
  return {1e9, "nN"};
}

class Picture {
 public:
  Picture(const TrajectoryReader& file, std::size_t sensor, std::vector<Panel> panels,
          std::int64_t environment)
      : file_(file),
        s_(file.sensors()[sensor]),
        with_pressure_(file.has_pressure(sensor)),
        with_shear_(file.has_shear(sensor)),
        drawing_(drawing_of(s_)),
        panels_(std::move(panels)),
        environment_(environment),
        width_m_(drawing_.width),
        height_m_(drawing_.height) {
    if (!(height_m_ > 0)) height_m_ = width_m_ > 0 ? width_m_ : 1e-3;
    if (!(width_m_ > 0)) width_m_ = height_m_;
    const double scale = kPanel / std::max(width_m_, height_m_);
    width_ = width_m_ * scale;
    height_ = height_m_ * scale;
    for (const Panel& p : panels_) {
      for (double x : p.pressure) low_ = std::min(low_, x), high_ = std::max(high_, x);
      for (const auto& f : p.shear) longest_ = std::max(longest_, std::hypot(f[0], f[1]));
    }
    if (high_ <= low_) high_ = low_ + 1e-9;
  }

  std::string draw() {
    const double total = kLeft + double(panels_.size()) * (width_ + kGap) + kBar;
    const double tall = kTop + height_ + kBottom;
    out_ = svg::begin(total, tall);
    out_ += text(
        kLeft, 28,
        fmt::format("{}: sensor '{}', environment {}", file_.scene_name(), s_.name, environment_),
        "font-size=\"16\" font-weight=\"bold\"");
    const std::string points = s_.rectangular()
                                   ? fmt::format("{} × {} points", s_.rows, s_.cols)
                                   : fmt::format("{} points in an image of {} × {}", s_.points,
                                                 drawing_.rows, drawing_.cols);
    out_ +=
        text(kLeft, 48,
             points +
                 (with_pressure_ ? "; colour: normal force per point (pressure positive)"
                                 : "; pressure was not recorded") +
                 (with_shear_ ? "; arrows: shear force on the body" : "; shear was not recorded"));
    for (std::size_t k = 0; k < panels_.size(); ++k)
      panel(panels_[k], kLeft + double(k) * (width_ + kGap), k == 0);
    if (with_pressure_) bar(kLeft + double(panels_.size()) * (width_ + kGap));
    captions(tall);
    out_ += "</svg>\n";
    return std::move(out_);
  }

 private:
  void panel(const Panel& p, double x0, bool first) {
    const double cell_w = width_ / p.cols, cell_h = height_ / p.rows;
    out_ += text(x0, kTop - 10,
                 fmt::format("t = {:.3f} s (step {})", double(p.step) * file_.timestep(), p.step));
    out_ += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"{:.2f}\" fill=\"{}\"/>\n", x0,
        kTop, width_, height_, colour((0 - low_) / (high_ - low_)));
    out_ += "<g shape-rendering=\"crispEdges\">\n";
    for (int i = 0; i < p.rows; ++i)
      for (int j = 0; j < p.cols; ++j) {
        const double f = p.pressure[std::size_t(i) * p.cols + j];
        if (f == 0) continue;
        out_ += fmt::format(
            "<rect x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" fill=\"{}\"/>\n",
            x0 + j * cell_w, kTop + i * cell_h, cell_w + 0.05, cell_h + 0.05,
            colour((f - low_) / (high_ - low_)));
      }
    out_ +=
        "</g>\n<g stroke=\"#ffffff\" stroke-width=\"1.3\" fill=\"none\" "
        "stroke-linecap=\"round\">\n";
    arrows(p, x0);
    out_ += "</g>\n";
    if (!p.touched)
      out_ += text(x0 + width_ / 2, kTop + height_ / 2, "no contact",
                   "text-anchor=\"middle\" fill=\"#fff\"");
    out_ += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"{:.2f}\" fill=\"none\" "
        "stroke=\"#444\"/>\n",
        x0, kTop, width_, height_);
    axes(x0, first);
    const Unit u = unit_for(std::abs(p.total_pressure));
    if (with_pressure_)
      out_ += text(x0, kTop + height_ + 46,
                   fmt::format("sum: pressure {:.3g} {}", p.total_pressure * u.factor, u.name));
    if (!with_shear_) return;
    const double shear = std::hypot(p.total_shear[0], p.total_shear[1]);
    const Unit v = unit_for(shear);
    out_ += text(x0, kTop + height_ + 61, fmt::format("shear {:.3g} {}", shear * v.factor, v.name));
  }

  void arrows(const Panel& p, double x0) {
    if (!(longest_ > 0)) return;
    const double cell_w = width_ / p.arrow_cols, cell_h = height_ / p.arrow_rows;
    const double scale = 0.95 * std::max(cell_w, cell_h) / longest_;
    for (int i = 0; i < p.arrow_rows; ++i)
      for (int j = 0; j < p.arrow_cols; ++j) {
        const auto& f = p.shear[std::size_t(i) * p.arrow_cols + j];
        const double dx = f[1] * scale, dy = f[0] * scale, length = std::hypot(dx, dy);
        if (length < 1) continue;
        const double x = x0 + (j + 0.5) * cell_w - dx / 2, y = kTop + (i + 0.5) * cell_h - dy / 2;
        const double head = std::min(4.0, 0.4 * length), ux = dx / length, uy = dy / length;
        const double tip_x = x + dx, tip_y = y + dy;
        out_ += fmt::format(
            "<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}M{:.1f} {:.1f}L{:.1f} {:.1f}L{:.1f} "
            "{:.1f}\"/>\n",
            x, y, tip_x, tip_y, tip_x - head * (ux - 0.6 * uy), tip_y - head * (uy + 0.6 * ux),
            tip_x, tip_y, tip_x - head * (ux + 0.6 * uy), tip_y - head * (uy - 0.6 * ux));
      }
  }

  void axes(double x0, bool first) {
    const double below = kTop + height_;
    out_ += text(x0, below + 16, "0", "text-anchor=\"middle\" font-size=\"11\"");
    out_ += text(x0 + width_, below + 16, fmt::format("{:.3g}", width_m_ * 1e3),
                 "text-anchor=\"middle\" font-size=\"11\"");
    out_ += text(x0 + width_ / 2, below + 16, s_.rectangular() ? "axis1 [mm]" : "columns [mm]",
                 "text-anchor=\"middle\" font-size=\"11\"");
    if (!first) return;
    out_ += text(x0 - 6, kTop + 8, "0", "text-anchor=\"end\" font-size=\"11\"");
    out_ += text(x0 - 6, below, fmt::format("{:.3g}", height_m_ * 1e3),
                 "text-anchor=\"end\" font-size=\"11\"");
    out_ += fmt::format(
        "<text transform=\"translate({:.1f} {:.1f}) rotate(-90)\" text-anchor=\"middle\" "
        "font-size=\"11\">{} [mm]</text>\n",
        x0 - 34, kTop + height_ / 2, s_.rectangular() ? "axis0" : "rows");
  }

  void bar(double x0) {
    constexpr int kSteps = 60;
    const double step = height_ / kSteps;
    for (int k = 0; k < kSteps; ++k)
      out_ += fmt::format(
          "<rect x=\"{:.1f}\" y=\"{:.2f}\" width=\"14\" height=\"{:.2f}\" fill=\"{}\"/>\n", x0,
          kTop + height_ - (k + 1) * step, step + 0.3, colour((k + 0.5) / kSteps));
    const Unit u = unit_for(std::max(std::abs(low_), std::abs(high_)));
    constexpr int kLabels = 5;
    for (int k = 0; k < kLabels; ++k) {
      const double f = low_ + (high_ - low_) * k / (kLabels - 1);
      out_ += text(x0 + 20, kTop + height_ * (1 - double(k) / (kLabels - 1)) + 4,
                   fmt::format("{:.3g}", f * u.factor), "font-size=\"11\"");
    }
    out_ += text(x0, kTop - 10, u.name);
  }

  void captions(double tall) {
    const bool pooled = drawing_.rows > kMostCells || drawing_.cols > kMostCells;
    std::string note = pooled ? fmt::format("Colours are means over cells of a {} × {} grid. ",
                                            panels_[0].rows, panels_[0].cols)
                              : "";
    if (longest_ > 0) {
      const Unit u = unit_for(longest_);
      const double shown = round_down(longest_);
      const double length =
          shown / longest_ * 0.95 *
          std::max(width_ / panels_[0].arrow_cols, height_ / panels_[0].arrow_rows);
      out_ += fmt::format(
          "<path d=\"M{0:.1f} {1:.1f}h{2:.1f}m-3 -2.4l3 2.4l-3 2.4\" stroke=\"#222\" "
          "stroke-width=\"1.3\" fill=\"none\"/>\n",
          kLeft, tall - 10, length);
      note = fmt::format("= {:.3g} {} shear per point. ", shown * u.factor, u.name) + note;
      out_ += text(kLeft + length + 6, tall - 6, note, "font-size=\"11\"");
    } else if (with_shear_) {
      out_ += text(kLeft, tall - 6, note + "No shear in these frames.", "font-size=\"11\"");
    }
  }

  const TrajectoryReader& file_;
  const SensorLayout& s_;
  bool with_pressure_, with_shear_;  // whether they were recorded
  TactileDrawing drawing_;
  std::vector<Panel> panels_;
  std::int64_t environment_;
  double width_m_, height_m_, width_ = 0, height_ = 0;
  double low_ = 0, high_ = 0, longest_ = 0;
  std::string out_;
};

/// Chooses frames spread evenly over those with contact; only the last one if nothing ever touches.
std::vector<Panel> choose_panels(const TrajectoryReader& file, std::size_t sensor,
                                 const PlotOptions& o) {
  const std::int64_t frames = file.frames(sensor);
  if (o.frame) {
    if (*o.frame < 0 || *o.frame >= frames)
      throw InputError(fmt::format("frame {}: sensor '{}' has frames 0 to {}", *o.frame,
                                   file.sensors()[sensor].name, frames - 1));
    return {make_panel(file, sensor, *o.frame, o.environment)};
  }
  std::vector<std::int64_t> touched;
  for (std::int64_t k = 0; k < frames; ++k) {
    const std::vector<double> force = file.force(sensor, k, o.environment);
    if (std::any_of(force.begin(), force.end(), [](double f) { return f != 0; }))
      touched.push_back(k);
  }
  if (touched.empty()) touched.push_back(frames - 1);
  const std::int64_t n = static_cast<std::int64_t>(touched.size()),
                     shown = std::min<std::int64_t>(o.strip, n);
  std::vector<Panel> panels;
  for (std::int64_t k = 0; k < shown; ++k) {
    const std::int64_t at = shown == 1 ? n - 1 : k * (n - 1) / (shown - 1);
    panels.push_back(make_panel(file, sensor, touched[std::size_t(at)], o.environment));
  }
  return panels;
}

}  // namespace

std::vector<std::string> drawable_sensors(const TrajectoryReader& file) {
  std::vector<std::string> names;
  for (const SensorLayout& s : file.sensors())
    if (drawable(s)) names.push_back(s.name);
  return names;
}

std::string render_tactile_svg(const TrajectoryReader& file, const PlotOptions& o) {
  const std::vector<std::string> names = drawable_sensors(file);
  const std::size_t sensor =
      file.find_sensor(o.sensor.empty() && !names.empty() ? names[0] : o.sensor);
  const SensorLayout& s = file.sensors()[sensor];
  if (!drawable(s))
    throw InputError(fmt::format(
        "sensor '{}' is not a rectangular array and has no image; {}", s.name,
        names.empty() ? "only those can be drawn, and the file has none"
                      : fmt::format("those that can be drawn: {}", fmt::join(names, ", "))));
  if (o.environment < 0 || o.environment >= file.environments())
    throw InputError(fmt::format("environment {}: the file has 0 to {}", o.environment,
                                 file.environments() - 1));
  if (o.strip < 1)
    throw InputError(fmt::format("a strip of {} frames; expected at least 1", o.strip));
  if (file.frames(sensor) == 0)
    throw InputError("sensor '" + s.name + "' has no frame in this file: the run was too short");
  return Picture(file, sensor, choose_panels(file, sensor, o), o.environment).draw();
}

}  // namespace tangere
