// SPDX-License-Identifier: Apache-2.0
// Everything is created before the first step, so that a run cannot fail late for a reason known
// early.
#include "io/trajectory/trajectory_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <vector>

#include "engine/derivative/tactile_point_numbers.hpp"
#include "io/files/part_file.hpp"
#include "io/hdf5/h5.hpp"
#include "io/trajectory/memory_rows.hpp"
#include "io/trajectory/sensor_description.hpp"
#include "io/trajectory/sleep_rows.hpp"

namespace tangere {

namespace {

constexpr std::int64_t kFormatVersion = 5;
constexpr hsize_t kChunkBytes = 1U << 20;

/// A chunk has whole rows, about a megabyte.
h5::Storage rows_of(const h5::Dims& dims, std::size_t element) {
  hsize_t row = element;
  for (std::size_t i = 1; i < dims.size(); ++i) row *= dims[i];
  if (dims[0] * row <= kChunkBytes) return {};  // small: one contiguous piece
  h5::Dims chunk = dims;
  chunk[0] = std::clamp<hsize_t>(kChunkBytes / row, 1, dims[0]);
  // A row of very many environments is cut between environments.
  if (row > kChunkBytes && dims.size() > 1) {
    const hsize_t environment = row / dims[1];
    chunk[1] = std::clamp<hsize_t>(kChunkBytes / environment, 1, dims[1]);
  }
  return {chunk, false};
}

/// A chunk has one environment's field. It is compressed because it is mostly zeros.
h5::Storage field_storage(const h5::Dims& dims) {
  h5::Dims chunk = dims;
  chunk[0] = chunk[1] = 1;
  return {chunk, true};
}

const char* const kPoseComponents[] = {"x", "y", "z", "qw", "qx", "qy", "qz"};
const char* const kTwistComponents[] = {"wx", "wy", "wz", "vx", "vy", "vz"};

}  // namespace

struct TrajectoryFile::Impl {
  TrajectoryLayout layout;
  PartFile part;
  h5::Id file, time, q, v, u, pose, twist, end_effectors, iterations, status, residual;
  h5::Id state_step, body_step, end_effector_step;  // of rows that are taken at times of their own
  struct Reading {
    h5::Id numbers, step;
    h5::Dims frame;  // dimensions of one row
    std::int64_t written = 0;
  };
  std::vector<Reading> readings;  // parallel to layout.fields
  struct Task {
    h5::Id action, step, reward, terminated, truncated, success;
  } task;
  struct Audit {
    h5::Id energy, momentum, step;
    std::int64_t written = 0;
  } audit;
  std::optional<MemoryRows> memory;
  std::optional<SleepRows> sleep;
  std::int64_t states = 0, steps = 0, actions = 0, poses = 0, positions = 0;

  Impl(const std::string& output, const TrajectoryLayout& l, bool overwrite)
      : layout((l.check(), l)), part(output, overwrite) {
    const std::uint64_t needed = layout.bytes_without_tactile(), available = part.free_bytes();
    if (needed > available)
      throw IoError(fmt::format("{}: needs at least {} bytes and the disk has {} free", output,
                                needed, available));
    file = h5::create_file(part.path(), part.written());
    describe_run();
    create_trajectory();
    for (const FieldOutput of : layout.fields) create_reading(of);
    if (layout.memory.count() > 0) memory.emplace(file, layout);
    if (!layout.trees.empty()) sleep.emplace(file, layout);
    create_randomized();
    create_task();
  }

  template <class T>
  h5::Id rows(const h5::Id& parent, const std::string& name, h5::Dims dims) {
    return h5::create_dataset<T>(parent, name, dims, rows_of(dims, sizeof(T)));
  }

