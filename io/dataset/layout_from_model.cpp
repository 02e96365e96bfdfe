// SPDX-License-Identifier: Apache-2.0
// Turns what the engine knows of a run into what the files say about it.
#include <fmt/format.h>

#include <stdexcept>

#include "io/dataset/dataset_layout.hpp"
#include "io/scene/scene_tables.hpp"
#include "io/trajectory/trajectory_layout.hpp"

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

/// Fills in the names and units of what varies.
template <class Layout>
void describe_randomized(const Scene& scene, Layout& layout) {
  for (const RandomizationDescription& d : scene.randomizations) {
    layout.randomized_names.push_back(name_of(d.number));
    layout.randomized_units.push_back(unit_of(scene, d.number));
  }
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

TrajectoryLayout layout_from(const Batch& batch, const Stepper& stepper,
                             const RunDescription& run) {
  const Model& model = batch.model();
  const Scene& scene = model.scene();
  if (run.tactile_intervals.size() != model.sensors().size())
    throw std::logic_error("one tactile interval per sensor is needed");
  TrajectoryLayout layout;
  layout.steps = run.steps;
  layout.first_step = run.first_step;
  layout.environments = batch.environments();
  layout.q_names = copy(model.q_names());
  layout.q_units = copy(model.q_units());
  layout.v_names = copy(model.v_names());
  layout.v_units = copy(model.v_units());
  layout.u_names = copy(model.u_names());
  layout.u_units = copy(model.u_units());
  if (run.bodies) layout.body_names = chosen_names(model, run.chosen_bodies);
  layout.states = run.states;
  layout.of_bodies = run.of_bodies;
  layout.of_end_effectors = run.of_end_effectors;
  if (run.end_effectors) layout.end_effector_names = end_effector_names(model);
  layout.audit = run.audit;
  if (run.memory) layout.memory = memory_points(model);
  layout.of_memory = run.of_memory;
  for (std::size_t i = 0; i < model.sensors().size(); ++i)
    layout.sensors.push_back(
        sensor_layout(model.sensors()[i], scene.sensors[i], run.tactile_intervals[i]));
  layout.fields = run.fields ? *run.fields : whole_fields(model);
  for (const StepStatus status :
       {StepStatus::converged, StepStatus::split, StepStatus::coarse, StepStatus::passed,
        StepStatus::damped, StepStatus::not_converged, StepStatus::non_finite, StepStatus::rotation,
        StepStatus::singular})
    layout.statuses.push_back({static_cast<std::int8_t>(status), to_string(status)});
  describe_randomized(scene, layout);
  const int varied = static_cast<int>(layout.randomized_names.size());
  for (int e = 0; e < batch.environments(); ++e)
    for (int k = 0; k < varied; ++k)
      layout.randomized_values.push_back(batch.randomized_value(e, k));
  layout.scene_name = scene.name;
  layout.scene_path = scene.path;
  layout.scene_text = scene.text;
  layout.integrator = to_string(stepper.integrator());
  layout.timestep = stepper.timestep();
  layout.tolerance = stepper.tolerance();
  layout.accuracy = stepper.accuracy();
  layout.sleep = stepper.sleep();
  layout.every = run.every;
  layout.seed = batch.seed();
  layout.first_episode = batch.episode(0);
  layout.precision = run.precision;
  layout.command_line = run.command_line;
  layout.task = run.task;
  layout.policy = run.policy;
  layout.version = run.version;
  layout.instruction_set = run.instruction_set;
  return layout;
}

DatasetLayout dataset_layout_from(const Model& model, const Stepper& stepper,
                                  const DatasetDescription& run) {
  const Scene& scene = model.scene();
  DatasetLayout layout;
  layout.episodes = run.episodes;
  layout.steps = run.steps;
  layout.every = run.every;
  layout.seed = run.seed;
  layout.single = run.single;
  layout.q_names = copy(model.q_names());
  layout.q_units = copy(model.q_units());
  layout.v_names = copy(model.v_names());
  layout.v_units = copy(model.v_units());
  layout.u_names = copy(model.u_names());
  layout.end_effector_names = end_effector_names(model);
  for (std::size_t i = 0; i < model.sensors().size(); ++i)
    layout.sensors.push_back(sensor_layout(model.sensors()[i], scene.sensors[i], run.every));
  describe_randomized(scene, layout);
  layout.scene_name = scene.name;
  layout.scene_text = scene.text;
  layout.integrator = to_string(stepper.integrator());
  layout.timestep = stepper.timestep();
  layout.tolerance = stepper.tolerance();
  layout.accuracy = stepper.accuracy();
  layout.sleep = stepper.sleep();
  layout.precision = run.precision;
  layout.version = run.version;
  layout.instruction_set = run.instruction_set;
  layout.task = run.task;
  layout.played_by = run.played_by;
  layout.set_name = run.set_name;
  layout.controls = run.controls;
  layout.command = run.command;
  layout.shards = run.shards;
  layout.compression = run.compression;
  layout.gradients_of = run.gradients_of;
  layout.gradients = run.gradients;
  layout.sparse = run.sparse;
  layout.tables = tables_of(model.scene());
  layout.record = run.record;
  layout.record_times = run.record_times;
  layout.bodies = run.bodies;
  layout.fields = run.fields ? *run.fields : whole_fields(model);
  return layout;
}

}  // namespace tangere
