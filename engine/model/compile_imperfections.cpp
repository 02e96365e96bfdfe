// SPDX-License-Identifier: Apache-2.0
// Weights of a low-pass and of a late answer end where less than a thousandth is left; then they
// are scaled so that they sum to 1.
#include "engine/model/compile_imperfections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/model/lateral_spread.hpp"
#include "engine/scene/imperfection_checks.hpp"

namespace tangere {
namespace {

constexpr double kWeightLeftOut = 1e-3;  // of a low-pass
constexpr int kMostPastStates = 4096;
constexpr int kMostRandomPoints = (1 << 24) - 64;  // limit of the random keys

std::string where_of(const TactileDescription& d) {
  return fmt::format("{}imperfections of '{}': ", d.imperfections.source.prefix(), d.name);
}
[[noreturn]] void fail(const TactileDescription& d, const std::string& message) {
  throw InputError(where_of(d) + message);
}

[[noreturn]] void fail_of_states(const TactileDescription& d, double states, double h) {
  fail(d, fmt::format("delay, low_pass and hysteresis reach {} steps of {} s back; expected less "
                      "than {}",
                      states, h, kMostPastStates));
}

/// The hash FNV-1a (Fowler, Noll, Vo) of a name. Part of every stored seed's meaning.
std::uint64_t bits_of(const std::string& name) {
  std::uint64_t bits = 0xcbf29ce484222325;
  for (const char c : name) bits = (bits ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return bits;
}

/// Returns the weights of a first-order lag of time constant `time`, newest first: β^k, scaled to a
/// sum of 1. Without a time constant: the newest alone.
std::vector<double> lag(const TactileDescription& d, double time, double h) {
  const double ratio = time > 0 ? std::exp(-h / time) : 0;
  const double states = ratio > 0 ? std::ceil(std::log(kWeightLeftOut) / std::log(ratio)) : 1;
  if (!(states < kMostPastStates)) fail_of_states(d, states, h);
  std::vector<double> weights;
  double sum = 0;
  for (double k = 0; k < states; ++k) {
    weights.push_back(std::pow(ratio, k));
    sum += weights.back();
  }
  for (double& w : weights) w /= sum;
  return weights;
}

/// Returns the weights of one lag after the other.
std::vector<double> one_after_other(const std::vector<double>& first,
                                    const std::vector<double>& second) {
  if (second.size() == 1 && second[0] == 1) return first;
  std::vector<double> both(first.size() + second.size() - 1);
  for (std::size_t i = 0; i < first.size(); ++i)
    for (std::size_t j = 0; j < second.size(); ++j) both[i + j] += first[i] * second[j];
  return both;
}

/// Turns delay, low-pass and hysteresis into weights of earlier steps. A delay that ends between
/// two steps takes a share of both.
void set_lag_weights(const TactileDescription& d, double h, CompiledSensor& s) {
  constexpr double kWhole = 1e-6;  // [steps] a part that is rounding
  const SensorImperfections& of = d.imperfections;
  const double steps = of.delay / h, delay = std::floor(steps + kWhole),
               part = std::max(0.0, steps - delay);
  // A generalised Maxwell element: a share of the answer is late.
  std::vector<double> late = lag(d, of.hysteresis > 0 ? of.hysteresis_time : 0, h);
  if (of.hysteresis > 0) {
    for (double& w : late) w *= of.hysteresis;
    late[0] += 1 - of.hysteresis;
  }
  s.weights = one_after_other(lag(d, of.low_pass, h), late);
  if (!(delay + double(s.weights.size()) < kMostPastStates))
    fail_of_states(d, delay + double(s.weights.size()), h);
  s.delay = static_cast<int>(delay);
  if (part <= kWhole) return;
  s.weights.push_back(0);
  for (std::size_t k = s.weights.size(); k-- > 0;)
    s.weights[k] = (1 - part) * s.weights[k] + (k > 0 ? part * s.weights[k - 1] : 0);
}

}  // namespace

void compile_imperfections(const TactileDescription& d, double timestep, CompiledSensor& s,
                           SensorInfo& info) {
  s.name_bits = bits_of(d.name);
  check_imperfections(d.imperfections, d.name, has_grid(d));
  if (!is_imperfect(d.imperfections)) return;
  if (s.points() > kMostRandomPoints)
    fail(d, fmt::format("{} points; expected {} at most", s.points(), kMostRandomPoints));
  info.imperfect = s.imperfect = true;
  s.imperfections = d.imperfections;
  if (has_lag(d.imperfections)) set_lag_weights(d, timestep, s);
  info.past_states = s.past_states();
  if (!has_grid(d)) return;
  s.grid_rows = d.array.rows, s.grid_cols = d.array.cols;
  if (d.imperfections.spread == 0) return;
  s.spread = lateral_spread(d.array, d.imperfections.spread, where_of(d));
}

}  // namespace tangere
