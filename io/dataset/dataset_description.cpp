// SPDX-License-Identifier: Apache-2.0
// Compares settings in the form in which a file holds them, so that no written setting escapes the
// comparison.
#include "io/dataset/dataset_description.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <limits>
#include <optional>
#include <sstream>

#include "engine/base/error.hpp"
#include "engine/rows/sensor_layout.hpp"
#include "io/dataset/learner_notes.hpp"
#include "io/hdf5/h5_channels.hpp"
#include "io/hdf5/h5_listing.hpp"

namespace tangere {
namespace {

constexpr const char* kGradients =
    "gradients";  // the name of an attribute and of a group of /scene
constexpr const char* kByRow = "one for each action";
constexpr std::size_t kLongText =
    60;  // bytes; of a longer value only the line that differs is shown

void describe_task(const h5::Id& scene, const DatasetLayout& layout) {
  if (!layout.task) {
    h5::write_attribute(scene, "task", kNoTask);
    return;
  }
  const TaskSpec& task = *layout.task;
  const PlayedBy& by = layout.played_by;
  const std::vector<std::string> players = by.players.empty() ? std::vector{by.policy} : by.players;
  h5::write_attribute(scene, "task", task.name);
  if (!layout.python_class.empty()) h5::write_attribute(scene, "python_class", layout.python_class);
  h5::write_attribute(scene, "policy", by.policy);
  h5::write_attribute(scene, "policies", std::span<const std::string>(players));
  h5::write_scalar<double>(scene, "policy_noise", by.noise);
  h5::write_scalar<double>(scene, "policy_random_share", by.random_share);
  h5::write_attribute(scene, "success", task.success);
  h5::write_attribute(scene, "action_unit", task.action.unit);
  h5::write_attribute(scene, "action_meaning", task.action.meaning);
  h5::write_scalar<double>(scene, "action_low", task.action.low);
  h5::write_scalar<double>(scene, "action_high", task.action.high);
}

/// Unit and meaning of an observation. A channel says them of readings and of what a task observes.
std::pair<std::string, std::string> unit_and_meaning(const EpisodeChannel& channel) {
  const FieldOutput of = channel.reading;
  if (channel.kind == EpisodeChannel::Kind::end_effectors)
    return {"m", "positions of the end effectors in the world"};
  if (channel.kind == EpisodeChannel::Kind::bodies)
    return {"m, m, m, 1, 1, 1, 1, rad/s, rad/s, rad/s, m/s, m/s, m/s",
            "x y z qw qx qy qz, angular and linear velocity of each body's frame in the world"};
  if (channel.kind == EpisodeChannel::Kind::reading && is_view(of.form))
    return {is_colour(of.form)               ? "grey levels"
            : of.form == FieldForm::view_ids ? "1"
                                             : "m",
            std::string(view_text(of.form))};
  return {channel.unit, channel.meaning};
}

void describe_observations(const h5::Id& scene, const DatasetLayout& layout) {
  const std::vector<EpisodeChannel> channels = layout.channels();
  std::vector<std::string> names, units, meanings;
  for (const std::size_t k : layout.recorded()) {
    auto [unit, meaning] = unit_and_meaning(channels[k]);
    names.push_back(channels[k].name);
    units.push_back(std::move(unit)), meanings.push_back(std::move(meaning));
  }
  h5::write_attribute(scene, "observations", std::span<const std::string>(names));
  h5::write_attribute(scene, "observation_units", std::span<const std::string>(units));
  h5::write_attribute(scene, "observation_meanings", std::span<const std::string>(meanings));
}

void describe_run(const h5::Id& scene, const DatasetLayout& layout) {
  h5::write_attribute(scene, "name", layout.scene_name);
  h5::write_attribute(scene, "dataset_id", layout.dataset_id());
  h5::write_attribute(scene, "text", layout.scene_text);
  if (!layout.included.empty()) h5::write_attribute(scene, "included", layout.included);
  h5::write_attribute(scene, "tables", layout.tables);
  h5::write_attribute(scene, "controls", layout.controls);
  h5::write_attributes(scene, attributes_of(layout, layout.steps, layout.every));
  h5::write_attribute(scene, "compression", layout.compression);
  if (layout.has_jpeg())
    h5::write_attribute(scene, "pictures", fmt::format("jpeg:{}", layout.jpeg_quality));
  h5::write_attribute(scene, "tactile", layout.sparse ? "sparse" : "dense");
  h5::write_attribute(scene, "tangere_version", layout.version);
  h5::write_attribute(scene, "instruction_set", layout.instruction_set);
}

/// Describes the cameras whose pictures are stored.
void describe_cameras(const h5::Id& scene, const DatasetLayout& layout) {
  const std::vector<EpisodeChannel> channels = layout.channels();
  std::optional<h5::Id> cameras;
  for (std::size_t c = 0; c < layout.cameras.size(); ++c) {
    std::vector<std::string> readings, components;
    for (const EpisodeChannel& channel : channels) {
      const FieldOutput of = channel.reading;
      if (channel.kind != EpisodeChannel::Kind::reading || !is_view(of.form) ||
          static_cast<std::size_t>(of.sensor) != c)
        continue;
      readings.push_back(channel.name);
      components.emplace_back(view_text(of.form));
    }
    if (readings.empty()) continue;
    if (!cameras) cameras.emplace(h5::create_group(scene, "cameras"));
    const CameraLayout& camera = layout.cameras[c];
    const h5::Id group = h5::create_group(*cameras, camera.name);
    h5::write_attributes(group, camera.facts);
    h5::write_attributes(group, {{"names", camera.bodies}});
    h5::write_attribute(group, "readings", std::span<const std::string>(readings));
    h5::write_attribute(group, "reading_components", std::span<const std::string>(components));
  }
}

/// What is not stored at every row, and the steps between: 0 for the last state alone.
void describe_samples(const h5::Id& scene, const DatasetLayout& layout) {
  std::vector<std::string> names;
  std::vector<std::int64_t> every;
  for (const DatasetSample& sample : layout.samples()) {
    names.push_back(sample.name);
    every.push_back(sample.times.every * layout.every);
  }
  if (!names.empty()) {
    h5::write_attribute(scene, "samples", std::span<const std::string>(names));
    h5::write_list<std::int64_t>(scene, "sample_every", every);
  }
  for (const EpisodeChannel& channel : layout.channels()) {
    if (channel.kind != EpisodeChannel::Kind::bodies) continue;
    std::vector<std::string> bodies;
    for (const int b : channel.bodies)
      bodies.push_back(layout.body_names[static_cast<std::size_t>(b)]);
    h5::write_attribute(scene, "names of " + channel.name, std::span<const std::string>(bodies));
  }
}

/// Windows of readings, and the steps between two of them.
void describe_windows(const h5::Id& scene, const DatasetLayout& layout) {
  std::vector<std::string> names;
  std::vector<std::int64_t> every;
  for (const EpisodeChannel& channel : layout.channels()) {
    if (!channel.requested || channel.window == 1) continue;
    names.push_back(channel.name);
    every.push_back(layout.every / channel.window);
  }
  if (names.empty()) return;
  h5::write_attribute(scene, "windows", std::span<const std::string>(names));
  h5::write_list<std::int64_t>(scene, "window_every", every);
}

void describe_numbers(const h5::Id& scene, const DatasetLayout& layout) {
  const auto texts = [&](const char* name, const std::vector<std::string>& list) {
    h5::write_attribute(scene, name, std::span<const std::string>(list));
  };
  h5::write_attribute(scene, "quaternion_order", "w x y z");
  h5::write_attribute(scene, "observation_type", layout.single ? "float32" : "float64");
  describe_observations(scene, layout);
  describe_samples(scene, layout);
  describe_windows(scene, layout);
  texts("q_names", layout.q_names);
  texts("q_units", layout.q_units);
  texts("v_names", layout.v_names);
  texts("v_units", layout.v_units);
  texts("action_names", layout.action_names());
  texts("action_units", layout.action_units());
  if (!layout.randomized_names.empty()) {
    texts("randomized_names", layout.randomized_names);
    texts("randomized_units", layout.randomized_units);
  }
  if (!layout.gained.empty()) texts("picture_gain_names", picture_gain_names(layout.gained));
  h5::write_attribute(scene, "observation_scale", observation_scale(layout));
  h5::write_attribute(scene, "privileged", privileged_observations(layout));
  h5::write_attribute(scene, "actuated_joints", name_list(layout.actuated));
  h5::write_attribute(scene, "touch", touch_observations(layout));
  describe_task(scene, layout);
  if (!layout.task && !layout.end_effector_names.empty()) {
    texts("variable_names", layout.end_effector_names);
    h5::write_attribute(scene, "variable_units", "m");
    h5::write_attribute(scene, "variable_frame", "world");
  }
  const h5::Id sensors = h5::create_group(scene, "sensors");
  const std::vector<EpisodeChannel> channels = layout.channels();
  for (const SensorLayout& sensor : layout.sensors) {
    const h5::Id group = h5::create_group(sensors, sensor.name);
    h5::write_attributes(group, reading_attributes(sensor, FieldForm::field));
    for (const Table& table : point_tables(sensor, "")) h5::write_table(group, table);
    std::vector<std::string> readings, components;
    for (const EpisodeChannel& channel : channels) {
      const FieldOutput of = channel.reading;
      // The field of a scene's sensor has its name; of a task another observation may have it.
      if (channel.kind != EpisodeChannel::Kind::reading ||
          (of.form == FieldForm::field && !layout.task) || is_view(of.form) ||
          &layout.sensors[static_cast<std::size_t>(of.sensor)] != &sensor)
        continue;
      readings.push_back(channel.name);
      components.push_back(components_text(sensor, of.form));
    }
    for (const RunAttribute& fact : sensor.picture_facts)
      if (std::any_of(channels.begin(), channels.end(), [&](const EpisodeChannel& channel) {
            return channel.kind == EpisodeChannel::Kind::reading &&
                   is_picture(channel.reading.form) && !is_view(channel.reading.form) &&
                   &layout.sensors[static_cast<std::size_t>(channel.reading.sensor)] == &sensor;
          }))
        h5::write_attributes(group, {{"picture_" + fact.name, fact.value}});
    if (readings.empty()) continue;
    h5::write_attribute(group, "readings", std::span<const std::string>(readings));
    h5::write_attribute(group, "reading_components", std::span<const std::string>(components));
  }
  describe_cameras(scene, layout);
}

void describe_gradients(const h5::Id& scene, const DatasetLayout& layout) {
  if (layout.gradients.empty()) return;
  h5::write_attribute(scene, "gradients", layout.gradients_of);
  const h5::Id all = h5::create_group(scene, kGradients);
  for (const GradientArray& array : layout.gradients) {
    const h5::Id group = h5::create_group(all, array.name);
    h5::write_attribute(group, "meaning", array.meaning);
    h5::write_attribute(group, "rows", array.per_row ? kByRow : "one for the episode");
    if (array.wrt_names.empty()) continue;
    h5::write_attribute(group, "by_names", std::span<const std::string>(array.wrt_names));
    h5::write_attribute(group, "by_units", std::span<const std::string>(array.wrt_units));
  }
}

void add_attributes(const h5::Id& object, const std::string& prefix,
                    std::vector<Setting>& settings) {
  for (const std::string& name : h5::attribute_names(object))
    settings.push_back({prefix + name, h5::attribute_text(object, name)});
}

/// The first line in which two texts differ, shortened.
std::string line_of_difference(const std::string& there, const std::string& here) {
  std::istringstream a(there), b(here);
  for (int line = 1;; ++line) {
    std::string line_a, line_b;
    const bool more_a = static_cast<bool>(std::getline(a, line_a)),
               more_b = static_cast<bool>(std::getline(b, line_b));
    if (!more_a && !more_b) return "they differ in how they end";
    if (more_a == more_b && line_a == line_b) continue;
    return fmt::format("line {} is '{}' there, '{}' here", line, line_a.substr(0, kLongText),
                       line_b.substr(0, kLongText));
  }
}

/// FNV-1a.
std::uint64_t hash_text(std::uint64_t hash, const std::string& text) {
  for (const char c : text + '\0') hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
  return hash;
}

std::uint64_t hash_attributes(std::uint64_t hash, const h5::Id& object, const std::string& path) {
  for (const std::string& name : h5::attribute_names(object))
    hash = hash_text(hash_text(hash_text(hash, path), name), h5::attribute_text(object, name));
  return hash;
}

template <class T>
std::uint64_t hash_numbers(std::uint64_t hash, const h5::Id& dataset) {
  const h5::Dims dims = h5::dimensions(dataset);
  hsize_t file_bytes = 0;
  H5Fget_filesize(h5::Id(H5Iget_file_id(dataset.get())).get(), &file_bytes);
  double count = 1;
  for (const hsize_t size : dims) count *= static_cast<double>(size);
  if (count > static_cast<double>(file_bytes))
    throw IoError(fmt::format("{} claims {:.0f} numbers, and its file has {} bytes",
                              h5::place_of(dataset), count, file_bytes));
  std::vector<T> values(static_cast<std::size_t>(count));
  if (!values.empty()) h5::read_box(dataset, h5::Dims(dims.size(), 0), dims, values.data());
  return hash_text(hash, {reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)});
}

/// Attributes and, unless `said_alone`, numbers.
std::uint64_t hash_dataset(std::uint64_t hash, const h5::Id& dataset, const std::string& path,
                           bool said_alone) {
  hash = hash_attributes(hash, dataset, path);
  if (said_alone) return hash;
  const h5::Id type(H5Dget_type(dataset.get()));
  return H5Tget_class(type.get()) == H5T_INTEGER ? hash_numbers<std::int64_t>(hash, dataset)
                                                 : hash_numbers<double>(hash, dataset);
}

std::uint64_t hash_group(std::uint64_t hash, const h5::Id& group, const std::string& path,
                         bool said_alone, int depth = 1) {
  constexpr int kDeepest = 4;
  if (depth > kDeepest)
    throw IoError(fmt::format("{}: groups are nested deeper than {}", path, kDeepest));
  hash = hash_attributes(hash, group, path);
  for (const std::string& name : h5::link_names(group)) {
    const std::string inner = path + "/" + name;
    hash = h5::is_dataset(group, name)
               ? hash_dataset(hash, h5::open_dataset(group, name), inner, said_alone)
               : hash_group(hash, h5::open_group(group, name), inner, said_alone, depth + 1);
  }
  return hash;
}

constexpr const char *kTaken = "simulation_steps", *kTunnelled = "tunnelled_steps",
                     *kOverlapping = "overlapping_steps";

/// A count that a file may claim: sums over as many shards as there may be do not overflow.
std::int64_t stored_step_count(const h5::Id& file, const char* name, std::int64_t most) {
  const auto value = h5::read_number<std::int64_t>(file, name);
  if (value < 0 || value > most)
    throw IoError(
        fmt::format("'{}' of {} is {}; expected 0 to {}", name, h5::place_of(file), value, most));
  return value;
}

}  // namespace

