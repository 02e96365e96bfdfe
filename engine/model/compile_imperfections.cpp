// SPDX-License-Identifier: Apache-2.0
// Weights of a low-pass end where less than a thousandth is left, those of the lateral spread at
// four times its width; then both are scaled so that they sum to 1.
#include "engine/model/compile_imperfections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/model/frames.hpp"

namespace tangere {
namespace {

constexpr double kWeightLeftOut = 1e-3;  // of a low-pass
constexpr double kReach = 4;             // of a spread, in widths
constexpr int kMostPastStates = 4096;
constexpr int kMostReach = 1024;                   // [points]
constexpr int kMostRandomPoints = (1 << 24) - 64;  // whose random numbers have keys

[[noreturn]] void fail(const TactileDescription& d, const std::string& message) {
  throw InputError(
      fmt::format("{}imperfections of '{}': {}", d.imperfections.source.prefix(), d.name, message));
}

/// The hash FNV-1a (Fowler, Noll, Vo) of a name. Part of every stored seed's meaning.
std::uint64_t bits_of(const std::string& name) {
  std::uint64_t bits = 0xcbf29ce484222325;
  for (const char c : name) bits = (bits ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return bits;
}

/// Turns delay and low-pass into weights of earlier steps. A delay that ends between two steps
/// takes a share of both.
void remember(const TactileDescription& d, double h, CompiledSensor& s) {
  constexpr double kWhole = 1e-6;  // [steps] a part that is rounding
  const double steps = d.imperfections.delay / h, delay = std::floor(steps + kWhole),
               part = std::max(0.0, steps - delay),
               ratio = d.imperfections.low_pass > 0 ? std::exp(-h / d.imperfections.low_pass) : 0;
  const double states = ratio > 0 ? std::ceil(std::log(kWeightLeftOut) / std::log(ratio)) : 1;
  if (!(delay + states < kMostPastStates))
    fail(d, fmt::format("delay and low_pass look {} steps of {} s back; expected less than {}",
                        delay + states, h, kMostPastStates));
  s.delay = static_cast<int>(delay);
  double sum = 0;
  for (double k = 0; k < states; ++k) {
    s.weights.push_back(std::pow(ratio, k));
    sum += s.weights.back();
  }
  for (double& w : s.weights) w /= sum;
  if (part <= kWhole) return;
  s.weights.push_back(0);
  for (std::size_t k = s.weights.size(); k-- > 0;)
    s.weights[k] = (1 - part) * s.weights[k] + (k > 0 ? part * s.weights[k - 1] : 0);
}

/// Spreads forces along one axis of a grid. `pitch`: between its points [m].
LateralSpread spread_over(const TactileDescription& d, int points, double pitch) {
  LateralSpread spread;
  if (points < 2) return spread;
  const double width = d.imperfections.spread / pitch;
  const double reach = std::min(std::floor(kReach * width), double(points - 1));
  if (!(reach <= kMostReach))
    fail(d, fmt::format("spread of {} m reaches {} points; expected {} at most",
                        d.imperfections.spread, reach, kMostReach));
  for (double k = 0; k <= reach; ++k)
    spread.kernel.push_back(std::exp(-0.5 * (k / width) * (k / width)));
  const int last = static_cast<int>(spread.kernel.size()) - 1;
  for (int j = 0; j < points; ++j) {
    double sum = 0;
    for (int i = std::max(0, j - last); i <= std::min(points - 1, j + last); ++i)
      sum += spread.kernel[static_cast<std::size_t>(std::abs(i - j))];
    spread.scale.push_back(1 / sum);
  }
  return spread;
}

/// Whether the points of a sensor are those of its array, also where they have been moved since.
bool has_grid(const TactileDescription& d) {
  return d.points.empty() || d.points.size() == static_cast<std::size_t>(d.array.rows) *
                                                    static_cast<std::size_t>(d.array.cols);
}

}  // namespace

void compile_imperfections(const TactileDescription& d, double timestep, CompiledSensor& s,
                           SensorInfo& info) {
  check_imperfections(d.imperfections, d.name, has_grid(d));
  if (!is_imperfect(d.imperfections)) return;
  if (s.points() > kMostRandomPoints)
    fail(d, fmt::format("{} points; expected {} at most", s.points(), kMostRandomPoints));
  info.imperfect = s.imperfect = true;
  s.imperfections = d.imperfections;
  s.name_bits = bits_of(d.name);
  if (has_memory(d.imperfections)) remember(d, timestep, s);
  info.past_states = s.past_states();
  if (!has_grid(d)) return;
  s.grid_rows = d.array.rows, s.grid_cols = d.array.cols;
  if (d.imperfections.spread == 0) return;
  const kernels::Vec3<double> diagonal = vec3_of(d.array.corner1) - vec3_of(d.array.corner0);
  const auto pitch = [&](const Vector3& axis, int points) {
    return std::abs(dot(diagonal, vec3_of(axis))) / std::max(points - 1, 1);
  };
  s.spread = {spread_over(d, s.grid_rows, pitch(d.array.axis0, s.grid_rows)),
              spread_over(d, s.grid_cols, pitch(d.array.axis1, s.grid_cols))};
}

}  // namespace tangere
