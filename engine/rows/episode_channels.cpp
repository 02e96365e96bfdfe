// SPDX-License-Identifier: Apache-2.0
// The order of channels does not depend on that of the record, so that the same request gives the
// same files.
#include "engine/rows/episode_channels.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

using ChannelKind = EpisodeChannel::Kind;

bool perfect(const SensorLayout& sensor) { return sensor.imperfections.empty(); }

bool is_one_of(const std::vector<TensorSpec>& observations, const std::string& name) {
  return std::any_of(observations.begin(), observations.end(),
                     [&](const TensorSpec& each) { return each.name == name; });
}

class ChannelList {
 public:
  ChannelList(std::span<const TimedName> record, int every) : record_(record), every_(every) {}

  [[nodiscard]] const TimedName* requested(const std::string& name) const {
    const auto found = std::find_if(record_.begin(), record_.end(),
                                    [&](const TimedName& one) { return one.name == name; });
    return found == record_.end() ? nullptr : &*found;
  }

  EpisodeChannel& add(ChannelKind kind, const std::string& name, std::vector<std::uint64_t> shape,
                      const std::string& unit = {}, const std::string& meaning = {}) {
    const TimedName* const one = requested(name);
    const OutputTimes times = one != nullptr ? one->times : OutputTimes{};
    if (times.every % every_ != 0)
      throw InputError(
          fmt::format("'{}{}', and a row is every {} steps; expected a multiple of {}{}", name,
                      to_string(times), every_, every_,
                      times.every < every_ ? ": windows are of forces, displacements and heights "
                                             "that sensors read"
                                           : ""));
    return all_.emplace_back(EpisodeChannel{.kind = kind,
                                            .name = name,
                                            .shape = std::move(shape),
                                            .unit = unit,
                                            .meaning = meaning,
                                            .requested = record_.empty() || one != nullptr,
                                            .times = {times.every / every_, times.final}});
  }

  void add_reading(std::span<const SensorLayout> sensors, FieldOutput reading) {
    const SensorLayout& sensor = sensors[static_cast<std::size_t>(reading.sensor)];
    const std::string name = output_name(sensor.name, reading.form);
    const std::vector<std::uint64_t> shape = reading_shape(sensor, reading.form);
    const TimedName* const one = requested(name);
    const std::int64_t between = one != nullptr ? one->times.every : 0;
    const bool windowed = between > 0 && between < every_ && !is_colour(reading.form);
    EpisodeChannel& channel = windowed ? add_window(name, shape, static_cast<int>(between))
                                       : add(ChannelKind::reading, name, shape);
    channel.unit = unit_text(sensor, reading.form);
    channel.meaning = components_text(sensor, reading.form);
    channel.reading = {reading.sensor, reading.form};
    // Channels have offsets, which need no touch.
    channel.touch = (perfect(sensor) || is_ideal(reading.form)) && !is_colour(reading.form) &&
                    reading.form != FieldForm::channels;
  }

  /// Adds a picture of a camera, if it is requested.
  void add_view(const CameraLayout& camera, FieldOutput reading) {
    const std::string name = output_name(camera.name, reading.form);
    if (requested(name) == nullptr) return;
    add(ChannelKind::reading, name, view_shape(camera, reading.form)).reading = {reading.sensor,
                                                                                 reading.form};
  }

  [[nodiscard]] std::vector<EpisodeChannel> take() { return std::move(all_); }

 private:
  /// Adds a reading that is taken every `between` steps of a row.
  EpisodeChannel& add_window(const std::string& name, std::vector<std::uint64_t> shape,
                             int between) {
    if (every_ % between != 0)
      throw InputError(
          fmt::format("'{}/{}', and a row is every {} steps; expected a divisor of {}, for a "
                      "window, or a multiple",
                      name, between, every_, every_));
    const int window = every_ / between;
    shape.insert(shape.begin(), static_cast<std::uint64_t>(window));
    return all_.emplace_back(EpisodeChannel{.kind = ChannelKind::reading,
                                            .name = name,
                                            .shape = std::move(shape),
                                            .unit = {},
                                            .meaning = {},
                                            .window = window});
  }

  std::span<const TimedName> record_;
  int every_;
  std::vector<EpisodeChannel> all_;
};