  /// A dataset for each sensor from (E, points of all, kPointNumbers).
  void put_points(const h5::Id& gradients, std::span<const double> of_all) {
    const h5::Id group = h5::create_group(gradients, "grad_points");
    h5::write_attribute(group, "meaning",
                        "derivative of the loss by each tactile point's place in its body's axes "
                        "and its own coefficients");
    const hsize_t E = static_cast<hsize_t>(layout.environments);
    const double* next = of_all.data();
    for (const SensorLayout& s : layout.sensors) {
      const hsize_t points = static_cast<hsize_t>(s.points);
      const h5::Id dataset = rows<double>(group, s.name, {E, points, kPointNumbers});
      std::vector<std::string> names, units;
      for (int k = 0; k < kPointNumbers; ++k) {
        names.emplace_back(point_number_name(k));
        units.emplace_back(point_number_unit(k, s.law));
      }
      h5::write_attribute(dataset, "names", std::span<const std::string>(names));
      h5::write_attribute(dataset, "units", std::span<const std::string>(units));
      for (hsize_t e = 0; e < E; ++e)
        h5::write_box<double>(dataset, {e, 0, 0}, {1, points, kPointNumbers},
                              next + e * (of_all.size() / E));
      next += points * kPointNumbers;
    }
  }

  void describe_run() {
    h5::write_attribute(file, "format", "tangere trajectory");
    h5::write_scalar<std::int64_t>(file, "format_version", kFormatVersion);
    h5::write_attribute(file, "tangere_version", layout.version);
    h5::write_attribute(file, "instruction_set", layout.instruction_set);
    h5::write_attribute(file, "precision", layout.precision);
    h5::write_attribute(file, "command_line", layout.command_line);
    h5::write_attribute(file, "scene_name", layout.scene_name);
    h5::write_attribute(file, "scene_path", layout.scene_path);
    h5::write_attribute(file, "scene_text", layout.scene_text);
    h5::write_attribute(file, "integrator", layout.integrator);
    h5::write_scalar<double>(file, "timestep", layout.timestep);
    h5::write_attribute(file, "timestep_unit", "s");
    h5::write_scalar<double>(file, "tolerance", layout.tolerance);
    h5::write_scalar<double>(file, "accuracy", layout.accuracy);
    if (layout.sleep > 0) h5::write_scalar<double>(file, "sleep", layout.sleep);
    h5::write_scalar<std::int64_t>(file, "every", layout.every);
    h5::write_scalar<std::uint64_t>(file, "seed", layout.seed);
    h5::write_scalar<std::int64_t>(file, "first_episode", layout.first_episode);
    h5::write_scalar<std::int64_t>(file, "steps", layout.steps);
    h5::write_scalar<std::int64_t>(file, "first_step", layout.first_step);
    h5::write_scalar<std::int64_t>(file, "environments", layout.environments);
    h5::write_attribute(file, "quaternion_order", "w x y z");
    h5::write_attribute(file, "world_axes", "right-handed, SI units");
  }

  /// Rows of what is taken at these times, and for times of its own a list of them.
  [[nodiscard]] hsize_t row_count(const OutputTimes& times) const {
    return static_cast<hsize_t>(layout.rows(times));
  }
  h5::Id create_steps(const h5::Id& group, const OutputTimes& times) const {
    if (!times.given()) return {};
    h5::Id d = h5::create_dataset<std::int64_t>(group, "step", {row_count(times)});
    h5::write_attribute(d, "meaning", "steps of this run before each row");
    return d;
  }
  /// Row of the datasets that are taken at these times, and its number in the list of them.
  [[nodiscard]] std::int64_t put_step(const h5::Id& steps_of, const OutputTimes& times,
                                      std::int64_t t) const {
    const std::int64_t row = times.before(t, layout.steps, layout.first_step);
    if (times.given()) h5::write_box<std::int64_t>(steps_of, {static_cast<hsize_t>(row)}, {1}, &t);
    return row;
  }

