// SPDX-License-Identifier: Apache-2.0
// A ball of radius R that is d deep cuts the surface in a circle of radius √(2 R d - d²). On a
// layer it touches within about √(R d), and cells of side h make its force about 0.09 h/√(R d) too
// large (docs/layer.md).
#include "tasks/calibration/press_warnings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace tangere {
namespace {

constexpr double kLargestBall = 0.1, kLargestFlat = 0.3, kSmallestEnd = 1e-4;  // [m]
constexpr double kLargestByPad = 3;                          // radius, by the pad's longer side
constexpr double kDeepestPress = 0.05, kShallowest = 5e-6;   // [m], without a thickness
constexpr double kFastestPress = 2;                          // [m/s]
constexpr double kLeastFriction = 0.02, kMostFriction = 10;  // of skins
constexpr double kLeastModulus = 5e3, kMostModulus = 2e7;    // of skins [Pa]
constexpr double kSoftest = 5e5, kStiffest = 5e10;           // by area, without a thickness [N/m³]
constexpr double kFarDecades = 2, kNearDecades = 0.5;        // from the layout's, as powers of 10
constexpr double kFilm = 2.3;                                // kn t/E of a film (docs/skin.md)
constexpr double kCellError = 0.09, kMostCellError = 0.04;   // h/√(R d) has this error of a force
constexpr int kFewestPoints = 9;
constexpr double kNoisyRate = 0.05;      // error of a rate, of the largest
constexpr double kUsualLayerCell = 0.2;  // of a layer, by the thickness

/// "; 0.0075 if it is in mm".
std::string factor_text(double value, double factor, const char* what) {
  return fmt::format("; {:.3g} if {}", value * factor, what);
}

std::optional<double> ball_of(const Scene& scene) {
  const auto* const ball = std::get_if<SphereShape>(&scene.links.at(1).body.shape);
  return ball == nullptr ? std::nullopt : std::optional(ball->radius);
}

std::optional<double> thickness_of(const TactileDescription& d) {
  if (d.material) return d.material->thickness;
  if (d.table && d.table->thickness > 0) return d.table->thickness;
  return std::nullopt;
}

/// Distance of neighbouring points of an array, the mean of both axes; 0 for one point [m].
double mean_pitch(const RectArray& array) {
  std::vector<double> found;
  for (const auto& [axis, n] : {std::pair{&array.axis0, array.rows}, {&array.axis1, array.cols}}) {
    double length = 0;
    for (std::size_t i = 0; i < 3; ++i)
      length += (*axis)[i] * (array.corner1[i] - array.corner0[i]);
    if (n > 1) found.push_back(std::abs(length) / (n - 1));
  }
  return found.empty() ? 0 : std::sqrt(found.front() * found.back());
}

/// Points of the skin from the indenter's axis, and the longer side of the pad [m].
struct Places {
  std::vector<double> distance;
  double side = 0;
};
Places places_of(const Scene& scene) {
  const Vector3& axis = scene.links.at(1).joint.pose.position;
  Vector3 low{HUGE_VAL, HUGE_VAL, 0}, high{-HUGE_VAL, -HUGE_VAL, 0};
  Places out;
  for (const TactilePoint& point : tactile_points(scene.sensors.at(0))) {
    const Vector3& p = point.position;
    for (std::size_t i = 0; i < 2; ++i)
      low[i] = std::min(low[i], p[i]), high[i] = std::max(high[i], p[i]);
    out.distance.push_back(std::hypot(p[0] - axis[0], p[1] - axis[1]));
  }
  std::ranges::sort(out.distance);
  out.side = std::max(high[0] - low[0], high[1] - low[1]);
  return out;
}

double cut_radius(double ball, double depth) {
  return depth < ball ? std::sqrt(depth * (2 * ball - depth)) : ball;
}

/// A flat end may be larger than the pad: it is only held against a length that none has.
void warn_of_size(const Scene& scene, const Places& places, std::vector<std::string>& out) {
  const Shape& shape = scene.links.at(1).body.shape;
  const std::optional<double> ball = ball_of(scene);
  double size = ball.value_or(0);
  if (const auto* const flat = std::get_if<CylinderShape>(&shape)) size = flat->radius;
  if (const auto* const box = std::get_if<CuboidShape>(&shape))
    size = std::max(box->size[0], box->size[1]);
  const double most = !ball             ? kLargestFlat
                      : places.side > 0 ? std::min(kLargestBall, kLargestByPad * places.side)
                                        : kLargestBall;
  const char* const what = ball ? "a ball of radius" : "a flat end of size";
  if (size > most)
    out.push_back(fmt::format("{} {:.4g} m on a pad of {:.3g} m; expected metres, {:.3g} at most{}",
                              what, size, places.side, most,
                              factor_text(size, 1e-3, "it is in mm")));
  if (size < kSmallestEnd)
    out.push_back(fmt::format("{} {:.4g} m; expected metres, {:.3g} at least{}", what, size,
                              kSmallestEnd, factor_text(size, 1e3, "it was divided by 1000")));
}

/// "line 7: ", where a row of a file is.
std::string place_text(const PressRecording& r, std::size_t row) {
  return row < r.lines.size() ? fmt::format("line {}: ", r.lines[row]) : "";
}

bool is_milli(const std::string& unit) { return unit.starts_with("m") && unit.size() > 1; }

void warn_of_depth(const PressRecording& r, std::optional<double> thickness,
                   std::vector<std::string>& out) {
  if (r.rows() == 0) return;
  const auto deepest = std::size_t(std::ranges::max_element(r.depth) - r.depth.begin());
  const double depth = r.depth[deepest], most = thickness.value_or(kDeepestPress);
  const bool milli = is_milli(r.units.depth);
  const char* const likely = milli ? "the column, which is named mm, is in um: divide it by 1000"
                                   : "the column is in mm: name it depth_mm";
  if (depth > most)
    out.push_back(
        place_text(r, deepest) +
        fmt::format("a depth of {:.4g} m {}; expected metres, positive into the skin, {:.3g} at "
                    "most{}",
                    depth, thickness ? "in a skin that ends at its thickness" : "in a skin", most,
                    depth * 1e-3 < most ? factor_text(depth, 1e-3, likely) : ""));
  if (depth > 0 && depth < kShallowest)
    out.push_back(place_text(r, deepest) +
                  fmt::format("a largest depth of {:.3g} m; expected {:.3g} at least{}", depth,
                              kShallowest,
                              factor_text(depth, 1e3,
                                          milli ? "the column is in m: name it depth_m"
                                                : "it was divided by 1000: multiply it by 1000")));
}

void warn_of_speed(const PressRecording& r, std::vector<std::string>& out) {
  const std::vector<double> rates = r.rates();
  std::size_t row = 0;
  for (std::size_t k = 0; k < rates.size(); ++k)
    if (std::abs(rates[k]) > std::abs(rates[row])) row = k;
  const double fastest = rates.empty() ? 0 : std::abs(rates[row]);
  if (fastest > kFastestPress)
    out.push_back(
        place_text(r, row) +
        fmt::format(
            "a speed of {:.3g} m/s; expected times in s, and {:.3g} m/s at most{}", fastest,
            kFastestPress,
            factor_text(fastest, 1e-3,
                        is_milli(r.units.time) ? "the times are in s: name the column time_s"
                                               : "times or depths are 1000 times off")));
}

void warn_of_shear(const PressRecording& r, double side, std::vector<std::string>& out) {
  if (r.shear.empty()) return;
  const auto size = [](double x) { return std::abs(x); };
  const auto farthest = std::size_t(std::ranges::max_element(r.shear, {}, size) - r.shear.begin());
  const double shear = size(r.shear[farthest]), most = kLargestByPad * side;
  if (shear > most)
    out.push_back(
        place_text(r, farthest) +
        fmt::format("a shear of {:.4g} m; expected metres, {:.3g} at most, three times the "
                    "pad{}",
                    shear, most,
                    shear * 1e-3 < most
                        ? factor_text(shear, 1e-3, "the column is in mm: name it shear_mm")
                        : ""));
  if (shear > 0 && shear < kShallowest)
    out.push_back(
        place_text(r, farthest) +
        fmt::format("a largest shear of {:.3g} m; expected {:.3g} at least{}", shear, kShallowest,
                    factor_text(shear, 1e3, "it was divided by 1000: multiply it by 1000")));
}

/// Whether points and cells are fine enough for the deepest row.
void warn_of_resolution(const TactileDescription& d, double ball, double depth,
                        const Places& places, std::vector<std::string>& out) {
  if (!(depth > 0)) return;
  const double radius = cut_radius(ball, depth);
  const auto points = std::ranges::count_if(places.distance, [&](double x) { return x < radius; });
  if (points > 0 && points < kFewestPoints)
    out.push_back(fmt::format(
        "the ball touches {} point{} at its largest depth, {:.3g} m, where its contact has a "
        "radius "
        "of {:.3g} m; the force depends on where it stands between the points: expected {} points, "
        "or a larger ball",
        points, points == 1 ? "" : "s", depth, radius, kFewestPoints));
  if (!d.layer) return;
  const double pitch = mean_pitch(d.array),
               size = d.layer->cell > 0 ? d.layer->cell : kUsualLayerCell * d.material->thickness,
               cell = pitch * std::max(1.0, std::round(size / pitch)),
               touched = std::sqrt(ball * depth), error = kCellError * cell / touched;
  if (error > kMostCellError)
    out.push_back(fmt::format(
        "the cells of the layer, {:.3g} m, are coarse for a contact of {:.3g} m: its forces are "
        "about "
        "{:.0f} % too large at the deepest row, and so much the modulus is too small; expected "
        "<layer cell=\"{:.2g}\"/> at most, with points as close",
        cell, touched, 100 * error, kMostCellError * touched / kCellError));
}

/// A unit that recorded forces may be in, and its factor.
struct ForceUnit {
  double factor;
  std::string name;
};
/// `area`: for which a point stands [m²]; 0: not known.
std::vector<ForceUnit> force_units(const PressRecording& r, double area) {
  if (is_milli(r.units.force))
    return {{1e-3, "1000 times too large, in uN: divide them by 1000"},
            {1e3, "in N: name the column force_N"}};
  if (r.points == 0)
    return {{1e-3, "in mN: name the column force_mN"}, {1e3, "in kN, or were divided by 1000"}};
  std::vector<ForceUnit> out;
  const auto add = [&](double factor, const char* unit) {
    out.push_back({factor, fmt::format("in {}: name the field with --column field={:.4g}*NAME",
                                       unit, factor)});
  };
  add(1e-3, "mN"), add(1e3, "kN, or were divided by 1000");
  if (area > 0) add(1e3 * area, "kPa, pressures on the area of a point"), add(area, "Pa, likewise");
  return out;
}

double area_of(const TactileDescription& d) {
  if (d.cell > 0 || !d.points.empty()) return d.cell;
  return std::pow(mean_pitch(d.array), 2);
}

/// Stiffness of a skin: Young's modulus [Pa], or by area [N/m³].
struct SkinStiffness {
  double value;
  bool modulus;
};
std::optional<SkinStiffness> stiffness_of(const TactileDescription& d) {
  const double area = area_of(d);
  const std::optional<double> thickness = thickness_of(d);
  if (d.layer && d.material) return SkinStiffness{d.material->modulus, true};
  if (!d.table && !(area > 0)) return std::nullopt;
  const double kn = d.table ? d.table->stiffness() : d.coefficients.kn / area;
  if (thickness) return SkinStiffness{kn * *thickness / kFilm, true};
  return SkinStiffness{kn, false};
}

/// How far two positive numbers are apart, as a power of 10.
double decades(double a, double b) { return std::abs(std::log10(a / b)); }

}  // namespace