void describe_dataset(const h5::Id& file, const DatasetLayout& layout) {
  h5::write_attribute(file, "format", kFormatName);
  h5::write_scalar<std::int64_t>(file, "format_version", kDatasetFormat);
  h5::write_scalar<std::int64_t>(file, "dataset_episodes", layout.episodes);
  h5::write_scalar<std::int64_t>(file, "dataset_shards", layout.shard_count());
  h5::write_attribute(file, "command", layout.command);
  const h5::Id scene = h5::create_group(file, "scene");
  describe_run(scene, layout);
  describe_numbers(scene, layout);
  describe_gradients(scene, layout);
}

std::uint64_t description_sum(const h5::Id& file) {
  const bool is_older = h5::read_number<std::int64_t>(file, "format_version") <= kUnlabelledFormat;
  std::uint64_t hash =
      hash_group(0xCBF29CE484222325ULL, h5::open_group(file, "scene"), "/scene", is_older);
  hash = hash_text(hash, h5::read_text(h5::open_group(file, "data"), "env_args"));
  if (is_older) return hash;
  for (const char* name :
       {"format", "format_version", "dataset_episodes", "dataset_shards", "command"})
    hash = hash_text(hash_text(hash, name), h5::attribute_text(file, name));
  return hash;
}

std::vector<Setting> settings_of(const DatasetLayout& layout) {
  const h5::Id file = h5::create_memory_file();
  describe_dataset(file, layout);
  return read_settings(file);
}