  void create_trajectory() {
    const hsize_t T = static_cast<hsize_t>(layout.steps), R = row_count(layout.states),
                  E = static_cast<hsize_t>(layout.environments);
    const auto named = [](const h5::Id& d, const std::vector<std::string>& names,
                          const std::vector<std::string>& units) {
      h5::write_attribute(d, "names", std::span<const std::string>(names));
      h5::write_attribute(d, "units", std::span<const std::string>(units));
    };
    time = rows<double>(file, "time", {R});
    h5::write_attribute(time, "units", "s");
    q = rows<double>(file, "q", {R, E, layout.q_names.size()});
    named(q, layout.q_names, layout.q_units);
    h5::write_attribute(q, "frame",
                        "each joint's fixed frame; quaternions turn the moving frame into it");
    v = rows<double>(file, "v", {R, E, layout.v_names.size()});
    named(v, layout.v_names, layout.v_units);
    h5::write_attribute(
        v, "frame", "linear: axes of the joint's fixed frame; angular: axes of the moving frame");
    state_step = create_steps(file, layout.states);
    if (has_controls()) {
      u = rows<double>(file, "u", {T, E, layout.u_names.size()});
      named(u, layout.u_names, layout.u_units);
      h5::write_attribute(u, "meaning",
                          "as given; clipped to [-1, 1], then mapped to the motor's range");
    }
    if (!layout.body_names.empty()) create_bodies(named);
    if (!layout.end_effector_names.empty()) create_end_effectors();
    create_solver();
    if (layout.audit) create_audit(named);
  }

  [[nodiscard]] bool has_controls() const {
    return !layout.u_names.empty() && !layout.states.given();
  }

  void create_bodies(const auto& named) {
    const hsize_t R = row_count(layout.of_bodies), E = static_cast<hsize_t>(layout.environments);
    const h5::Id bodies = h5::create_group(file, "bodies");
    h5::write_attribute(bodies, "names", std::span<const std::string>(layout.body_names));
    const hsize_t nb = layout.body_names.size();
    pose = rows<double>(bodies, "pose", {R, E, nb, 7});
    const std::vector<std::string> pose_names(std::begin(kPoseComponents),
                                              std::end(kPoseComponents));
    named(pose, pose_names, {"m", "m", "m", "1", "1", "1", "1"});
    h5::write_attribute(pose, "frame", "body frame in the world");
    twist = rows<double>(bodies, "twist", {R, E, nb, 6});
    const std::vector<std::string> twist_names(std::begin(kTwistComponents),
                                               std::end(kTwistComponents));
    named(twist, twist_names, {"rad/s", "rad/s", "rad/s", "m/s", "m/s", "m/s"});
    h5::write_attribute(twist, "frame", "world axes; velocity of the body frame's origin");
    for (const h5::Id* d : {&pose, &twist})
      h5::write_attribute(*d, "bodies", std::span<const std::string>(layout.body_names));
    body_step = create_steps(bodies, layout.of_bodies);
  }

  void create_end_effectors() {
    const hsize_t R = row_count(layout.of_end_effectors),
                  E = static_cast<hsize_t>(layout.environments);
    const h5::Id group = h5::create_group(file, "variables");
    end_effector_step = create_steps(group, layout.of_end_effectors);
    end_effectors = rows<double>(group, "position", {R, E, layout.end_effector_names.size(), 3});
    h5::write_attribute(end_effectors, "names",
                        std::span<const std::string>(layout.end_effector_names));
    h5::write_attribute(end_effectors, "units", "m");
    h5::write_attribute(end_effectors, "frame", "world");
  }

  void create_audit(const auto& named) {
    const hsize_t T = static_cast<hsize_t>(layout.steps),
                  E = static_cast<hsize_t>(layout.environments);
    const h5::Id group = h5::create_group(file, "audit");
    audit.energy = rows<double>(group, "energy", {T + 1, E, 3});
    named(audit.energy, {"motion", "height", "held"}, {"J", "J", "J"});
    h5::write_attribute(audit.energy, "meaning",
                        "of moving bodies; -m gravity.x; by springs, limits and contacts");
    audit.momentum = rows<double>(group, "momentum", {T + 1, E, 6});
    named(audit.momentum, {"x", "y", "z", "about_x", "about_y", "about_z"},
          {"kg m/s", "kg m/s", "kg m/s", "kg m^2/s", "kg m^2/s", "kg m^2/s"});
    h5::write_attribute(audit.momentum, "frame", "world; angular about its origin");
    audit.step = rows<double>(group, "step", {T, E, 3});
    named(audit.step, {"motors", "taken", "made"}, {"J", "J", "J"});
    h5::write_attribute(audit.step, "meaning",
                        "work of the motors; what damping and friction took; what the scheme made: "
                        "the change of energy less the first, plus the second");
  }

