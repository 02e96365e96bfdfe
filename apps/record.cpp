// SPDX-License-Identifier: Apache-2.0
// Names of outputs become readings of sensors; bodies and end effectors are all or none.
#include "apps/record.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "io/files/name_list.hpp"
#include "io/files/nearest_name.hpp"

namespace tangere::apps {

Record record_of(const std::string& option, const Model& model) {
  Record record;
  if (!option.empty()) {
    record.names = split_names("--record", option);
  } else if (model.scene().outputs) {
    record.names = model.scene().outputs->record;
  }
  if (record.names.empty()) return record;
  const auto asked = [&](const char* name) {
    return std::find(record.names.begin(), record.names.end(), name) != record.names.end();
  };
  const std::string where =
      option.empty() ? model.scene().outputs->source.prefix() + "<outputs>" : "--record";
  const std::vector<std::string> sensors = sensor_names(model.scene());
  record.outputs.bodies = asked("bodies");
  record.outputs.end_effectors = asked("variables");
  if (record.outputs.end_effectors && model.end_effectors().empty())
    throw InputError(where + ": 'variables', but the scene has no end effectors");
  record.outputs.fields.emplace();
  for (const std::string& name : record.names) {
    if (is_plain_output(name)) {
      if (find_output(sensors, name))
        throw InputError(where + ": '" + name + "' is a sensor, too; expected one of another name");
      continue;
    }
    const std::optional<FieldOutput> field = find_output(sensors, name);
    if (!field)
      throw InputError(fmt::format("{}: unknown observation '{}'{}", where, name,
                                   suggestion(name, output_names(sensors))));
    record.outputs.fields->push_back(*field);
  }
  // The order of words does not make another data set.
  std::sort(record.outputs.fields->begin(), record.outputs.fields->end(),
            [](const FieldOutput& a, const FieldOutput& b) {
              return std::pair(a.sensor, a.form) < std::pair(b.sensor, b.form);
            });
  return record;
}

}  // namespace tangere::apps
