// SPDX-License-Identifier: Apache-2.0
// Copies names and settings out of model, stepper and batch.
#include "io/trajectory/layout_from_model.hpp"

#include <stdexcept>

#include "engine/scene/imperfection_checks.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/step/sleeping_trees.hpp"

namespace tangere {
namespace {

std::vector<std::string> copy(std::span<const std::string> texts) {
  return {texts.begin(), texts.end()};
}

/// `chosen`: bodies; none: all.
std::vector<std::string> chosen_names(const Model& model, const std::vector<int>& chosen) {
  if (chosen.empty()) return copy(model.body_names());
  std::vector<std::string> names;
  names.reserve(chosen.size());
  for (const int body : chosen) names.push_back(model.body_names()[static_cast<std::size_t>(body)]);
  return names;
}

std::vector<std::string> end_effector_names(const Model& model) {
  std::vector<std::string> names;
  for (const EndEffectorInfo& end_effector : model.end_effectors())
    names.push_back(end_effector.name);
  return names;
}

}  // namespace

SensorLayout sensor_layout(const SensorInfo& info, const TactileDescription& description,
                           int every) {
  SensorLayout layout;
  layout.name = info.name;
  layout.body = info.body;
  layout.rows = info.rows;
  layout.cols = info.cols;
  layout.points = info.points;
  layout.every = every;
  layout.pressure_sign = info.pressure_sign;
  layout.law = description.law;
  layout.corner0 = description.array.corner0;
  layout.corner1 = description.array.corner1;
  layout.axis0 = description.array.axis0;
  layout.axis1 = description.array.axis1;
  layout.imperfections = text_of(description.imperfections);
  layout.list = description.points;
  return layout;
}

RunFacts run_facts(const Model& model, const Stepper& stepper, const RunOrigin& origin,
                   std::uint64_t seed) {
  const Scene& scene = model.scene();
  RunFacts facts;
  static_cast<RunOrigin&>(facts) = origin;
  facts.q_names = copy(model.q_names());
  facts.q_units = copy(model.q_units());
  facts.v_names = copy(model.v_names());
  facts.v_units = copy(model.v_units());
  facts.u_names = copy(model.u_names());
  facts.u_units = copy(model.u_units());
  facts.end_effector_names = end_effector_names(model);
  for (const RandomizationDescription& d : scene.randomizations) {
    facts.randomized_names.push_back(name_of(d.number));
    facts.randomized_units.push_back(unit_of(scene, d.number));
  }
  facts.scene_name = scene.name;
  facts.scene_text = scene.text;
  facts.integrator = to_string(stepper.integrator());
  facts.timestep = stepper.timestep();
  facts.tolerance = stepper.tolerance();
  facts.accuracy = stepper.accuracy();
  facts.sleep = stepper.sleep();
  facts.seed = seed;
  return facts;
}

TrajectoryLayout layout_from(const Batch& batch, const Stepper& stepper,
                             const RunDescription& run) {
  const Model& model = batch.model();
  const Scene& scene = model.scene();
  if (run.tactile_intervals.size() != model.sensors().size())
    throw std::logic_error("one tactile interval per sensor is needed");
  TrajectoryLayout layout;
  static_cast<RunFacts&>(layout) = run_facts(model, stepper, run, batch.seed());
  layout.steps = run.steps;
  layout.first_step = run.first_step;
  layout.environments = batch.environments();
  if (run.bodies) layout.body_names = chosen_names(model, run.chosen_bodies);
  layout.states = run.states;
  layout.of_bodies = run.of_bodies;
  layout.of_end_effectors = run.of_end_effectors;
  if (!run.end_effectors) layout.end_effector_names.clear();
  layout.audit = run.audit;
  if (run.memory) layout.memory = shear_state_arrays(model);
  layout.of_memory = run.of_memory;
  if (layout.sleep > 0) layout.trees = sleeping_trees(model);
  for (std::size_t i = 0; i < model.sensors().size(); ++i)
    layout.sensors.push_back(
        sensor_layout(model.sensors()[i], scene.sensors[i], run.tactile_intervals[i]));
  layout.fields = run.fields ? *run.fields : whole_fields(model.scene());
  for (const StepStatus status : step_statuses())
    layout.statuses.push_back({static_cast<std::int8_t>(status), to_string(status)});
  const int varied = static_cast<int>(layout.randomized_names.size());
  for (int e = 0; e < batch.environments(); ++e)
    for (int k = 0; k < varied; ++k)
      layout.randomized_values.push_back(batch.randomized_value(e, k));
  layout.scene_path = scene.path;
  layout.every = run.every;
  layout.first_episode = batch.episode(0);
  layout.command_line = run.command_line;
  layout.policy = run.policy;
  return layout;
}

}  // namespace tangere