  void create_solver() {
    const hsize_t T = static_cast<hsize_t>(layout.steps),
                  E = static_cast<hsize_t>(layout.environments);
    const bool all = !layout.states.given();
    const h5::Id solver = h5::create_group(file, "solver");
    if (all) {
      iterations = rows<std::int32_t>(solver, "iterations", {T, E});
      h5::write_attribute(iterations, "meaning", "evaluations of the residual, sub-steps included");
    }
    status = rows<std::int8_t>(solver, "status", {all ? T : row_count(layout.states), E});
    if (!all)
      h5::write_attribute(status, "meaning", "of the step that ends at each row of /q; 0 at row 0");
    std::vector<std::string> meanings;
    std::vector<std::int8_t> values;
    for (const StatusMeaning& s : layout.statuses)
      values.push_back(s.value), meanings.push_back(s.meaning);
    h5::write_list<std::int8_t>(status, "values", values);
    h5::write_attribute(status, "meanings", std::span<const std::string>(meanings));
    if (!all) return;
    residual = rows<double>(solver, "residual", {T, E});
    h5::write_attribute(residual, "meaning", "scaled residual at acceptance, dimensionless");
  }

  void create_reading(FieldOutput of) {
    const SensorLayout& s = layout.sensors[std::size_t(of.sensor)];
    const hsize_t E = static_cast<hsize_t>(layout.environments),
                  F = static_cast<hsize_t>(layout.frames(of));
    if (!h5::has_link(file, "tactile")) h5::create_group(file, "tactile");
    const h5::Id tactile = h5::open_group(file, "tactile");
    const bool first = !h5::has_link(tactile, s.name);
    const h5::Id group =
        first ? h5::create_group(tactile, s.name) : h5::open_group(tactile, s.name);
    Reading out;
    const std::vector<std::uint64_t> shape = reading_shape(s, of.form);
    out.frame.assign(shape.begin(), shape.end());
    out.frame.insert(out.frame.begin(), E);
    h5::Dims dims = out.frame;
    dims.insert(dims.begin(), F);
    const h5::Storage storage = of.form == FieldForm::sum ? rows_of(dims, sizeof(double))
                                : F > 0                   ? field_storage(dims)
                                                          : h5::Storage{};
    const std::string name = dataset_of(of.form);
    out.numbers = h5::create_dataset<double>(group, name, dims, storage);
    // Readings of a sensor share their list of steps, unless they are taken at other times.
    const OutputTimes times = layout.times_of(of);
    const auto same = std::find_if(layout.fields.begin(), layout.fields.end(),
                                   [&](const FieldOutput& f) { return f.sensor == of.sensor; });
    if (first || times != layout.times_of(*same)) {
      out.step = h5::create_dataset<std::int64_t>(group, first ? "step" : name + "_step", {F});
      h5::write_attribute(out.step, "meaning",
                          layout.states.given() ? "steps of this run before each field"
                                                : "row of /q that each field was read from");
    }
    if (first) describe_points(group, s);
    h5::write_scalar<std::int64_t>(out.numbers, "every",
                                   times.final ? layout.first_step + layout.steps : times.every);
    describe_reading(out.numbers, s, of.form);
    readings.push_back(std::move(out));
  }

