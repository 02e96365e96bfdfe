// SPDX-License-Identifier: Apache-2.0
// Observations are copies of a snapshot or forms of its fields, so their derivatives are copies of
// the weights or pullbacks of these forms.
#include "tasks/catalogue/scene_task.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "engine/base/as_size.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/rows/episode_channels.hpp"
#include "engine/scene/imperfection_checks.hpp"
#include "engine/step/displacement.hpp"
#include "engine/step/shear_state_arrays.hpp"

namespace tangere {

namespace {

constexpr std::size_t kPose = 7, kTwist = 6;

/// What one name of a reading stands for.
struct NamedReading {
  std::optional<FieldOutput> field = {};
  int first_body = 0, bodies = 0;
  int first_end_effector = 0, end_effectors = 0;
  bool shear_state = false;
};

constexpr const char* kShearState = "shear_state";

/// Whether a name is that of a picture of a camera of the scene.
bool is_camera_picture(const Scene& scene, const std::string& name) {
  return std::ranges::any_of(scene.cameras, [&](const CameraDescription& camera) {
    return name.starts_with(camera.name + '.');
  });
}

std::vector<std::string> known_names(const Model& model) {
  std::vector<std::string> names = output_names(model.scene());
  std::erase_if(names, [&](const std::string& name) {
    if (is_camera_picture(model.scene(), name)) return true;
    const auto field = find_output(sensor_names(model.scene()), name);
    return name == "q" || name == "v" || name == "memory" || name == "transmissions" ||
           (field && !reason_against(model.scene(), *field).empty());
  });
  for (const EndEffectorInfo& e : model.end_effectors()) names.push_back(e.name);
  if (shear_state_arrays(model).count() > 0) names.emplace_back(kShearState);
  return names;
}

NamedReading reading_named(const Model& model, const std::string& name) {
  const auto& end_effectors = model.end_effectors();
  if (const auto field = find_output(sensor_names(model.scene()), name)) return {.field = field};
  if (name == "bodies") return {.bodies = model.nb()};
  if (const auto body = find_body_output(model.scene(), name))
    return {.first_body = *body, .bodies = 1};
  if (name == "variables" && !end_effectors.empty())
    return {.end_effectors = static_cast<int>(end_effectors.size())};
  for (std::size_t k = 0; k < end_effectors.size(); ++k)
    if (end_effectors[k].name == name)
      return {.first_end_effector = static_cast<int>(k), .end_effectors = 1};
  if (name == kShearState && shear_state_arrays(model).count() > 0) return {.shear_state = true};
  if (is_camera_picture(model.scene(), name))
    throw InputError(
        fmt::format("'{}' is of a camera, whose pictures have no derivatives; expected one of {}",
                    name, fmt::join(known_names(model), ", ")));
  throw InputError(fmt::format("the scene has no reading '{}'; expected one of {}", name,
                               fmt::join(known_names(model), ", ")));
}

/// Whether an output is a function of the field. A pressure leaves friction out, and pictures of a
/// sensor without a layer show the depth of bodies.
bool has_map(const Model& model, const FieldOutput& output) {
  if (is_picture(output.form))
    return model.scene().sensors[as_size(output.sensor)].layer.has_value();
  return output.form != FieldForm::pressure;
}

/// What is read of a sensor to compute an output.
FieldOutput read_for(const Model& model, const FieldOutput& output) {
  if (!has_map(model, output)) return {output.sensor, output.form};
  const bool imperfect = is_imperfect(model.scene().sensors[as_size(output.sensor)].imperfections);
  return {output.sensor, is_ideal(output.form) && imperfect ? FieldForm::ideal : FieldForm::field};
}

std::vector<std::string> default_readings(const Model& model) {
  std::vector<std::string> names = sensor_names(model.scene());
  if (!model.end_effectors().empty()) names.insert(names.begin(), "variables");
  return names;
}

TensorSpec field_spec(const SensorInfo& sensor, FieldOutput output) {
  TensorSpec spec{output_name(sensor.name, output.form), {6}, "N, m", "reading of a sensor"};
  spec.touch = !is_colour(output.form) && output.form != FieldForm::channels;
  if (output.form == FieldForm::sum) return spec;
  const bool is_length = is_displacement(output.form) || output.form == FieldForm::height;
  const bool has_unit = output.form != FieldForm::flow && !is_colour(output.form);
  spec.unit = is_length ? "m" : has_unit ? "N" : "1";
  spec.shape = reading_shape(sensor, output.form);
  if (output.form == FieldForm::channels) spec.unit = "the channels'";
  if (output.form == FieldForm::pressure) spec.shape.pop_back();
  return spec;
}

TensorSpec spec_of(const Model& model, const std::string& name, const NamedReading& reading) {
  if (reading.field)
    return field_spec(model.sensors()[as_size(reading.field->sensor)], *reading.field);
  TensorSpec spec{name, {kMotion}, "m, 1, rad/s, m/s", "pose and twist of a body"};
  if (reading.bodies > 0) {
    if (name == "bodies") spec.shape = {as_size(reading.bodies), kMotion};
    return spec;
  }
  if (reading.shear_state)
    return {name, {shear_state_arrays(model).count(), 3}, "m", "displacement of springs"};
  spec = {name, {3}, "m", "place of an end effector"};
  if (name == "variables") spec.shape = {as_size(reading.end_effectors), 3};
  return spec;
}

TaskSpec declared(const Scene& scene, int steps, int horizon,
                  const std::optional<std::vector<std::string>>& readings) {
  const Model model(scene);
  TaskSpec spec;
  spec.name = "scene";
  spec.summary = "A scene without a reward.";
  spec.scene = scene.path.empty() ? scene.name : scene.path;
  spec.success = "never";
  spec.action = {"controls", {as_size(steps), as_size(model.nu())}, "1", "controls of the motors"};
  spec.observations = {{"state.q", {std::size_t(model.nq())}, "m, rad, 1", "coordinates"},
                       {"state.v", {std::size_t(model.nv())}, "m/s, rad/s", "velocities"}};
  for (const std::string& name : readings ? *readings : default_readings(model)) {
    const NamedReading reading = reading_named(model, name);
    spec.observations.push_back(spec_of(model, name, reading));
    spec.reads_bodies |= reading.bodies > 0;
    spec.reads_end_effectors |= reading.end_effectors > 0;
    spec.reads_tactile |= reading.field.has_value();
    spec.reads_shear_state |= reading.shear_state;
    if (!reading.field) continue;
    if (const FieldOutput source = read_for(model, *reading.field);
        std::ranges::find(spec.fields, source) == spec.fields.end())
      spec.fields.push_back(source);
  }
  spec.steps_per_action = steps;
  spec.control_every = 1;
  spec.snapshots = {steps};
  spec.horizon = horizon;
  return spec;
}

}  // namespace

SceneTask::SceneTask(const Scene& scene, int steps, int horizon,
                     const std::optional<std::vector<std::string>>& readings)
    : Task(scene, declared(scene, steps, horizon, readings)) {
  for (const std::string& name : readings ? *readings : default_readings(model())) {
    const NamedReading reading = reading_named(model(), name);
    if (reading.field) {
      const FieldOutput source = read_for(model(), *reading.field);
      Field field{{}, 0, 0, as_size(first_tactile_point(model(), source.sensor))};
      for (const FieldOutput& other : fields()) {
        field.size = numbers_of(model(), other);
        if (other == source) break;
        field.first += field.size;
      }
      if (has_map(model(), *reading.field)) field.map.emplace(model(), *reading.field);
      readings_.emplace_back(std::move(field));
    } else if (reading.bodies > 0) {
      for (int b = 0; b < reading.bodies; ++b)
        readings_.emplace_back(Motion{as_size(reading.first_body + b)});
    } else if (reading.shear_state) {
      readings_.emplace_back(Shear{});
    } else {
      readings_.emplace_back(
          Positions{3 * as_size(reading.first_end_effector), 3 * as_size(reading.end_effectors)});
    }
  }
}

void SceneTask::start(const TaskStart& start) const {
  const std::size_t k = start.varying.size(), first = std::size_t(start.episode) * k;
  if (k == 0 || first + k > varying_.size()) return;
  std::copy_n(varying_.begin() + std::ptrdiff_t(first), k, start.varying.begin());
}

void SceneTask::controls(const TaskView& view, int step, std::span<double> u) const {
  std::ranges::copy(view.action.subspan(as_size(step) * u.size(), u.size()), u.begin());
}

void SceneTask::controls_vjp(const TaskView&, int step, std::span<const double> weight,
                             const ViewCotangent& out) const {
  const auto to = out.action.subspan(as_size(step) * weight.size(), weight.size());
  for (std::size_t k = 0; k < weight.size(); ++k) to[k] += weight[k];
}

void SceneTask::observe(const TaskView& view, std::span<double> observation) const {
  const Snapshot& now = view.now();
  const std::size_t twists = kPose * as_size(model().nb());
  std::span<double> left = observation;
  const auto put = [&left](std::span<const double> numbers) {
    std::ranges::copy(numbers, left.begin());
    left = left.subspan(numbers.size());
  };
  put(now.q);
  put(now.v);
  for (const Reading& reading : readings_) {
    if (const auto* field = std::get_if<Field>(&reading)) {
      const auto read = now.tactile.subspan(field->first, field->size);
      if (!field->map) {
        put(read);
        continue;
      }
      field->map->evaluate(read, left.first(field->map->size()));
      left = left.subspan(field->map->size());
    } else if (const auto* motion = std::get_if<Motion>(&reading)) {
      put(now.bodies.subspan(kPose * motion->body, kPose));
      put(now.bodies.subspan(twists + kTwist * motion->body, kTwist));
    } else if (std::holds_alternative<Shear>(reading)) {
      put(now.shear_state);
    } else {
      const auto& of = std::get<Positions>(reading);
      put(now.end_effectors.subspan(of.first, of.count));
    }
  }
}

void SceneTask::observe_vjp(const TaskView& view, std::span<const double> weight,
                            const ViewCotangent& out) const {
  const Snapshot& now = view.now();
  const SnapshotCotangent& bar = out.snapshots.back();
  const std::size_t twists = kPose * as_size(model().nb());
  const auto add = [&weight](std::span<double> to) {
    for (std::size_t i = 0; i < to.size(); ++i) to[i] += weight[i];
    weight = weight.subspan(to.size());
  };
  add_along_dofs(model(), now.q, weight.first(now.q.size()), bar.q);
  weight = weight.subspan(now.q.size());
  add(bar.v);
  for (const Reading& reading : readings_) {
    if (const auto* field = std::get_if<Field>(&reading)) {
      const auto to = bar.tactile.subspan(field->first, field->size);
      if (!field->map) {
        add(to);
        continue;
      }
      const std::span<double> points =
          out.points.empty() ? out.points : out.points.subspan(kPointNumbers * field->point);
      field->map->pull_back(now.tactile.subspan(field->first, field->size),
                            weight.first(field->map->size()), to, points);
      weight = weight.subspan(field->map->size());
    } else if (const auto* motion = std::get_if<Motion>(&reading)) {
      add(bar.bodies.subspan(kPose * motion->body, kPose));
      add(bar.bodies.subspan(twists + kTwist * motion->body, kTwist));
    } else if (std::holds_alternative<Shear>(reading)) {
      add(bar.shear_state);
    } else {
      const auto& of = std::get<Positions>(reading);
      add(bar.end_effectors.subspan(of.first, of.count));
    }
  }
}

}  // namespace tangere