std::vector<Setting> read_settings(const h5::Id& file) {
  std::vector<Setting> settings;
  for (const char* name : {"format", "format_version", "dataset_episodes", "dataset_shards"})
    settings.push_back({name, h5::attribute_text(file, name)});
  const h5::Id scene = h5::open_group(file, "scene"), sensors = h5::open_group(scene, "sensors");
  add_attributes(scene, "", settings);
  for (const std::string& sensor : h5::link_names(sensors))
    add_attributes(h5::open_group(sensors, sensor), "sensors/" + sensor + "/", settings);
  if (!h5::has_link(scene, kGradients)) return settings;
  const h5::Id gradients = h5::open_group(scene, kGradients);
  for (const std::string& name : h5::link_names(gradients))
    add_attributes(h5::open_group(gradients, name), std::string(kGradients) + "/" + name + "/",
                   settings);
  return settings;
}

std::vector<std::string> differences(const std::vector<Setting>& there,
                                     const std::vector<Setting>& here) {
  const auto value_in = [](const std::vector<Setting>& list,
                           const std::string& name) -> const std::string* {
    const auto found =
        std::find_if(list.begin(), list.end(), [&](const Setting& s) { return s.name == name; });
    return found == list.end() ? nullptr : &found->value;
  };
  std::vector<std::string> lines;
  for (const Setting& setting : here) {
    const std::string* const other = value_in(there, setting.name);
    if (other == nullptr) {
      lines.push_back(fmt::format("{}: missing there", setting.name));
    } else if (*other != setting.value) {
      const bool is_long = std::max(other->size(), setting.value.size()) > kLongText;
      lines.push_back(
          is_long ? fmt::format("{}: {}", setting.name, line_of_difference(*other, setting.value))
                  : fmt::format("{}: {} there, {} here", setting.name, *other, setting.value));
    }
  }
  for (const Setting& setting : there)
    if (value_in(here, setting.name) == nullptr)
      lines.push_back(fmt::format("{}: missing here", setting.name));
  return lines;
}