  void create_randomized() {
    if (layout.randomized_names.empty()) return;
    const hsize_t E = static_cast<hsize_t>(layout.environments), k = layout.randomized_names.size();
    const h5::Id d = h5::create_dataset<double>(file, "randomized", {E, k});
    h5::write_attribute(d, "names", std::span<const std::string>(layout.randomized_names));
    h5::write_attribute(d, "units", std::span<const std::string>(layout.randomized_units));
    h5::write_box<double>(d, {0, 0}, {E, k}, layout.randomized_values.data());
  }

  void create_task() {
    if (!layout.task) {
      h5::write_attribute(file, "task", "none: a scene alone, whose every reward is 0");
      return;
    }
    const TaskSpec& spec = *layout.task;
    h5::write_attribute(file, "task", spec.name);
    h5::write_attribute(file, "policy", layout.policy);
    const hsize_t E = static_cast<hsize_t>(layout.environments),
                  A = static_cast<hsize_t>(spec.horizon);
    const h5::Id group = h5::create_group(file, "task");
    h5::write_attribute(group, "success", spec.success);
    task.action = rows<double>(group, "action", {A, E, spec.action.size()});
    h5::write_attribute(task.action, "unit", spec.action.unit);
    h5::write_attribute(task.action, "meaning", spec.action.meaning);
    task.step = h5::create_dataset<std::int64_t>(group, "step", {A});
    h5::write_attribute(task.step, "meaning",
                        layout.states.given() ? "steps of this run before the end of each action"
                                              : "row of /q after each action");
    task.reward = rows<double>(group, "reward", {A, E});
    task.terminated = rows<std::int8_t>(group, "terminated", {A, E});
    task.truncated = rows<std::int8_t>(group, "truncated", {A, E});
    task.success = rows<std::int8_t>(group, "success", {A, E});
  }

  void expect_numbers(const char* of, std::int64_t row, std::size_t found, hsize_t expected) const {
    if (found != expected)
      throw IoError(fmt::format("{}: row {} has {} numbers of {}; expected {}", part.output(), row,
                                found, of, expected));
  }

