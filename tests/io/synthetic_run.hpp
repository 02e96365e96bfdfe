// SPDX-License-Identifier: Apache-2.0
// A run without the engine, in which every number encodes its own place.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "engine/rows/sensor_layout.hpp"
#include "io/trajectory/trajectory_file.hpp"

namespace tangere::testing {

/// A folder of its own, removed at the end.
class Folder {
 public:
  Folder() {
    std::string name = (std::filesystem::temp_directory_path() / "tangere-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) std::abort();
    path_ = name;
  }
  ~Folder() {
    std::error_code ignored;
    std::filesystem::permissions(path_, std::filesystem::perms::owner_all, ignored);
    std::filesystem::remove_all(path_, ignored);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  [[nodiscard]] std::string path() const { return path_.string(); }
  [[nodiscard]] std::string operator/(const std::string& name) const {
    return (path_ / name).string();
  }
  [[nodiscard]] std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path_), {}));
  }

 private:
  std::filesystem::path path_;
};

/// A 3 × 4 array of points on 2 × 3 mm.
inline SensorLayout skin() {
  SensorLayout s;
  s.name = "skin";
  s.body = "box";
  s.rows = 3;
  s.cols = 4;
  s.points = 12;
  s.pressure_sign = -1;
  s.corner1 = {0.002, 0.003, 0};
  s.axis0 = {1, 0, 0};
  s.axis1 = {0, 1, 0};
  return s;
}

/// Adds fields of a sensor, read every second step of two environments.
inline void add_sensor(Recording& recording, const SensorLayout& sensor, std::int64_t steps) {
  const std::string group = "tactile/" + sensor.name + "/";
  Channel field{.name = group + "force", .shape = {2}, .rows = steps / 2};
  for (const std::uint64_t n : reading_shape(sensor, FieldForm::field)) field.shape.push_back(n);
  field.more = reading_attributes(sensor, FieldForm::field);
  field.more.push_back({"every", std::int64_t{2}});
  field.storage = Channel::Storage::per_environment;
  recording.channels.push_back(field);
  recording.channels.push_back(
      {.name = group + "step", .type = NumberType::int64, .shape = {}, .rows = steps / 2});
}

/// Two environments, one joint of 3 dofs, one body, a 3 × 4 sensor read every second step.
inline Recording recording(std::int64_t steps = 5,
                           const std::vector<std::string>& end_effectors = {},
                           const std::vector<SensorLayout>& sensors = {skin()}) {
  Recording r;
  r.facts = {{"command_line", "tangere simulate s.xml"},
             {"environments", std::int64_t{2}},
             {"first_episode", std::int64_t{0}},
             {"first_step", std::int64_t{0}},
             {"instruction_set", "scalar"},
             {"integrator", "BDF2"},
             {"precision", "double"},
             {"quaternion_order", "w x y z"},
             {"scene_name", "synthetic"},
             {"scene_path", "s.xml"},
             {"scene_text", "<tangere/>"},
             {"seed", std::uint64_t{18446744073709551615ULL}},
             {"steps", steps},
             {"tangere_version", "0.1.0"},
             {"timestep", 0.01},
             {"tolerance", 1e-9}};
  const std::vector<std::string> names = {"a.x", "a.y", "a.z"};
  r.channels = {
      {.name = "time", .shape = {}, .rows = steps + 1, .units = {"s"}},
      {.name = "q", .shape = {2, 3}, .rows = steps + 1, .names = names, .units = {"m", "m", "m"}},
      {.name = "v",
       .shape = {2, 3},
       .rows = steps + 1,
       .names = names,
       .units = {"m/s", "m/s", "m/s"}},
      {.name = "bodies/pose",
       .shape = {2, 1, 7},
       .rows = steps + 1,
       .names = {"x", "y", "z", "qw", "qx", "qy", "qz"},
       .units = {"m", "m", "m", "1", "1", "1", "1"}},
      {.name = "bodies/twist",
       .shape = {2, 1, 6},
       .rows = steps + 1,
       .names = {"wx", "wy", "wz", "vx", "vy", "vz"},
       .units = {"rad/s", "rad/s", "rad/s", "m/s", "m/s", "m/s"}}};
  if (!end_effectors.empty())
    r.channels.push_back({.name = "variables/position",
                          .shape = {2, end_effectors.size(), 3},
                          .rows = steps + 1,
                          .names = end_effectors,
                          .units = {"m"},
                          .frame = "world"});
  const std::vector<Channel> of_steps = {
      {.name = "u", .shape = {2, 1}, .rows = steps, .names = {"a.x"}, .units = {"1"}},
      {.name = "solver/iterations", .type = NumberType::int32, .shape = {2}, .rows = steps},
      {.name = "solver/status", .type = NumberType::int8, .shape = {2}, .rows = steps},
      {.name = "solver/residual", .shape = {2}, .rows = steps}};
  r.channels.insert(r.channels.end(), of_steps.begin(), of_steps.end());
  for (const SensorLayout& sensor : sensors) add_sensor(r, sensor, steps);
  r.tables = {
      {{.name = "randomized", .shape = {1}, .rows = 2, .names = {"joint a q[0]"}, .units = {"m"}},
       std::vector<double>{0.25, 0.75}}};
  for (const SensorLayout& sensor : sensors)
    for (Table& table : point_tables(sensor, "tactile/" + sensor.name + "/"))
      r.tables.push_back(std::move(table));
  return r;
}

