// SPDX-License-Identifier: Apache-2.0
// Lays out all controls beforehand, so that every setting gets the same numbers.
#include "tasks/accuracy/fixed_episodes.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "engine/base/as_size.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/episode_program.hpp"
#include "tasks/run/rollout.hpp"

namespace tangere {
namespace {

using kernels::kBlock;

/// Steps of an episode and timesteps between samples, at most: a reference takes some hundred steps
/// for each.
constexpr std::int64_t kMostSteps = 10'000'000, kMostEvery = 1'000'000;

/// Throws InputError when an episode ends before its first sample, or has too many steps.
FixedEpisodes with_room(const Batch& start, std::int64_t steps, int every) {
  if (steps > kMostSteps || every > kMostEvery)
    throw InputError("an episode of " + std::to_string(steps) + " steps, sampled every " +
                     std::to_string(every) + "; expected at most " + std::to_string(kMostSteps) +
                     " and " + std::to_string(kMostEvery));
  if (steps < every)
    throw InputError("an episode of " + std::to_string(steps) +
                     " steps; expected at least one sample, which takes " + std::to_string(every));
  const int samples = static_cast<int>(steps / every);
  FixedEpisodes episodes{start, start.model().timestep(), every, samples,
                         std::vector<int>(as_size(start.environments()), samples)};
  episodes.controls.resize(as_size(samples) * as_size(every) * as_size(start.environments()) *
                           as_size(start.model().nu()));
  return episodes;
}

}  // namespace

std::span<const double> FixedEpisodes::controls_of(int sample, int parts, int part) const {
  const std::size_t width = as_size(start.environments()) * as_size(start.model().nu());
  const std::size_t step =
      as_size(sample) * as_size(every) + as_size(part) * as_size(every) / as_size(parts);
  return std::span(controls).subspan(step * width, width);
}

bool FixedEpisodes::can_cut(int parts) const {
  for (int sample = 0; sample < samples; ++sample)
    for (int part = 0; part < parts; ++part) {
      const std::span<const double> first = controls_of(sample, parts, part);
      const int last = ((part + 1) * every + parts - 1) / parts;  // first timestep after the part
      for (int k = part * every / parts + 1; k < last; ++k)
        if (!std::ranges::equal(first, controls_of(sample, every, k))) return false;
    }
  return true;
}

FixedEpisodes scene_episodes(const Batch& start, const ControlProgram& controls, std::int64_t steps,
                             int every) {
  controls.check_covers(steps);
  FixedEpisodes episodes = with_room(start, steps, every);
  const std::size_t width = as_size(start.environments()) * as_size(start.model().nu());
  for (int k = 0; k < episodes.samples * every; ++k)
    write_controls(controls, k, start,
                   std::span(episodes.controls).subspan(as_size(k) * width, width));
  return episodes;
}

std::optional<FixedEpisodes> task_episodes(const Batch& start, const Task& task,
                                           const Policy& policy, int every,
                                           const std::stop_token& stop) {
  const std::int64_t steps =
      task.spec().restarts ? task.spec().steps_per_action : TaskProgram::steps(task.spec());
  FixedEpisodes episodes = with_room(start, steps, every);
  Batch batch = start;
  const auto data = std::make_shared<EnvironmentData>(task, batch.environments());
  data->restart(batch);
  TaskProgram program(task, policy, data, Precision::f64);
  Stepper stepper(task.model());
  const std::size_t nu = as_size(task.model().nu()), width = as_size(batch.environments()) * nu;
  std::vector<double> u(width);
  std::fill(episodes.samples_of.begin(), episodes.samples_of.end(), 0);
  for (int b = 0; b < batch.blocks(); ++b) {
    program.start(batch, b);
    const int first = b * kBlock, lanes = lanes_of(batch, b);
    const auto controls_begin = static_cast<std::ptrdiff_t>(as_size(first) * nu);
    for (std::int64_t t = 0; t < std::int64_t{episodes.samples} * every; ++t) {
      if (stop.stop_requested()) return std::nullopt;
      program.controls(t, batch, b, u);
      // Where every action restarts, the first one sets the state.
      if (t == 0) episodes.start.restore_block(b, batch.save_block(b));
      std::copy_n(
          u.begin() + controls_begin, as_size(lanes) * nu,
          episodes.controls.begin() + t * static_cast<std::ptrdiff_t>(width) + controls_begin);
      stepper.step_block(batch, b, u);
      for (int e = first; e < first + lanes; ++e)
        if (!batch.held(e) && !failed(batch.status(e)))
          episodes.samples_of[as_size(e)] = static_cast<int>((t + 1) / every);
      program.after_step(t, batch, b);
      if ((t + 1) % task.spec().steps_per_action == 0) program.after_row(batch, b);
    }
  }
  return episodes;
}

int sample_interval(const Model& model) {
  const std::span<const SensorInfo> sensors = model.sensors();
  const int every = sensors.empty() ? 0 : sensors.front().every;
  const bool agree =
      std::ranges::all_of(sensors, [&](const SensorInfo& s) { return s.every == every; });
  if (agree && every > 0 && every * model.timestep() > 0.01 - 1e-9) return every;
  return static_cast<int>(
      std::clamp(std::round(0.025 / model.timestep()), 1.0, double(kMostEvery)));
}

}  // namespace tangere