/// Every row of a task has all that is recorded, because its episodes differ in length. Throws
/// InputError for times other than those of windows.
void refuse_times(std::span<const TimedName> record, const std::vector<TensorSpec>& observations,
                  std::span<const SensorLayout> sensors, int every) {
  for (const TimedName& one : record) {
    const bool observed = one.name == "q" || one.name == "v" || is_one_of(observations, one.name);
    const bool within = !one.times.final && one.times.every < every;
    if (!one.times.given() || (within && !observed)) continue;
    throw InputError(fmt::format(
        "'{}{}' of a task; expected '{}', which is in every row{}", one.name, to_string(one.times),
        one.name,
        every == 1 || sensors.empty()
            ? ""
            : fmt::format(", or a window of a sensor, such as '{}/1', of less than {} steps",
                          sensors.front().name, every)));
  }
}

void add_readings(ChannelList& list, std::span<const SensorLayout> sensors,
                  const std::vector<TensorSpec>& observations = {}) {
  for (int s = 0; s < std::ssize(sensors); ++s)
    for (const FieldForm form : field_forms()) {
      const std::string name = output_name(sensors[static_cast<std::size_t>(s)].name, form);
      if (!is_one_of(observations, name) && list.requested(name) != nullptr)
        list.add_reading(sensors, {s, form});
    }
}

void add_bodies(ChannelList& list, std::span<const std::string> bodies) {
  std::vector<int> all;
  for (int b = 0; b < std::ssize(bodies); ++b) all.push_back(b);
  if (list.requested("bodies") != nullptr)
    list.add(ChannelKind::bodies, "bodies", {bodies.size(), kMotion}).bodies = all;
  for (const int b : all)
    if (const std::string name = body_output(bodies[static_cast<std::size_t>(b)]);
        list.requested(name) != nullptr)
      list.add(ChannelKind::bodies, name, {1, kMotion}).bodies = {b};
}

}  // namespace

std::size_t EpisodeChannel::width() const {
  std::size_t numbers = 1;
  for (const std::uint64_t n : shape) numbers *= n;
  return numbers;
}

std::vector<EpisodeChannel> episode_channels(const RunFacts& facts,
                                             std::span<const SensorLayout> sensors,
                                             std::span<const CameraLayout> cameras,
                                             std::span<const std::string> bodies,
                                             std::span<const TimedName> record, int every) {
  ChannelList list(record, every);
  list.add(ChannelKind::q, "q", {facts.q_names.size()}, "q_units", "coordinates");
  list.add(ChannelKind::v, "v", {facts.v_names.size()}, "v_units", "velocities");
  if (facts.task) {
    refuse_times(record, facts.task->observations, sensors, every);
    const bool all_perfect = std::all_of(sensors.begin(), sensors.end(), perfect);
    for (const TensorSpec& tensor : facts.task->observations) {
      EpisodeChannel& channel =
          list.add(ChannelKind::task, tensor.name, {tensor.shape.begin(), tensor.shape.end()},
                   tensor.unit, tensor.meaning);
      channel.touch = tensor.touch && all_perfect;
      channel.task_bytes = tensor.own_bytes;
    }
    add_readings(list, sensors, facts.task->observations);
    return list.take();
  }
  if (!facts.end_effector_names.empty())
    list.add(ChannelKind::end_effectors, "variables", {facts.end_effector_names.size(), 3});
  add_bodies(list, bodies);
  for (int s = 0; s < std::ssize(sensors); ++s)
    if (record.empty()) list.add_reading(sensors, {s});
  if (!record.empty()) add_readings(list, sensors);
  for (int c = 0; c < std::ssize(cameras); ++c)
    for (const FieldForm form : view_forms())
      list.add_view(cameras[static_cast<std::size_t>(c)], {c, form});
  return list.take();
}

std::vector<EpisodeChannel> episode_channels(const Model& model, const TaskSpec* task,
                                             std::span<const TimedName> record, int every) {
  RunFacts facts;
  facts.q_names = {model.q_names().begin(), model.q_names().end()};
  facts.v_names = {model.v_names().begin(), model.v_names().end()};
  for (const EndEffectorInfo& info : model.end_effectors())
    facts.end_effector_names.push_back(info.name);
  if (task != nullptr) facts.task.emplace(*task);
  std::vector<SensorLayout> sensors;
  for (std::size_t s = 0; s < model.sensors().size(); ++s)
    sensors.push_back(sensor_layout(model.sensors()[s], model.scene().sensors[s], every));
  return episode_channels(facts, sensors, camera_layouts(model.scene()), model.body_names(), record,
                          every);
}

}  // namespace tangere
