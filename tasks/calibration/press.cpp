// SPDX-License-Identifier: Apache-2.0
// A press is a row of states. Shear has memory, so the indenter is driven along the path by a motor
// that is stiff against its mass.
#include "tasks/calibration/press.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

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

/// Drives the indenter along a path, and calls f after each row.
void drive(const Model& model, const PressPath& path, const std::function<void(const Batch&)>& f) {
  Stepper stepper(model);
  Batch batch(model, 1);
  batch.set_state(0, std::array<double, 3>{at(path.x, 0), at(path.y, 0), 1e-3},
                  std::array<double, 3>{});
  for (std::size_t k = 0; k < path.depth.size(); ++k) {
    const double x = at(path.x, k), y = at(path.y, k), depth = path.depth[k];
    stepper.step(batch, std::array<double, 3>{x, y, -depth});
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

std::vector<int> PressRecording::turns() const {
  constexpr double kJumps[] = {0.2, 0.5}, kMostTurns = 0.2;
  double largest = 0;
  std::vector<double> rate;  // from each row to the next
  for (std::size_t k = 1; k < time.size(); ++k) {
    rate.push_back((depth[k] - depth[k - 1]) / (time[k] - time[k - 1]));
    largest = std::max(largest, std::abs(rate.back()));
  }
  for (const double jump : kJumps) {
    std::vector<int> out;
    for (std::size_t k = 1; k < rate.size(); ++k)
      if (std::abs(rate[k] - rate[k - 1]) > jump * largest) out.push_back(int(k));
    if (double(out.size()) <= kMostTurns * double(rows())) return out;
  }
  return {};
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
  return slow;
}

std::vector<double> shear_forces(const Scene& scene, const PressPath& path) {
  const Model model(without_rates(scene));
  SkinForces forces(model, path.fields);
  std::vector<double> out;
  drive(model, path, [&](const Batch& batch) { forces.add_tangential(batch, out); });
  return out;
}

std::vector<double> friction_shares(const Scene& scene, const PressPath& path) {
  const std::size_t rows = path.depth.size();
  const bool timed = path.time.size() > 1;
  Scene sticky = timed ? scene : without_rates(scene);
  if (timed) sticky.timestep = (path.time.back() - path.time.front()) / double(rows - 1);
  const Model model(sticky);
  SkinForces forces(model, path.fields);
  std::vector<double> out, rate(rows);
  drive(model, path, [&](const Batch& batch) { forces.add_normal(batch, out); });
  for (std::size_t k = 1; k < rows && timed; ++k)
    rate[k] = (path.depth[k] - path.depth[k - 1]) / sticky.timestep;
  PressPath same = path;
  same.rate = rate;
  const std::vector<double> smooth = press_forces(sticky, same);
  for (std::size_t k = 0; k < out.size(); ++k) out[k] -= smooth[k];
  // The rate of the first row is that from above the skin.
  if (timed) std::fill_n(out.begin(), out.size() / rows, 0.0);
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