  /// Row `at` of a dataset whose other dimensions are `row`.
  template <class T>
  static void put(const h5::Id& d, std::int64_t at, h5::Dims row, const T* data) {
    h5::Dims offset(row.size() + 1, 0);
    offset[0] = static_cast<hsize_t>(at);
    row.insert(row.begin(), 1);
    h5::write_box<T>(d, offset, row, data);
  }
};

TrajectoryFile::TrajectoryFile(const std::string& output, const TrajectoryLayout& layout,
                               bool overwrite)
    : impl_(std::make_unique<Impl>(output, layout, overwrite)) {}
TrajectoryFile::~TrajectoryFile() = default;

void TrajectoryFile::write(const StateRow& row) {
  Impl& f = *impl_;
  const TrajectoryLayout& l = f.layout;
  const hsize_t E = static_cast<hsize_t>(l.environments), nb = l.body_names.size(),
                n = l.end_effector_names.size();
  const std::int64_t t = row.step;
  const auto due = [&](const OutputTimes& times) { return times.at(t, l.steps, l.first_step); };
  if (due(l.states)) {
    const std::int64_t at = f.put_step(f.state_step, l.states, t);
    const hsize_t one = 1;
    f.expect_numbers("q and v", t, row.q.size() + row.v.size(),
                     E * (l.q_names.size() + l.v_names.size()));
    h5::write_box<double>(f.time, {static_cast<hsize_t>(at)}, {one}, &row.time);
    Impl::put<double>(f.q, at, {E, l.q_names.size()}, row.q.data());
    Impl::put<double>(f.v, at, {E, l.v_names.size()}, row.v.data());
    ++f.states;
  }
  const bool bodies = due(l.of_bodies), end_effectors = due(l.of_end_effectors);
  f.expect_numbers("poses and twists", t, row.body_pose.size() + row.body_twist.size(),
                   bodies ? E * nb * 13 : 0);
  if (nb > 0 && bodies) {
    const std::int64_t at = f.put_step(f.body_step, l.of_bodies, t);
    Impl::put<double>(f.pose, at, {E, nb, 7}, row.body_pose.data());
    Impl::put<double>(f.twist, at, {E, nb, 6}, row.body_twist.data());
    ++f.poses;
  }
  if (n > 0 && end_effectors) {
    f.expect_numbers("end effectors", t, row.end_effectors.size(), E * n * 3);
    const std::int64_t at = f.put_step(f.end_effector_step, l.of_end_effectors, t);
    Impl::put<double>(f.end_effectors, at, {E, n, 3}, row.end_effectors.data());
    ++f.positions;
  }
}

void TrajectoryFile::write(const StepRow& row) {
  Impl& f = *impl_;
  const TrajectoryLayout& l = f.layout;
  const hsize_t E = static_cast<hsize_t>(l.environments);
  ++f.steps;
  if (l.states.given()) {
    Impl::put<std::int8_t>(f.status, l.states.before(row.step + 1, l.steps, l.first_step), {E},
                           row.status.data());
    return;
  }
  if (f.has_controls()) Impl::put<double>(f.u, row.step, {E, l.u_names.size()}, row.u.data());
  Impl::put<std::int32_t>(f.iterations, row.step, {E}, row.iterations.data());
  Impl::put<std::int8_t>(f.status, row.step, {E}, row.status.data());
  Impl::put<double>(f.residual, row.step, {E}, row.residual.data());
}

void TrajectoryFile::write(const TactileRow& row) {
  const std::vector<FieldOutput>& fields = impl_->layout.fields;
  const auto at = std::find(fields.begin(), fields.end(), row.output);
  if (at == fields.end())
    throw IoError(fmt::format("{}: row {} has the {} of sensor {}, which its layout lacks",
                              impl_->part.output(), row.step, to_string(row.output.form),
                              row.output.sensor));
  Impl::Reading& r = impl_->readings[std::size_t(at - fields.begin())];
  hsize_t numbers = 1;
  for (const hsize_t n : r.frame) numbers *= n;
  impl_->expect_numbers("a reading", row.step, row.numbers.size(), numbers);
  Impl::put<double>(r.numbers, row.frame, r.frame, row.numbers.data());
  if (r.step.get() >= 0)  // once for all readings of a sensor at the same steps
    h5::write_box<std::int64_t>(r.step, {static_cast<hsize_t>(row.frame)}, {1}, &row.step);
  ++r.written;
}

void TrajectoryFile::write(const ActionRow& row) {
  Impl& f = *impl_;
  const hsize_t E = static_cast<hsize_t>(f.layout.environments);
  Impl::put<double>(f.task.action, row.action, {E, f.layout.task->action.size()}, row.u.data());
  h5::write_box<std::int64_t>(f.task.step, {static_cast<hsize_t>(row.action)}, {1}, &row.step);
  Impl::put<double>(f.task.reward, row.action, {E}, row.reward.data());
  const auto flags = [&](const h5::Id& dataset, std::span<const std::uint8_t> values) {
    const std::vector<std::int8_t> flags_of(values.begin(), values.end());
    Impl::put<std::int8_t>(dataset, row.action, {E}, flags_of.data());
  };
  flags(f.task.terminated, row.terminated);
  flags(f.task.truncated, row.truncated);
  flags(f.task.success, row.success);
  ++f.actions;
}

void TrajectoryFile::write(const AuditRow& row) {
  Impl& f = *impl_;
  const hsize_t E = static_cast<hsize_t>(f.layout.environments);
  Impl::put<double>(f.audit.energy, row.step, {E, 3}, row.energy.data());
  Impl::put<double>(f.audit.momentum, row.step, {E, 6}, row.momentum.data());
  if (!row.passed.empty()) Impl::put<double>(f.audit.step, row.step - 1, {E, 3}, row.passed.data());
  ++f.audit.written;
}

void TrajectoryFile::write(const MemoryRow& row) {
  if (impl_->memory) impl_->memory->write(row);
}

void TrajectoryFile::write(const SleepRow& row) {
  if (impl_->sleep) impl_->sleep->write(row);
}

void TrajectoryFile::write(const GradientArrays& g) {
  const TrajectoryLayout& l = impl_->layout;
  const hsize_t E = static_cast<hsize_t>(l.environments), T = static_cast<hsize_t>(l.steps),
                nv = l.v_names.size(), nu = l.u_names.size();
  const h5::Id group = h5::create_group(impl_->file, "gradients");
  h5::write_attribute(group, "loss", g.loss);
  h5::write_attribute(group, "meaning", g.meaning);
  const auto put = [&](const std::string& name, const h5::Dims& dims,
                       std::span<const double> values, const std::string& meaning,
                       std::span<const std::string> names) {
    const h5::Id d = h5::create_dataset<double>(group, name, dims, rows_of(dims, sizeof(double)));
    h5::write_attribute(d, "meaning", meaning);
    if (!names.empty()) h5::write_attribute(d, "names", names);
    if (!values.empty()) h5::write_box<double>(d, h5::Dims(dims.size(), 0), dims, values.data());
  };
  put("loss", {E}, g.value, "the loss of each environment", {});
  if (nu > 0)
    put("grad_u", {E, T, nu}, g.u, "derivative of the loss by the controls of every step",
        l.u_names);
  put("grad_q", {E, nv}, g.q,
      "by the initial positions, along the dofs of v; rotations on the right", l.v_names);
  put("grad_v", {E, nv}, g.v, "by the initial velocities", l.v_names);
  put("grad_numbers", {E, g.number_names.size()}, g.numbers,
      "by the numbers of the scene, in the units given", g.number_names);
  const h5::Id numbers = h5::open_dataset(group, "grad_numbers");
  h5::write_attribute(numbers, "units", g.number_units);
  if (!g.points.empty()) impl_->put_points(group, g.points);
}

void TrajectoryFile::commit() {
  Impl& f = *impl_;
  const auto expect = [&](const std::string& what, std::int64_t written, std::int64_t expected) {
    if (written != expected)
      throw IoError(fmt::format("{}: {} {} of {} were written; the file is incomplete",
                                f.part.output(), written, what, expected));
  };
  const TrajectoryLayout& l = f.layout;
  expect("states", f.states, l.rows(l.states));
  expect("poses", f.poses, l.body_names.empty() ? 0 : l.rows(l.of_bodies));
  expect("end effectors", f.positions,
         l.end_effector_names.empty() ? 0 : l.rows(l.of_end_effectors));
  const bool at_start = l.states.given() && l.states.at(0, l.steps, l.first_step);
  expect("steps", f.steps, l.states.given() ? l.rows(l.states) - (at_start ? 1 : 0) : l.steps);
  expect("actions", f.actions, f.layout.task ? f.layout.task->horizon : 0);
  expect("memories", f.memory ? f.memory->written() : 0, f.memory ? l.rows(l.of_memory) : 0);
  expect("rows of sleep", f.sleep ? f.sleep->written() : 0, f.sleep ? l.rows(l.states) : 0);
  expect("audits", f.audit.written, f.layout.audit ? f.layout.steps + 1 : 0);
  for (std::size_t i = 0; i < f.readings.size(); ++i) {
    const SensorLayout& sensor = f.layout.sensors[std::size_t(f.layout.fields[i].sensor)];
    expect("fields of " + sensor.name, f.readings[i].written, l.frames(l.fields[i]));
  }
  for (h5::Id* d : {&f.time, &f.q, &f.v, &f.u, &f.pose, &f.twist, &f.end_effectors, &f.iterations,
                    &f.status, &f.residual, &f.state_step, &f.body_step, &f.end_effector_step})
    d->reset();
  f.readings.clear();
  f.task = {};
  f.audit = {};
  f.memory.reset();
  f.sleep.reset();
  h5::close_file(f.file, f.part.path());
  f.part.commit();
}

}  // namespace tangere