std::vector<std::string> stored_touch(const h5::Id& scene) {
  const std::string text = h5::read_text(scene, "touch");
  if (const std::optional<std::vector<std::string>> names = names_in(text)) return *names;
  throw IoError(fmt::format("'touch' of /scene is {}; expected a JSON list of names", text));
}

std::vector<StoredSample> stored_samples(const h5::Id& scene, std::int64_t every,
                                         std::int64_t rows) {
  std::vector<StoredSample> list;
  if (H5Aexists(scene.get(), "samples") <= 0) return list;
  const std::vector<std::string> names = h5::read_texts(scene, "samples");
  const std::vector<std::int64_t> steps = h5::read_numbers<std::int64_t>(scene, "sample_every");
  if (steps.size() != names.size())
    throw IoError(
        fmt::format("its 'sample_every' has {} numbers; expected {}", steps.size(), names.size()));
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (steps[k] < 0 || steps[k] % every != 0)
      throw IoError(fmt::format("its '{}' is sampled every {} steps; expected a multiple of {}",
                                names[k], steps[k], every));
    const OutputTimes times{steps[k] / every, steps[k] == 0};
    list.push_back({names[k], times, times.before(rows + 1, rows)});
  }
  return list;
}

std::vector<StoredWindow> stored_windows(const h5::Id& scene, std::int64_t every) {
  std::vector<StoredWindow> list;
  if (H5Aexists(scene.get(), "windows") <= 0) return list;
  const std::vector<std::string> names = h5::read_texts(scene, "windows"),
                                 stored = h5::read_texts(scene, "observations");
  const std::vector<std::int64_t> steps = h5::read_numbers<std::int64_t>(scene, "window_every");
  if (steps.size() != names.size())
    throw IoError(
        fmt::format("its 'window_every' has {} numbers; expected {}", steps.size(), names.size()));
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (steps[k] < 1 || steps[k] >= every || every % steps[k] != 0)
      throw IoError(fmt::format("its '{}' is read every {} steps; expected a divisor of {}",
                                names[k], steps[k], every));
    if (std::find(stored.begin(), stored.end(), names[k]) == stored.end())
      throw IoError(fmt::format("its 'windows' name '{}'; expected stored observations", names[k]));
    list.push_back({names[k], every / steps[k]});
  }
  return list;
}