inline double number(int kind, std::int64_t row, std::size_t k) {
  return 1000.0 * kind + 10.0 * double(row) + 0.001 * double(k);
}

inline std::vector<double> numbers(int kind, std::int64_t row, std::size_t count) {
  std::vector<double> x(count);
  for (std::size_t k = 0; k < count; ++k) x[k] = number(kind, row, k);
  return x;
}

/// Field of frame f, environment e: pressure only at (1, 2), shear along axis1 there.
inline std::vector<double> field(std::int64_t frame, double force) {
  std::vector<double> x(2 * 12 * 3, 0.0);
  for (std::size_t e = 0; e < 2; ++e) {
    double* p = &x[(e * 12 + 1 * 4 + 2) * 3];
    p[1] = 0.5 * force;
    p[2] = -force * double(frame + 1);
  }
  return x;
}

/// Writes all rows of a recording. Channel k has the numbers of kind k.
inline void write_run(RowSink& sink, const Recording& recording, double force = 1e-3) {
  const std::int64_t steps = recording.channels.at(0).rows - 1;
  for (std::int64_t t = 0; t <= steps; ++t)
    for (std::size_t k = 0; k < recording.channels.size(); ++k) {
      const Channel& channel = recording.channels[k];
      const bool of_states = channel.rows > steps, of_sensor = channel.name.starts_with("tactile/");
      if (of_sensor ? t == 0 || t % 2 != 0 : t == 0 && !of_states) continue;
      const std::int64_t row = of_states ? t : t - 1;
      const std::vector<std::int32_t> iterations = {static_cast<std::int32_t>(row), 7};
      const std::vector<std::int8_t> status = {0, -1};
      const double time = double(t) * 0.01;
      if (channel.name == "time")
        sink.write(t, k, std::span(&time, 1));
      else if (channel.type == NumberType::int32)
        sink.write(t, k, std::span(iterations));
      else if (channel.type == NumberType::int8)
        sink.write(t, k, std::span(status));
      else if (channel.type == NumberType::int64)
        sink.write(t, k, std::span<const std::int64_t>(&t, 1));
      else
        sink.write(t, k,
                   std::span<const double>(of_sensor ? field(t / 2 - 1, force)
                                                     : numbers(int(k), row, channel.width())));
    }
}

}  // namespace tangere::testing
