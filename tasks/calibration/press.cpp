// SPDX-License-Identifier: Apache-2.0
// A press is a row of states. Shear has memory, so the indenter is driven along the path by a motor
// that is stiff against its mass.
#include "tasks/calibration/press.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>

#include "engine/base/error.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"

namespace tangere {
namespace {

double at(std::span<const double> column, std::size_t row) {
  return column.empty() ? 0 : column[row];
}

/// Reads the forces on the skin: their sum in its body's frame, or those of each point.
class SkinForces {
 public:
  SkinForces(const Model& model, bool fields)
      : readout_(model),
        fields_(fields),
        forces_(fields ? 3 * std::size_t(model.sensors()[0].points) : 6) {}

  /// Adds those along the normal, positive in compression.
  void add_normal(const Batch& batch, std::vector<double>& out) {
    read(batch);
    if (!fields_) return out.push_back(-forces_[2]);
    for (std::size_t k = 0; k < forces_.size(); k += 3) out.push_back(forces_[k + 2]);
  }
  /// Adds those along x, or of each point along axis0 and axis1.
  void add_tangential(const Batch& batch, std::vector<double>& out) {
    read(batch);
    if (!fields_) return out.push_back(forces_[0]);
    for (std::size_t k = 0; k < forces_.size(); k += 3)
      out.push_back(forces_[k]), out.push_back(forces_[k + 1]);
  }

 private:
  void read(const Batch& batch) {
    std::span<double> reading = forces_;
    readout_.read_block(batch, 0, {0, fields_ ? FieldForm::ideal : FieldForm::sum}, {&reading, 1});
  }

