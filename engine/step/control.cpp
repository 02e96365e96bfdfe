// SPDX-License-Identifier: Apache-2.0
// Controls as a function of (step, episode).
#include "engine/step/control.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/model/random.hpp"
#include "engine/step/batch.hpp"

namespace tangere {
namespace {

// In steps; a time written in decimals then selects the step that it means.
constexpr double kStepTolerance = 1e-6;

void check_values(std::span<const double> values, int nu, const std::string& what) {
  if (values.size() != static_cast<std::size_t>(nu))
    throw InputError(
        fmt::format("{}: {} values; expected {}, one per control", what, values.size(), nu));
  for (double x : values)
    if (!std::isfinite(x))
      throw InputError(fmt::format("{}: {}; expected finite numbers", what, x));
}

/// Returns the first step that starts at or after a time; 2^62 for anything later.
std::int64_t step_at(double time, double timestep) {
  return static_cast<std::int64_t>(std::min(std::ceil(time / timestep - kStepTolerance), 0x1p62));
}

void check(const ConstantControl& control, int nu) {
  check_values(control.values, nu, "constant control");
}

void check(const PiecewiseControl& control, int nu) {
  const auto& times = control.times;
  if (times.empty() || times.size() != control.values.size())
    throw InputError(
        fmt::format("piecewise control: {} times and {} values; expected as many, "
                    "at least one",
                    times.size(), control.values.size()));
  if (times[0] != 0)
    throw InputError(fmt::format("piecewise control: begins at {} s; expected 0", times[0]));
  for (std::size_t k = 0; k < times.size(); ++k) {
    if (k > 0 && !(times[k] > times[k - 1] && std::isfinite(times[k])))
      throw InputError(fmt::format("piecewise control: {} s after {} s; expected ascending times",
                                   times[k], times[k - 1]));
    check_values(control.values[k], nu, fmt::format("piecewise control at {} s", times[k]));
  }
  if (control.end != 0 && !(control.end > times.back() && std::isfinite(control.end)))
    throw InputError(fmt::format("piecewise control: ends at {} s; expected after {} s",
                                 control.end, times.back()));
}

void check(const CsvControl& control, int nu) {
  if (control.rows.empty()) throw InputError(control.path + ": no rows of controls");
  for (std::size_t k = 0; k < control.rows.size(); ++k)
    check_values(control.rows[k], nu, fmt::format("{}: row {}", control.path, k + 1));
}

void check(const RandomControl& control, int) {
  if (!(control.amplitude >= 0 && std::isfinite(control.amplitude)))
    throw InputError(
        fmt::format("random control: amplitude {}; expected a number >= 0", control.amplitude));
  if (!(control.period > 0 && std::isfinite(control.period)))
    throw InputError(
        fmt::format("random control: period {} s; expected a positive number", control.period));
}

ControlDescription description_of(const Model& model) {
  if (model.scene().control) return *model.scene().control;
  return ConstantControl{std::vector<double>(static_cast<std::size_t>(model.nu()), 0.0)};
}

}  // namespace

ControlProgram::ControlProgram(const Model& model, double timestep, std::uint64_t seed)
    : ControlProgram(model, timestep, seed, description_of(model)) {}

ControlProgram::ControlProgram(const Model& model, double timestep, std::uint64_t seed,
                               ControlDescription description)
    : description_(std::move(description)), nu_(model.nu()), timestep_(timestep), seed_(seed) {
  if (!(timestep > 0 && std::isfinite(timestep)))
    throw InputError(fmt::format("timestep {} s; expected a positive number", timestep));
  std::visit([this](const auto& control) { check(control, nu_); }, description_);
  if (const auto* p = std::get_if<PiecewiseControl>(&description_))
    for (double time : p->times) switches_.push_back(step_at(time, timestep_));
}

std::int64_t ControlProgram::steps() const {
  if (const auto* t = std::get_if<CsvControl>(&description_))
    return static_cast<std::int64_t>(t->rows.size());
  if (const auto* p = std::get_if<PiecewiseControl>(&description_); p != nullptr && p->end > 0)
    return std::max<std::int64_t>(step_at(p->end, timestep_), 1);  // one step may exceed the run
  return -1;
}

void ControlProgram::check_covers(std::int64_t steps) const {
  const auto* table = std::get_if<CsvControl>(&description_);
  if (table == nullptr || steps <= static_cast<std::int64_t>(table->rows.size())) return;
  throw InputError(fmt::format("{}: {} rows of controls for {} steps; expected a row per step",
                               table->path, table->rows.size(), steps));
}

void ControlProgram::evaluate(std::int64_t step, const Batch& batch, std::span<double> u) const {
  const std::size_t nu = as_size(nu_);
  check_size("controls", u.size(), as_size(batch.environments()) * nu);
  for (int e = 0; e < batch.environments(); ++e)
    evaluate(step, batch.episode(e), u.subspan(as_size(e) * nu, nu));
}

void ControlProgram::evaluate(std::int64_t step, std::int64_t episode, std::span<double> u) const {
  check_size("controls", u.size(), as_size(nu_));
  if (const auto* constant = std::get_if<ConstantControl>(&description_)) {
    std::copy(constant->values.begin(), constant->values.end(), u.begin());
  } else if (const auto* piecewise = std::get_if<PiecewiseControl>(&description_)) {
    const auto next = std::upper_bound(switches_.begin() + 1, switches_.end(), step);
    const auto& values = piecewise->values[static_cast<std::size_t>(next - switches_.begin()) - 1];
    std::copy(values.begin(), values.end(), u.begin());
  } else if (const auto* table = std::get_if<CsvControl>(&description_)) {
    check_covers(step + 1);
    const auto& values = table->rows[static_cast<std::size_t>(step)];
    std::copy(values.begin(), values.end(), u.begin());
  } else {
    // Uniform knots are joined by half cosines: smooth, and never beyond the amplitude.
    const auto& random = std::get<RandomControl>(description_);
    const double position = static_cast<double>(step) * timestep_ / random.period;
    const double before = std::min(std::floor(position), 0x1p62);  // beyond any key: refused below
    const double blend = 0.5 - 0.5 * std::cos(std::numbers::pi * (position - before));
    for (int k = 0; k < nu_; ++k) {
      RandomKey key{seed_, episode, static_cast<std::int64_t>(before), Purpose::control,
                    static_cast<std::uint32_t>(k)};
      const double left = uniform(key, -random.amplitude, random.amplitude);
      ++key.step;
      const double right = uniform(key, -random.amplitude, random.amplitude);
      u[static_cast<std::size_t>(k)] = std::lerp(left, right, blend);
    }
  }
}

}  // namespace tangere
