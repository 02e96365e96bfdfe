// SPDX-License-Identifier: Apache-2.0
// Parses names of outputs: sensors, bodies and times. '.' selects a part, '/' a time, and commas
// separate names, so none needs quotes in a shell.
#include "apps/record.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "io/files/name_list.hpp"
#include "io/files/nearest_name.hpp"

namespace tangere::apps {
namespace {

constexpr const char* kTransmissions = "transmissions";

TimedName timed_name(const std::string& word, const std::string& where) {
  try {
    return split_times(word);
  } catch (const InputError& error) {
    throw InputError(where + ": " + error.what());
  }
}

/// A word and what it means; throws for one that the scene does not have.
TimedName requested_output(const std::string& word, const std::string& where, const Model& model) {
  const TimedName requested = timed_name(word, where);
  const std::string& name = requested.name;
  const std::optional<FieldOutput> reading = find_output(model.scene(), name);
  const bool is_sensor = reading.has_value(),
             other = is_plain_output(name) || find_body_output(model.scene(), name);
  if (is_sensor && other)
    throw InputError(where + ": '" + name +
                     "' is that of a sensor or camera, too; expected one of another name");
  if (reading)
    if (const std::string reason = reason_against(model.scene(), *reading); !reason.empty())
      throw InputError(fmt::format("{}: '{}', but {}", where, word, reason));
  if (!is_sensor && !other)
    throw InputError(fmt::format("{}: unknown observation '{}'{}", where, name,
                                 suggestion(name, output_names(model.scene()))));
  return requested;
}

}  // namespace

const TimedName* Record::find(const std::string& name) const {
  const auto found = std::find_if(requested.begin(), requested.end(),
                                  [&](const TimedName& a) { return a.name == name; });
  return found == requested.end() ? nullptr : &*found;
}

Record record_of(const std::string& option, const Model& model) {
  Record record;
  std::vector<std::string> words;
  if (!option.empty()) {
    words = split_names("--record", option);
    record.where = "--record";
  } else if (model.scene().outputs) {
    words = model.scene().outputs->record;
    record.where = model.scene().outputs->source.prefix() + "<outputs>";
  }
  if (words.empty()) return record;
  for (const std::string& word : words) {
    TimedName requested = requested_output(word, record.where, model);
    if (record.find(requested.name) != nullptr)
      throw InputError(
          fmt::format("{}: '{}' is listed twice; expected it once, at times of one kind",
                      record.where, requested.name));
    record.requested.push_back(std::move(requested));
  }
  RolloutOutputs& outputs = record.outputs;
  outputs.bodies = record.find("bodies") != nullptr;
  outputs.end_effectors = record.find("variables") != nullptr;
  if (outputs.end_effectors && model.end_effectors().empty())
    throw InputError(record.where + ": 'variables', but the scene has no end effectors");
  if (outputs.end_effectors) outputs.end_effector_times = record.find("variables")->times;
  const TimedName* const q = record.find("q");
  const TimedName* const v = record.find("v");
  if (q != nullptr) outputs.states = q->times;
  if (v != nullptr) outputs.states = v->times;
  if (record.find("memory") != nullptr && !model.has_shear_state())
    throw InputError(record.where +
                     ": 'memory', but nothing in the scene has ks or friction of joints");
  if (const TimedName* const forces = record.find(kTransmissions); forces != nullptr) {
    if (model.scene().transmissions.empty())
      throw InputError(record.where + ": 'transmissions', but the scene has none");
    if (forces->times.given())
      throw InputError(
          record.where +
          ": 'transmissions' with times; expected it alone: it is stored at each step");
    outputs.transmissions = true;
  }
  outputs.fields.emplace();
  for (const TimedName& requested : record.requested)
    if (std::optional<FieldOutput> field = find_output(model.scene(), requested.name)) {
      field->times = requested.times;
      outputs.fields->push_back(*field);
    }
  // The order of words does not make another data set.
  std::sort(outputs.fields->begin(), outputs.fields->end(),
            [](const FieldOutput& a, const FieldOutput& b) {
              return std::pair(a.sensor, a.form) < std::pair(b.sensor, b.form);
            });
  return record;
}

std::vector<TimedName> record_of_task(const std::string& option, const Task& task) {
  std::vector<TimedName> record;
  if (option.empty()) return record;
  const Scene& scene = task.model().scene();
  std::vector<std::string> known{"q", "v"};
  for (const TensorSpec& tensor : task.spec().observations) known.push_back(tensor.name);
  const auto observed = std::ssize(known);
  for (const TactileDescription& sensor : scene.sensors)
    for (const FieldForm form : field_forms()) known.push_back(output_name(sensor.name, form));
  const std::string where = "--record";
  for (const std::string& word : split_names(where, option)) {
    TimedName requested = timed_name(word, where);
    const std::string& name = requested.name;
    const auto place = std::find(known.begin(), known.end(), name);
    if (place == known.end())
      throw InputError(
          fmt::format("{}: unknown observation '{}'{}", where, name, suggestion(name, known)));
    if (place - known.begin() >= observed)
      if (const std::string reason = reason_against(scene, *find_output(scene, name));
          !reason.empty())
        throw InputError(fmt::format("{}: '{}', but {}", where, word, reason));
    if (std::any_of(record.begin(), record.end(),
                    [&](const TimedName& other) { return other.name == name; }))
      throw InputError(fmt::format("{}: '{}' is listed twice; expected it once", where, name));
    record.push_back(std::move(requested));
  }
  return record;
}

void take_memory(Record& record, const Model& model) {
  RolloutOutputs& outputs = record.outputs;
  outputs.memory = model.has_shear_state();
  outputs.shear_times = outputs.states.given() ? outputs.states : OutputTimes{.final = true};
  if (const TimedName* const requested = record.find("memory"))
    outputs.shear_times = requested->times;
}

void refuse_trajectory_outputs(const Record& record, const std::string& who) {
  for (const char* name : {"memory", kTransmissions})
    if (record.find(name) != nullptr)
      throw InputError(
          fmt::format("{}: '{}', but {} does not hold it; expected other names: a trajectory of "
                      "simulate holds it",
                      record.where, name, who));
}

void take_bodies(Record& record, const Model& model) {
  const TimedName* first = record.find("bodies");
  RolloutOutputs& outputs = record.outputs;
  for (const TimedName& requested : record.requested) {
    const std::optional<int> body = find_body_output(model.scene(), requested.name);
    if (!body) continue;
    if (outputs.bodies && outputs.chosen_bodies.empty())
      throw InputError(fmt::format("{}: 'bodies' and '{}'; expected all bodies, or names of some",
                                   record.where, requested.name));
    if (first != nullptr && requested.times != first->times)
      throw InputError(fmt::format("{}: '{}{}' and '{}{}'; expected one interval of all bodies",
                                   record.where, first->name, to_string(first->times),
                                   requested.name, to_string(requested.times)));
    first = &requested;
    outputs.bodies = true;
    outputs.chosen_bodies.push_back(*body);
  }
  if (first != nullptr) outputs.body_times = first->times;
  std::sort(outputs.chosen_bodies.begin(), outputs.chosen_bodies.end());
  // A trajectory has one list of rows for both.
  const TimedName* const q = record.find("q");
  const TimedName* const v = record.find("v");
  if (q != nullptr && v != nullptr && q->times != v->times)
    throw InputError(fmt::format("{}: 'q{}' and 'v{}'; expected one interval of both", record.where,
                                 to_string(q->times), to_string(v->times)));
}

}  // namespace tangere::apps
