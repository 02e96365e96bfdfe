// SPDX-License-Identifier: Apache-2.0
// Names and sizes of readings.
#include "engine/scene/field_form.hpp"

#include <algorithm>
#include <iterator>
#include <string_view>

#include "engine/base/error.hpp"

namespace tangere {

namespace {
constexpr FieldForm kForms[] = {FieldForm::field,   FieldForm::pressure, FieldForm::shear,
                                FieldForm::sum,     FieldForm::ideal,    FieldForm::markers,
                                FieldForm::surface, FieldForm::flow,     FieldForm::channels,
                                FieldForm::height,  FieldForm::rgb,      FieldForm::rgb_marker};
constexpr FieldForm kViews[] = {FieldForm::view_rgb, FieldForm::view_depth, FieldForm::view_ids};
constexpr const char* kPlain[] = {"q", "v", "variables", "bodies", "memory", "transmissions"};
constexpr const char* kBodyOutput = "bodies.";  // followed by the name of one
}  // namespace

const char* to_string(FieldForm form) {
  switch (form) {
    case FieldForm::field: return "field";
    case FieldForm::pressure: return "pressure";
    case FieldForm::shear: return "shear";
    case FieldForm::sum: return "sum";
    case FieldForm::ideal: return "ideal";
    case FieldForm::markers: return "markers";
    case FieldForm::surface: return "surface";
    case FieldForm::flow: return "flow";
    case FieldForm::channels: return "channels";
    case FieldForm::height: return "height";
    case FieldForm::rgb: return "rgb";
    case FieldForm::rgb_marker: return "rgb_marker";
    case FieldForm::view_rgb: return "rgb";
    case FieldForm::view_depth: return "depth";
    case FieldForm::view_ids: return "ids";
  }
  return "unknown";
}

int components_of(FieldForm form) {
  switch (form) {
    case FieldForm::field:
    case FieldForm::ideal:
    case FieldForm::rgb:
    case FieldForm::rgb_marker:
    case FieldForm::view_rgb:
    case FieldForm::surface: return 3;
    case FieldForm::height:
    case FieldForm::view_depth:
    case FieldForm::view_ids:
    case FieldForm::pressure: return 1;
    case FieldForm::shear:
    case FieldForm::flow:
    case FieldForm::markers: return 2;
    case FieldForm::sum:
    case FieldForm::channels: break;
  }
  return 0;
}

std::span<const FieldForm> field_forms() { return kForms; }
std::span<const FieldForm> view_forms() { return kViews; }

bool is_ideal(FieldForm form) {
  return form == FieldForm::ideal || form == FieldForm::channels || is_displacement(form) ||
         is_picture(form);
}

std::size_t numbers_of(int points, FieldForm form) {
  if (form == FieldForm::sum) return std::tuple_size_v<FieldSum>;
  return static_cast<std::size_t>(components_of(form)) * static_cast<std::size_t>(points);
}

std::string output_name(const std::string& sensor, FieldForm form) {
  return form == FieldForm::field ? sensor : sensor + "." + to_string(form);
}

std::vector<std::string> sensor_names(const Scene& scene) {
  std::vector<std::string> names;
  for (const TactileDescription& sensor : scene.sensors) names.push_back(sensor.name);
  return names;
}

const std::string& source_name(const Scene& scene, const FieldOutput& output) {
  const auto k = static_cast<std::size_t>(output.sensor);
  return is_view(output.form) ? scene.cameras[k].name : scene.sensors[k].name;
}

bool is_plain_output(const std::string& name) {
  return std::any_of(std::begin(kPlain), std::end(kPlain),
                     [&](std::string_view plain) { return plain == name; });
}

std::optional<FieldOutput> find_output(std::span<const std::string> sensors,
                                       const std::string& name) {
  // A sensor may be called "pad.sum" itself: its field comes first.
  for (const FieldForm form : kForms)
    for (std::size_t s = 0; s < sensors.size(); ++s)
      if (output_name(sensors[s], form) == name) return FieldOutput{static_cast<int>(s), form};
  return std::nullopt;
}

std::optional<FieldOutput> find_output(const Scene& scene, const std::string& name) {
  if (const auto of = find_output(sensor_names(scene), name)) return of;
  for (const FieldForm form : kViews)
    for (std::size_t c = 0; c < scene.cameras.size(); ++c)
      if (output_name(scene.cameras[c].name, form) == name)
        return FieldOutput{static_cast<int>(c), form};
  return std::nullopt;
}

std::string body_output(const std::string& body) { return kBodyOutput + body; }

std::optional<int> find_body_output(const Scene& scene, const std::string& name) {
  for (std::size_t b = 0; b < scene.links.size(); ++b)
    if (name == body_output(scene.links[b].body.name)) return static_cast<int>(b);
  return std::nullopt;
}

bool has_output(const Scene& scene, const std::string& word) {
  const std::string name = split_times(word).name;
  return is_plain_output(name) || find_body_output(scene, name) || find_output(scene, name);
}

std::string reason_against(const Scene& scene, const FieldOutput& output) {
  if (is_view(output.form)) return "";
  const TactileDescription& sensor = scene.sensors[static_cast<std::size_t>(output.sensor)];
  const auto missing_part = [&]() -> const char* {
    switch (output.form) {
      case FieldForm::markers: return sensor.markers ? nullptr : "<markers>";
      case FieldForm::surface:
        return !sensor.markers ? "<markers>" : !sensor.layer ? "<layer>" : nullptr;
      case FieldForm::channels: return sensor.channels ? nullptr : "<channels>";
      case FieldForm::height:
      case FieldForm::rgb: return sensor.picture ? nullptr : "<picture>";
      case FieldForm::rgb_marker:
        if (!sensor.picture || sensor.picture->markers[0] == 0)
          return "<picture> with markers=\"columns rows\"";
        return sensor.markers ? nullptr : "<markers>";
      default: return nullptr;
    }
  };
  const char* const missing = missing_part();
  if (missing == nullptr) return "";
  return sensor.source.prefix() + "sensor '" + sensor.name + "' has no " + missing +
         "; expected it in its <tactile>";
}

void check_outputs(const Scene& scene, std::span<const FieldOutput> outputs) {
  for (std::size_t k = 0; k < outputs.size(); ++k) {
    const FieldOutput of = outputs[k];
    const bool view = is_view(of.form);
    const std::string kind = view ? "camera" : "sensor";
    if (const std::size_t count = view ? scene.cameras.size() : scene.sensors.size();
        of.sensor < 0 || static_cast<std::size_t>(of.sensor) >= count)
      throw InputError("an output of " + kind + ' ' + std::to_string(of.sensor) +
                       "; the scene has " + std::to_string(count));
    const auto before = outputs.first(k);
    if (std::any_of(before.begin(), before.end(), [&](const FieldOutput& other) {
          return other.sensor == of.sensor && other.form == of.form;
        }))
      throw InputError("the " + std::string(to_string(of.form)) + " of " + kind + ' ' +
                       std::to_string(of.sensor) + " is listed twice; expected it once");
  }
}

std::vector<FieldOutput> whole_fields(const Scene& scene) {
  std::vector<FieldOutput> outputs;
  for (std::size_t s = 0; s < scene.sensors.size(); ++s)
    outputs.push_back({static_cast<int>(s), FieldForm::field});
  return outputs;
}

std::vector<FieldOutput> requested_fields(const Scene& scene) {
  if (!scene.outputs) return whole_fields(scene);
  std::vector<FieldOutput> outputs;
  for (const std::string& word : scene.outputs->record) {
    const TimedName timed = split_times(word);
    if (std::optional<FieldOutput> of = find_output(scene, timed.name)) {
      of->times = timed.times;
      outputs.push_back(*of);
    }
  }
  return outputs;
}

std::vector<std::string> output_names(std::span<const std::string> sensors) {
  std::vector<std::string> names(std::begin(kPlain), std::end(kPlain));
  for (const std::string& sensor : sensors)
    for (const FieldForm form : kForms) names.push_back(output_name(sensor, form));
  return names;
}

std::vector<std::string> output_names(const Scene& scene) {
  const std::vector<std::string> sensors = sensor_names(scene);
  std::vector<std::string> names = output_names(sensors);
  std::erase_if(names, [&](const std::string& name) {
    const std::optional<FieldOutput> of = find_output(sensors, name);
    return of && !reason_against(scene, *of).empty();
  });
  for (const CameraDescription& camera : scene.cameras)
    for (const FieldForm form : kViews) names.push_back(output_name(camera.name, form));
  for (const LinkDescription& link : scene.links) names.push_back(body_output(link.body.name));
  return names;
}

}  // namespace tangere
