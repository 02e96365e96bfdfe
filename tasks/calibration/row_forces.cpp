// SPDX-License-Identifier: Apache-2.0
// A slider beside the skin has at the depths d > 0 of a path the force s' = clamp(s + k (d' - d),
// ±F), and 0 outside. With times, the rate of a row's own force is that of both of its neighbours,
// and friction follows from the way since the row before.
#include "tasks/calibration/row_forces.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace tangere {
namespace {

/// The rows of a recording as they act, with the numbers of the recording.
class Acting {
 public:
  Acting(const PressRecording& r, const SkinNumbers& numbers, const DepthShift& shift = {})
      : time_(r.time), depth_(acting_depths(r, numbers)), fields_(r.points > 0) {
    for (double& d : depth_) d += shift.depth;
    for (std::size_t k = 0; k < shift.rows.size(); ++k) depth_[k] += shift.rows[k];
    PressRecording moved;
    moved.time = r.time, moved.depth = depth_;
    rate_ = moved.rates();
    for (double& rate : rate_) rate += shift.rate;
    const double dx = number_or(numbers, kPlaceX, 0), dy = number_or(numbers, kPlaceY, 0);
    x_ = r.shear.empty() ? r.x : r.shear, y_ = r.y;
    if (dx != 0) x_.resize(r.rows());
    if (dy != 0) y_.resize(r.rows());
    for (double& x : x_) x += dx;
    for (double& y : y_) y += dy;
  }

  /// Of presses without friction. A sum does not depend on where the indenter went by shear.
  [[nodiscard]] PressPath normal() const {
    PressPath path = whole();
    if (!fields_) path.x = path.y = {};
    return path;
  }
  [[nodiscard]] PressPath whole() const {
    return {.depth = depth_, .rate = rate_, .time = time_, .x = x_, .y = y_, .fields = fields_};
  }
  [[nodiscard]] std::span<const double> depth() const { return depth_; }

 private:
  std::vector<double> time_, depth_, rate_, x_, y_;
  bool fields_;
};

/// Adds the numbers of the load cell: the slider, if there is one, and the zero of the force. The
/// indenter does not pull.
void add_recorded(std::span<const double> depth, const SkinNumbers& numbers,
                  std::vector<double>& force) {
  const double stiffness = number_or(numbers, kSlider, 0),
               offset = number_or(numbers, kForceZero, 0);
  const double most = stiffness == 0 ? 0 : numbers.at(kSliderForce);
  double s = 0;
  for (std::size_t k = 0; k < depth.size() && stiffness != 0; ++k) {
    const double before = std::max(depth[k > 0 ? k - 1 : 0], 0.0);
    s = depth[k] > 0 ? std::clamp(s + stiffness * (depth[k] - before), -most, most) : 0;
    force[k] = std::max(force[k] + s, 0.0);
  }
  if (offset != 0)
    for (double& f : force) f += offset;
}

}  // namespace

double number_or(const SkinNumbers& numbers, const std::string& name, double otherwise) {
  const auto at = numbers.find(name);
  return at == numbers.end() ? otherwise : at->second;
}

double peak_of(std::span<const double> force) {
  double peak = 0;
  for (const double f : force) peak = std::max(peak, std::abs(f));
  return peak;
}

bool varies(std::span<const double> column) {
  return std::ranges::adjacent_find(column, std::ranges::not_equal_to()) != column.end();
}

std::vector<double> acting_depths(const PressRecording& r, const SkinNumbers& numbers) {
  const double lag = number_or(numbers, kLag, 0), zero = number_or(numbers, kZero, 0);
  std::vector<double> out = r.depth;
  for (std::size_t row = 0; row < r.rows() && r.rows() > 1 && lag > 0; ++row) {
    const double then = std::max(r.time[row] - lag, r.time[0]);
    const auto after = std::upper_bound(r.time.begin() + 1, r.time.end() - 1, then);
    const auto k = std::size_t(after - r.time.begin());
    out[row] = r.depth[k - 1] +
               (r.depth[k] - r.depth[k - 1]) * (then - r.time[k - 1]) / (r.time[k] - r.time[k - 1]);
  }
  for (double& d : out) d += zero;
  return out;
}

std::vector<double> normal_forces(const SkinScene& scene, const PressRecording& r,
                                  const SkinNumbers& numbers) {
  return shifted_forces(scene, r, numbers, std::array{DepthShift{}})[0];
}

std::vector<std::vector<double>> shifted_forces(const SkinScene& scene, const PressRecording& r,
                                                const SkinNumbers& numbers,
                                                std::span<const DepthShift> shifts) {
  std::vector<double> depth, rate, x, y;  // of all shifts, one after the other
  const auto add = [](std::span<const double> from, std::vector<double>& to) {
    to.insert(to.end(), from.begin(), from.end());
  };
  for (const DepthShift& shift : shifts) {
    const Acting acting(r, numbers, shift);
    const PressPath path = acting.normal();
    add(path.depth, depth), add(path.rate, rate), add(path.x, x), add(path.y, y);
  }
  const std::vector<double> forces = press_forces(
      scene(numbers),
      {.depth = depth, .rate = rate, .time = {}, .x = x, .y = y, .fields = r.points > 0});
  std::vector<std::vector<double>> out;
  const std::size_t size = forces.size() / std::max<std::size_t>(shifts.size(), 1);
  for (std::size_t k = 0; k < shifts.size(); ++k) {
    const auto begin = forces.begin() + std::ptrdiff_t(k * size);
    out.emplace_back(begin, begin + std::ptrdiff_t(size));
    add_recorded(std::span(depth).subspan(k * r.rows(), r.rows()), numbers, out.back());
  }
  return out;
}

PathForces sheared_forces(const SkinScene& scene, const PressRecording& r,
                          const SkinNumbers& numbers, const DepthShift& shift) {
  const Acting acting(r, numbers, {.depth = shift.depth, .rows = shift.rows});
  const Scene skin = scene(numbers);
  const PressPath path = acting.whole();
  PathForces out = path_forces(skin, path);
  if (path.time.size() > 1) {
    const std::vector<double> smooth = press_forces(skin, path), rate = path_rates(path);
    PressPath since = path;
    since.rate = rate;
    const std::vector<double> driven = press_forces(skin, since);
    for (std::size_t k = 0; k < smooth.size(); ++k) out.normal[k] += smooth[k] - driven[k];
  }
  add_recorded(acting.depth(), numbers, out.normal);
  return out;
}

std::vector<double> friction_added(const SkinScene& scene, const PressRecording& r,
                                   const SkinNumbers& numbers) {
  const Acting acting(r, numbers);
  return friction_shares(scene(numbers), acting.whole());
}

}  // namespace tangere
