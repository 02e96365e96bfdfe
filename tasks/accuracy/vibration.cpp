// SPDX-License-Identifier: Apache-2.0
// Finds the power at single frequencies by Goertzel's recursion, which is quick enough for some
// thousand steps.
#include "tasks/accuracy/vibration.hpp"

#include <array>
#include <cmath>
#include <numbers>

#include "engine/base/as_size.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/stepper.hpp"
#include "kernels/numbers/block.hpp"

namespace tangere {
namespace {

constexpr std::ptrdiff_t kMostForces =
    8192;  // the last ones; all frequencies take steps² operations

/// Net force on each sensor after each step, (sensors, 3, steps) [N].
using Series = std::vector<std::array<std::vector<double>, 3>>;

Series net_forces(const FixedEpisodes& episodes, int environment, const StepperOptions& options,
                  int parts, const std::stop_token& stop) {
  const Model& model = episodes.start.model();
  Batch batch = episodes.start;
  for (int e = 0; e < batch.environments(); ++e) batch.hold(e, e != environment);
  Stepper stepper(model, options);
  Readout readout(model);
  Series series(model.sensors().size());
  std::vector<DenseFrame<double>> frames;
  for (std::size_t s = 0; s < series.size(); ++s)
    frames.emplace_back(model, static_cast<int>(s), FieldForm::ideal);
  for (int k = 0; k < episodes.samples_of[as_size(environment)]; ++k)
    for (int part = 0; part < parts; ++part) {
      stepper.step_block(batch, environment / kernels::kBlock,
                         episodes.controls_of(k, parts, part));
      if (failed(batch.status(environment)) || stop.stop_requested()) return series;
      for (std::size_t s = 0; s < series.size(); ++s) {
        readout.read(batch, environment, frames[s]);
        const std::span<const double> field = frames[s].values();
        for (std::size_t axis = 0; axis < 3; ++axis) {
          double sum = 0;
          for (std::size_t i = axis; i < field.size(); i += 3) sum += field[i];
          series[s][axis].push_back(sum);
        }
      }
    }
  return series;
}

/// |Σ x e^{-iωt}|² at `turns` swings over the series.
double power(const std::vector<double>& x, int turns) {
  // Goertzel: s_t = x_t + 2 cos ω s_{t-1} - s_{t-2}
  const double twice_cosine =
      2 * std::cos(2 * std::numbers::pi * turns / static_cast<double>(x.size()));
  double last = 0, before = 0;
  for (const double value : x) {
    const double now = value + twice_cosine * last - before;
    before = last;
    last = now;
  }
  return last * last + before * before - twice_cosine * last * before;
}

}  // namespace

Vibration strongest_vibration(const FixedEpisodes& episodes, int environment, Integrator integrator,
                              int parts, double tolerance, const std::stop_token& stop) {
  StepperOptions options;
  options.integrator = integrator;
  options.timestep = episodes.interval() / parts;
  options.tolerance = tolerance;
  options.sleep = 0;
  Series series = net_forces(episodes, environment, options, parts, stop);
  for (auto& forces : series)
    for (std::vector<double>& x : forces)
      if (std::ssize(x) > kMostForces) x.erase(x.begin(), x.end() - kMostForces);
  Vibration strongest;
  double most = 0;
  for (std::size_t s = 0; s < series.size(); ++s) {
    const int steps = static_cast<int>(series[s][0].size());
    const int slow = steps / (2 * parts);  // half a swing between samples
    double whole = 0, fast = 0, peak = 0;
    int at = 0;
    for (int turns = 0; turns < steps / 2; ++turns) {
      double here = 0;
      for (const std::vector<double>& x : series[s]) here += power(x, turns);
      whole += here;
      if (turns <= slow) continue;
      fast += here;
      if (here > peak) {
        peak = here;
        at = turns;
      }
    }
    if (fast <= most) continue;
    most = fast;
    strongest = {static_cast<int>(s), at / (steps * options.timestep.value()), fast / whole};
  }
  return strongest;
}

}  // namespace tangere
