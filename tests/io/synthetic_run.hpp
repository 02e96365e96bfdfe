// SPDX-License-Identifier: Apache-2.0
// A run without the engine, in which every number encodes its own place.
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

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
  [[nodiscard]] std::string operator/(const std::string& name) const {
    return (path_ / name).string();
  }
  [[nodiscard]] std::size_t entries() const {
    return static_cast<std::size_t>(std::distance(std::filesystem::directory_iterator(path_), {}));
  }

 private:
  std::filesystem::path path_;
};

/// Two environments, one joint of 3 dofs, one body, a 3 × 4 sensor read every second step.
inline TrajectoryLayout layout(std::int64_t steps = 5) {
  TrajectoryLayout l;
  l.steps = steps;
  l.environments = 2;
  l.q_names = l.v_names = {"a.x", "a.y", "a.z"};
  l.q_units = {"m", "m", "m"};
  l.v_units = {"m/s", "m/s", "m/s"};
  l.u_names = {"a.x"};
  l.u_units = {"1"};
  l.body_names = {"box"};
  SensorLayout s;
  s.name = "skin";
  s.body = "box";
  s.rows = 3;
  s.cols = 4;
  s.points = 12;
  s.every = 2;
  s.pressure_sign = -1;
  s.corner0 = {0, 0, 0};
  s.corner1 = {0.002, 0.003, 0};
  s.axis0 = {1, 0, 0};
  s.axis1 = {0, 1, 0};
  l.sensors = {s};
  l.fields = {{0}};
  l.statuses = {{0, "converged"}, {-1, "not converged"}};
  l.randomized_names = {"joint a q[0]"};
  l.randomized_units = {"m"};
  l.randomized_values = {0.25, 0.75};
  l.scene_name = "synthetic";
  l.scene_path = "s.xml";
  l.scene_text = "<tangere/>";
  l.integrator = "BDF2";
  l.timestep = 0.01;
  l.tolerance = 1e-9;
  l.every = 2;
  l.seed = 18446744073709551615ULL;
  l.precision = "double";
  l.command_line = "tangere simulate s.xml";
  l.version = "0.1.0";
  l.instruction_set = "scalar";
  return l;
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

inline void write_run(RowSink& sink, const TrajectoryLayout& l, double force = 1e-3) {
  for (std::int64_t t = 0; t <= l.steps; ++t) {
    const auto q = numbers(1, t, 6), v = numbers(2, t, 6), pose = numbers(3, t, 14),
               twist = numbers(4, t, 12);
    const auto end_effectors = numbers(7, t, 2 * 3 * l.end_effector_names.size());
    sink.write(StateRow{t, double(t) * l.timestep, q, v, pose, twist, end_effectors});
    if (t == l.steps) break;
    const auto u = numbers(5, t, 2), residual = numbers(6, t, 2);
    const std::vector<std::int32_t> iterations = {static_cast<std::int32_t>(t), 7};
    const std::vector<std::int8_t> status = {0, -1};
    sink.write(StepRow{t, u, iterations, status, residual});
    if ((t + 1) % 2 == 0) {
      const auto f = field((t + 1) / 2 - 1, force);
      sink.write(TactileRow{{0}, (t + 1) / 2 - 1, t + 1, f});
    }
  }
}

}  // namespace tangere::testing