std::vector<std::string> press_warnings(const Scene& scene, const PressRecording& r) {
  std::vector<std::string> out;
  const Places places = places_of(scene);
  const std::optional<double> ball = ball_of(scene);
  const double depth = r.rows() > 0 ? *std::ranges::max_element(r.depth) : 0;
  warn_of_size(scene, places, out);
  warn_of_depth(r, thickness_of(scene.sensors[0]), out);
  warn_of_speed(r, out);
  warn_of_shear(r, places.side, out);
  if (ball && out.empty()) warn_of_resolution(scene.sensors[0], *ball, depth, places, out);
  return out;
}

std::vector<std::string> friction_warnings(const Scene& scene) {
  const double mu = scene.sensors.at(0).coefficients.mu;
  if (mu >= kLeastFriction && mu <= kMostFriction) return {};
  return {
      fmt::format("a friction of {:.3g}; expected {} to {}. Compare the units of shear_force and "
                  "force, and that "
                  "of shear: in mN a force is 1000 times too large (name it shear_force_mN), in kN "
                  "it is as much "
                  "too small",
                  mu, kLeastFriction, kMostFriction)};
}

std::vector<std::string> skin_warnings(const Scene& scene, const Scene& layout,
                                       const PressRecording& r) {
  const std::optional<SkinStiffness> found = stiffness_of(scene.sensors.at(0)),
                                     own = stiffness_of(layout.sensors.at(0));
  if (!found || !(found->value > 0)) return {};
  const bool modulus = found->modulus;
  const double value = found->value, low = modulus ? kLeastModulus : kSoftest,
               high = modulus ? kMostModulus : kStiffest;
  const auto plausible = [=](double x) { return x >= low && x <= high; };
  // The layout's, if it is of the same kind and one that skins have.
  const bool known = own && own->modulus == modulus && plausible(own->value);
  const double usual = known ? own->value : std::sqrt(low * high);
  std::vector<ForceUnit> units;
  for (const ForceUnit& unit : force_units(r, area_of(scene.sensors[0])))
    if (plausible(value * unit.factor)) units.push_back(unit);
  const auto off = [&](const ForceUnit& unit) { return decades(value * unit.factor, usual); };
  std::ranges::stable_sort(units, {}, off);
  const bool near = known && !units.empty() && decades(value, usual) > kFarDecades &&
                    off(units[0]) < kNearDecades;
  if (plausible(value) && !near) return {};
  const char* const what = modulus ? "Pa (Young's modulus)" : "N/m³ (stiffness by area)";
  std::string text =
      plausible(value)
          ? fmt::format("a skin of {:.3g} {}, {:.2g} times the {:.3g} of the layout", value, what,
                        value / usual, usual)
          : fmt::format("a skin of {:.3g} {}; expected {:.0e} to {:.0e}", value, what, low, high);
  for (const ForceUnit& unit : units)
    text += fmt::format("; {:.3g} if forces are {}", value * unit.factor, unit.name);
  return {text};
}

