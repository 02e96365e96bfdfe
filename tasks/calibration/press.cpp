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

constexpr FieldOutput kSum{0, FieldForm::sum};

/// Reads the force on the skin [N].
Vector3 force_on_skin(Readout& readout, const Batch& batch) {
  std::array<double, 6> sum{};
  std::span<double> reading = sum;
  readout.read_block(batch, 0, kSum, {&reading, 1});
  return {sum[0], sum[1], sum[2]};
}

/// Drives the indenter along a path, and calls f after each row.
void drive(const Model& model, std::span<const double> depth, std::span<const double> shear,
           const std::function<void(const Batch&)>& f) {
  Stepper stepper(model);
  Batch batch(model, 1);
  const std::array<double, 3> start{shear.front(), 0, 1e-3}, rest{};
  batch.set_state(0, start, rest);
  for (std::size_t k = 0; k < depth.size(); ++k) {
    stepper.step(batch, std::array<double, 3>{shear[k], 0, -depth[k]});
    if (failed(batch.status(0)))
      throw InputError(fmt::format(
          "row {}: the step to depth {} m and shear {} m failed: {}; expected a shorter "
          "way from row to row",
          k + 1, depth[k], shear[k], to_string(batch.status(0))));
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
  constexpr double kJump = 0.5, kMostTurns = 0.2;
  double largest = 0;
  std::vector<double> rate;  // from each row to the next
  for (std::size_t k = 1; k < time.size(); ++k) {
    rate.push_back((depth[k] - depth[k - 1]) / (time[k] - time[k - 1]));
    largest = std::max(largest, std::abs(rate.back()));
  }
  std::vector<int> out;
  for (std::size_t k = 1; k < rate.size(); ++k)
    if (std::abs(rate[k] - rate[k - 1]) > kJump * largest) out.push_back(int(k));
  if (double(out.size()) > kMostTurns * double(rows())) out.clear();
  return out;
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

std::vector<double> press_forces(const Scene& scene, std::span<const double> depth,
                                 std::span<const double> rate) {
  Scene smooth = scene;
  ContactCoefficients& c = smooth.sensors.at(0).coefficients;
  c.kt = c.mu = c.ks = 0;
  const Model model(smooth);
  Readout readout(model);
  Batch batch(model, 1);
  std::vector<double> out;
  for (std::size_t k = 0; k < depth.size(); ++k) {
    const std::array<double, 3> q{0, 0, -depth[k]}, v{0, 0, -rate[k]};
    batch.set_state(0, q, v);
    out.push_back(-force_on_skin(readout, batch)[2]);
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

std::vector<double> shear_forces(const Scene& scene, std::span<const double> depth,
                                 std::span<const double> shear) {
  const Model model(without_rates(scene));
  Readout readout(model);
  std::vector<double> out;
  drive(model, depth, shear,
        [&](const Batch& batch) { out.push_back(force_on_skin(readout, batch)[0]); });
  return out;
}

std::vector<double> friction_shares(const Scene& scene, std::span<const double> depth,
                                    std::span<const double> time) {
  const bool timed = time.size() > 1;
  Scene sticky = timed ? scene : without_rates(scene);
  if (timed) sticky.timestep = (time.back() - time.front()) / double(time.size() - 1);
  const Model model(sticky);
  Readout readout(model);
  std::vector<double> out, straight(depth.size()), rate(depth.size());
  drive(model, depth, straight,
        [&](const Batch& batch) { out.push_back(-force_on_skin(readout, batch)[2]); });
  for (std::size_t k = 1; k < depth.size() && timed; ++k)
    rate[k] = (depth[k] - depth[k - 1]) / sticky.timestep;
  const std::vector<double> smooth = press_forces(sticky, depth, rate);
  for (std::size_t k = 0; k < out.size(); ++k) out[k] -= smooth[k];
  if (timed) out[0] = 0;  // whose rate is that from above the skin
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
  if (!shear.empty()) return drive(model, acting, shear, read);
  Batch batch(model, 1);
  for (std::size_t k = 0; k < acting.size(); ++k) {
    batch.set_state(0,
                    std::array<double, 3>{x.empty() ? 0 : x[k], y.empty() ? 0 : y[k], -acting[k]},
                    std::array<double, 3>{});
    read(batch);
  }
}

}  // namespace tangere