std::vector<StoredGradient> stored_gradients(const h5::Id& scene) {
  std::vector<StoredGradient> list;
  if (!h5::has_link(scene, kGradients)) return list;
  const h5::Id all = h5::open_group(scene, kGradients);
  for (const std::string& name : h5::link_names(all)) {
    const h5::Id one = h5::open_group(all, name);
    list.push_back({name, h5::read_text(one, "meaning"), h5::read_text(one, "rows") == kByRow});
  }
  return list;
}

void write_steps(const h5::Id& file, const EpisodeSteps& steps) {
  h5::write_scalar<std::int64_t>(file, kTaken, steps.taken);
  h5::write_scalar<std::int64_t>(file, kTunnelled, steps.tunnelled);
  h5::write_scalar<std::int64_t>(file, kOverlapping, steps.overlapping);
}

std::optional<EpisodeSteps> stored_steps(const h5::Id& file) {
  if (H5Aexists(file.get(), kTaken) <= 0) return {};
  EpisodeSteps steps;
  steps.taken =
      stored_step_count(file, kTaken, std::numeric_limits<std::int64_t>::max() / kMostShards);
  // Shards of earlier programs have another name for it.
  const char* const tunnelled =
      H5Aexists(file.get(), "passed_steps") > 0 ? "passed_steps" : kTunnelled;
  steps.tunnelled = stored_step_count(file, tunnelled, steps.taken);
  steps.overlapping = stored_step_count(file, kOverlapping, steps.taken - steps.tunnelled);
  return steps;
}

void add_steps(std::optional<EpisodeSteps>& sum, const std::optional<EpisodeSteps>& more) {
  if (sum && more)
    *sum += *more;
  else
    sum.reset();
}

std::vector<std::int64_t> demo_numbers(const h5::Id& data) {
  std::vector<std::int64_t> numbers;
  for (const std::string& name : h5::link_names(data)) {
    std::int64_t number = -1;
    const char* const end = name.data() + name.size();
    constexpr std::string_view kBegin = "demo_";
    if (!name.starts_with(kBegin)) continue;
    const auto [at, error] = std::from_chars(name.data() + kBegin.size(), end, number);
    if (error == std::errc() && at == end && number >= 0) numbers.push_back(number);
  }
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

}  // namespace tangere