namespace {

double median(std::vector<double> numbers) {
  if (numbers.empty()) return 0;
  const auto middle = numbers.begin() + std::ssize(numbers) / 2;
  std::ranges::nth_element(numbers, middle);
  return *middle;
}

void warn_of_rates(const PressRecording& r, double relaxation, bool contained,
                   std::vector<std::string>& out) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < r.time.size(); ++k) steps.push_back(r.time[k] - r.time[k - 1]);
  const double step = median(steps);
  if (step > relaxation)
    out.push_back(fmt::format(
        "rows are {:.3g} s apart, longer than the relaxation of {:.3g} s: rates between rows are "
        "means, which the intervals do not contain; expected {:.2g} s at most",
        step, relaxation, relaxation));
  double fastest = 0;
  for (const double rate : r.rates()) fastest = std::max(fastest, std::abs(rate));
  const double noise = r.depth_scatter(), error = noise / (std::sqrt(2.0) * step);
  if (!contained && error > kNoisyRate * fastest)
    out.push_back(fmt::format(
        "depths scatter by about {:.2g} m, so rates by {:.2g} m/s, {:.0f} % of the largest: the "
        "forces do not follow, so the intervals do not contain errors of the depth; if they are "
        "errors, --depth-error has their deviation",
        noise, error, 100 * error / fastest));
}

}  // namespace

std::vector<std::string> rate_warnings(const Scene& scene, const PressRecording& r,
                                       bool depth_errors) {
  const TactileDescription& d = scene.sensors.at(0);
  const double relaxation = d.table ? d.table->relaxation : d.material ? d.material->relaxation : 0;
  std::vector<std::string> out;
  if (r.time.size() < 2 || !(relaxation > 0)) return out;
  warn_of_rates(r, relaxation, depth_errors, out);
  return out;
}

std::string why_no_touch(const Scene& scene, double depth) {
  const Places places = places_of(scene);
  const std::optional<double> ball = ball_of(scene);
  if (!ball || !(depth > 0) || places.distance.empty()) return "";
  const double radius = cut_radius(*ball, depth);
  if (places.distance[0] < radius) return "";
  return fmt::format(
      "the ball's contact has a radius of {:.3g} m at the largest depth, {:.3g} m, and "
      "the nearest point is {:.3g} m from its axis: it falls between the points",
      radius, depth, places.distance[0]);
}

}  // namespace tangere
