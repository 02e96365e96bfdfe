// SPDX-License-Identifier: Apache-2.0
// The two makers of episodes.
#include "tasks/run/episode_source.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tangere {
namespace {

std::size_t size(int n) { return static_cast<std::size_t>(n); }

/// Every action is held for K steps, so the controls may not change in between. The kinds of
/// control change at the same steps in every episode, so one is looked at.
void check_held(const ControlProgram& controls, const EpisodeOptions& options, int nu) {
  std::vector<double> action(size(nu)), u(size(nu));
  for (std::int64_t t = 0; options.every > 1 && t < options.steps; ++t) {
    std::vector<double>& now = t % options.every == 0 ? action : u;
    controls.evaluate(t, 0, now);
    for (double& x : now) x = std::clamp(x, -1.0, 1.0);
    if (t % options.every != 0 && u != action)
      throw InputError(fmt::format(
          "the controls change at step {}, but an action is held for {} steps; expected "
          "changes at multiples of {} steps, or another --every",
          t, options.every, options.every));
  }
}

}  // namespace

EpisodeSource shape_of(const Model& model, const EpisodeOptions& options) {
  EpisodeSource s;
  s.model = &model;
  s.rows = action_rows(options);
  s.action = size(model.nu());
  s.widths = {size(model.nq()), size(model.nv())};
  if (!model.end_effectors().empty()) s.widths.push_back(3 * model.end_effectors().size());
  s.first_sensor = s.widths.size();
  for (const SensorInfo& sensor : model.sensors()) s.widths.push_back(3 * size(sensor.points));
  return s;
}

EpisodeSource shape_of(const Task& task) {
  EpisodeSource s;
  s.model = &task.model();
  s.rows = task.spec().horizon;
  s.action = task.spec().action.size();
  s.widths = {size(task.model().nq()), size(task.model().nv())};
  for (const TensorSpec& tensor : task.spec().observations) s.widths.push_back(tensor.size());
  s.first_sensor = s.widths.size();
  s.whole = true;
  return s;
}

EpisodeSource source_of(const Model& model, const StepperOptions& solver,
                        const ControlProgram& controls, const EpisodeOptions& options) {
  EpisodeSource s = shape_of(model, options);
  s.solver = solver;
  const double timestep = Stepper(model, solver).timestep();
  if (controls.timestep() != timestep)
    throw InputError(fmt::format("controls laid out for a timestep of {} s; the stepper's is {} s",
                                 controls.timestep(), timestep));
  controls.check_covers(options.steps);
  check_held(controls, options, model.nu());
  s.program = [&controls, every = options.every](const Batch&) {
    return std::make_unique<SceneProgram>(controls, every);
  };
  return s;
}

EpisodeSource source_of(const Task& task, const Policy& policy, const EpisodeOptions& options) {
  EpisodeSource s = shape_of(task);
  s.program = [&task, &policy, precision = options.precision](const Batch& batch) {
    const auto data = std::make_shared<EnvironmentData>(task, batch.environments());
    data->restart(batch);
    return std::make_unique<TaskProgram>(task, policy, data, precision);
  };
  return s;
}

}  // namespace tangere