  Readout readout_;
  bool fields_;
  std::vector<double> forces_;
};

constexpr double kSlowStep = 1e3;   // to the first row of a path with times [s]
constexpr double kSameStep = 1e-6;  // relative

/// Drives the indenter along a path, and calls f after each row.
void drive(const Model& model, const PressPath& path, const std::function<void(const Batch&)>& f) {
  const bool timed = path.time.size() > 1;
  std::optional<Stepper> stepper;
  Batch batch(model, 1);
  batch.set_state(0, std::array<double, 3>{at(path.x, 0), at(path.y, 0), 1e-3},
                  std::array<double, 3>{});
  for (std::size_t k = 0; k < path.depth.size(); ++k) {
    const double x = at(path.x, k), y = at(path.y, k), depth = path.depth[k],
                 step = !timed  ? model.timestep()
                        : k > 0 ? path.time[k] - path.time[k - 1]
                                : kSlowStep;
    if (!stepper || std::abs(stepper->timestep() - step) > kSameStep * step)
      stepper.emplace(model, StepperOptions{.timestep = step});
    stepper->step(batch, std::array<double, 3>{x, y, -depth});
    if (failed(batch.status(0)))
      throw InputError(fmt::format(
          "row {}: the step to depth {} m and shear {} m failed: {}; expected a shorter "
          "way from row to row",
          k + 1, depth, x, to_string(batch.status(0))));
    f(batch);
  }
}

}  // namespace

std::vector<double> PressRecording::rates() const {
  std::vector<double> out(rows(), 0.0);
  for (std::size_t k = 0; k < rows() && time.size() > 1; ++k) {
    const std::size_t a = k > 0 ? k - 1 : 0, b = std::min(k + 1, rows() - 1);
    out[k] = (depth[b] - depth[a]) / (time[b] - time[a]);
  }
  return out;
}

namespace {

constexpr std::size_t kFewestDifferencesOfRows = 12;  // of which a scatter is estimated

/// Standard deviation of the errors of evenly spaced numbers, by their third differences, which a
/// smooth motion has hardly: of normal errors σ the median size of these is 0.6745 √20 σ.
double scatter_of(std::vector<double> third) {
  constexpr double kOfNormal = 0.674490;
  const auto middle = third.begin() + std::ssize(third) / 2;
  std::ranges::nth_element(third, middle);
  return *middle / (kOfNormal * std::sqrt(20.0));
}

double third_difference(std::span<const double> x, std::size_t last) {
  return std::abs(x[last] - 3 * x[last - 1] + 3 * x[last - 2] - x[last - 3]);
}

/// Returns by how much differences of neighbouring rates scatter, as multiples of steps of time.
double jump_scatter(std::span<const double> column) {
  constexpr double kDeviations = 4;
  std::vector<double> third;
  for (std::size_t k = 3; k < column.size(); ++k) third.push_back(third_difference(column, k));
  if (third.size() < kFewestDifferencesOfRows) return 0;
  return kDeviations * std::sqrt(6.0) * scatter_of(std::move(third));
}

/// Returns the rows at which the rate of a column jumps (PressRecording::turns()).
std::vector<int> jumps_of(std::span<const double> column, std::span<const double> time) {
  constexpr double kJumps[] = {0.2, 0.5}, kMostTurns = 0.2;
  double largest = 0;
  std::vector<double> rate;  // from each row to the next
  for (std::size_t k = 1; k < time.size(); ++k) {
    rate.push_back((column[k] - column[k - 1]) / (time[k] - time[k - 1]));
    largest = std::max(largest, std::abs(rate.back()));
  }
  const double span = time.empty() ? 0 : time.back() - time.front(),
               noise = span > 0 ? jump_scatter(column) * double(rate.size()) / span : 0;
  for (const double jump : kJumps) {
    std::vector<int> out;
    for (std::size_t k = 1; k < rate.size(); ++k)
      if (std::abs(rate[k] - rate[k - 1]) > std::max(jump * largest, noise)) out.push_back(int(k));
    if (double(out.size()) <= kMostTurns * double(column.size())) return out;
  }
  return {};
}

}  // namespace

std::vector<int> PressRecording::turns() const {
  std::vector<int> out = jumps_of(depth, time), both;
  if (shear.empty()) return out;
  std::ranges::set_union(out, jumps_of(shear, time), std::back_inserter(both));
  return both;
}

double PressRecording::depth_scatter() const {
  constexpr double kEven = 0.05;  // steps of time, by their mean
  const double step = time.size() > 1 ? (time.back() - time.front()) / double(rows() - 1) : 0;
  for (std::size_t k = 1; k < time.size(); ++k)
    if (std::abs(time[k] - time[k - 1] - step) > kEven * step) return 0;
  const std::vector<int> turning = turns();
  std::vector<double> third;  // between turns
  for (int k = 3; k < int(rows()); ++k) {
    const auto turn = std::ranges::upper_bound(turning, k - 3);
    if (turn != turning.end() && *turn < k) continue;
    third.push_back(third_difference(depth, std::size_t(k)));
  }
  return third.size() < kFewestDifferencesOfRows ? 0 : scatter_of(std::move(third));
}

Scene placed_indenter(const Scene& scene) {
  Vector3 low{HUGE_VAL, HUGE_VAL, HUGE_VAL}, high{-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
  for (const TactilePoint& p : tactile_points(scene.sensors.at(0)))
    for (std::size_t i = 0; i < 3; ++i) {
      low[i] = std::min(low[i], p.position[i]);
      high[i] = std::max(high[i], p.position[i]);
    }
  Scene out = scene;
  TactileDescription& sensor = out.sensors[0];
  const Vector3 &a = sensor.array.axis0, &b = sensor.array.axis1;
  if (!sensor.pressure_sign) sensor.pressure_sign = a[0] * b[1] - a[1] * b[0] < 0 ? -1 : 1;
  out.links.at(1).joint.pose.position = {(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, high[2]};
  return out;
}

std::vector<double> press_forces(const Scene& scene, const PressPath& path) {
  Scene smooth = scene;
  ContactCoefficients& c = smooth.sensors.at(0).coefficients;
  c.kt = c.mu = c.ks = 0;
  const Model model(smooth);
  SkinForces forces(model, path.fields);
  Batch batch(model, 1);
  std::vector<double> out;
  for (std::size_t k = 0; k < path.depth.size(); ++k) {
    const std::array<double, 3> q{at(path.x, k), at(path.y, k), -path.depth[k]},
        v{0, 0, -at(path.rate, k)};
    batch.set_state(0, q, v);
    forces.add_normal(batch, out);
  }
  return out;
}

Scene without_rates(const Scene& scene) {
  Scene slow = scene;
  TactileDescription& sensor = slow.sensors.at(0);
  sensor.coefficients.kt = sensor.coefficients.damping = 0;
  if (sensor.material) sensor.material->relaxation = 0;
  if (sensor.table) sensor.table->relaxation = 0;
  return slow;
}

PathForces path_forces(const Scene& scene, const PressPath& path) {
  const Model model(path.time.size() > 1 ? scene : without_rates(scene));
  SkinForces forces(model, path.fields);
  PathForces out;
  drive(model, path, [&](const Batch& batch) {
    forces.add_normal(batch, out.normal);
    forces.add_tangential(batch, out.tangential);
  });
  return out;
}

std::vector<double> shear_forces(const Scene& scene, const PressPath& path) {
  return path_forces(scene, path).tangential;
}

std::vector<double> path_rates(const PressPath& path) {
  std::vector<double> rate(path.depth.size());
  for (std::size_t k = 1; k < rate.size() && path.time.size() > 1; ++k)
    rate[k] = (path.depth[k] - path.depth[k - 1]) / (path.time[k] - path.time[k - 1]);
  return rate;
}

std::vector<double> friction_shares(const Scene& scene, const PressPath& path) {
  const bool timed = path.time.size() > 1;
  std::vector<double> out = path_forces(scene, path).normal;
  const std::vector<double> rate = path_rates(path);
  PressPath same = path;
  same.rate = rate;
  const std::vector<double> smooth = press_forces(timed ? scene : without_rates(scene), same);
  for (std::size_t k = 0; k < out.size(); ++k) out[k] -= smooth[k];
  return out;
}

void for_fields(const Model& model, double zero, std::span<const double> depth,
                std::span<const double> x, std::span<const double> y, std::span<const double> shear,
                const std::function<void(std::span<const double>)>& f) {
  Readout readout(model);
  std::vector<double> field(3 * std::size_t(model.sensors()[0].points)), acting;
  std::span<double> reading = field;
  const auto read = [&](const Batch& batch) {
    readout.read_block(batch, 0, {0, FieldForm::ideal}, {&reading, 1});
    f(field);
  };
  for (const double d : depth) acting.push_back(d + zero);
  if (!shear.empty())
    return drive(model, {.depth = acting, .rate = {}, .time = {}, .x = shear, .y = {}}, read);
  Batch batch(model, 1);
  for (std::size_t k = 0; k < acting.size(); ++k) {
    batch.set_state(0,
                    std::array<double, 3>{x.empty() ? 0 : x[k], y.empty() ? 0 : y[k], -acting[k]},
                    std::array<double, 3>{});
    read(batch);
  }
}

}  // namespace tangere
