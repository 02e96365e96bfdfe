// SPDX-License-Identifier: Apache-2.0
// Checks and sizes of a layout. This file does not need the engine, so readers and tests do not
// either.
#include "io/trajectory/trajectory_layout.hpp"

#include <fmt/format.h>

#include <limits>
#include <set>

namespace tangere {
namespace {

/// A sum of products that reports when it exceeds 2^63 instead of wrapping.
class Bytes {
 public:
  void add(std::initializer_list<std::int64_t> factors) {
    std::int64_t product = 1;
    for (const std::int64_t factor : factors)
      overflow_ = __builtin_mul_overflow(product, factor, &product) || overflow_;
    overflow_ = __builtin_add_overflow(sum_, product, &sum_) || overflow_;
  }
  [[nodiscard]] std::uint64_t sum(const TrajectoryLayout& layout) const {
    if (overflow_)
      throw InputError(fmt::format("{} steps of {} environments need more than 2^63 bytes",
                                   layout.steps, layout.environments));
    return static_cast<std::uint64_t>(sum_);
  }

 private:
  std::int64_t sum_ = 0;
  bool overflow_ = false;
};

std::int64_t count_of(const auto& list) { return static_cast<std::int64_t>(list.size()); }

void add_small(const TrajectoryLayout& layout, Bytes& bytes) {
  const std::int64_t t = layout.steps, e = layout.environments;
  constexpr std::int64_t kPoseAndTwist = 13;
  const auto add_rows = [&](const OutputTimes& times, std::int64_t width) {
    bytes.add({layout.rows(times), e, width, 8});
    if (times.given()) bytes.add({layout.rows(times), 8});  // which they are
  };
  bytes.add({layout.rows(layout.states), 8});
  add_rows(layout.states, count_of(layout.q_names) + count_of(layout.v_names));
  if (!layout.body_names.empty())
    add_rows(layout.of_bodies, kPoseAndTwist * count_of(layout.body_names));
  if (!layout.end_effector_names.empty())
    add_rows(layout.of_end_effectors, 3 * count_of(layout.end_effector_names));
  if (layout.audit) {
    constexpr std::int64_t kOfRow = 9, kOfStep = 3;
    bytes.add({t, e, kOfRow + kOfStep, 8});
    bytes.add({e, kOfRow, 8});
  }
  if (layout.states.given()) {
    bytes.add({layout.rows(layout.states), e});  // status
  } else {
    bytes.add({t, e, count_of(layout.u_names), 8});
    bytes.add({t, e, 8 + 4 + 1});  // residual, iterations, status
  }
  bytes.add({e, count_of(layout.randomized_names), 8});
  for (const FieldOutput& of : layout.fields) bytes.add({layout.frames(of), 8});
  if (layout.memory.count() > 0) bytes.add({layout.rows(layout.of_memory), 8});
}

void check_sensor(const SensorLayout& sensor, std::set<std::string>& names) {
  const std::string& name = sensor.name;
  if (name.empty() || name == "." || name.find('/') != std::string::npos)
    throw InputError(fmt::format(
        "sensor '{}': a dataset cannot have this name; expected one without '/'", name));
  if (!names.insert(name).second) throw InputError(fmt::format("two sensors named '{}'", name));
  if (sensor.every < 1)
    throw InputError(
        fmt::format("sensor '{}': every = {}, expected at least 1", name, sensor.every));
  if (sensor.pressure_sign != 1 && sensor.pressure_sign != -1)
    throw InputError(fmt::format("sensor '{}': pressure_sign = {}, expected 1 or -1", name,
                                 sensor.pressure_sign));
  const bool fits = sensor.rectangular() ? std::int64_t{sensor.rows} * sensor.cols == sensor.points
                                         : sensor.rows == 0 && sensor.cols == 0;
  if (!fits || sensor.points < 1)
    throw InputError(fmt::format("sensor '{}': {} points in {} rows of {}", name, sensor.points,
                                 sensor.rows, sensor.cols));
}

}  // namespace

std::vector<std::uint64_t> reading_shape(const SensorLayout& sensor, FieldForm form) {
  if (form == FieldForm::sum) return {numbers_of(sensor.points, form)};
  const auto components = static_cast<std::uint64_t>(components_of(form));
  if (!sensor.rectangular()) return {static_cast<std::uint64_t>(sensor.points), components};
  return {static_cast<std::uint64_t>(sensor.rows), static_cast<std::uint64_t>(sensor.cols),
          components};
}

std::array<double, 2> SensorLayout::pitch() const {
  double along0 = 0, along1 = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    along0 += (corner1[k] - corner0[k]) * axis0[k];
    along1 += (corner1[k] - corner0[k]) * axis1[k];
  }
  return {rows > 1 ? along0 / (rows - 1) : 0.0, cols > 1 ? along1 / (cols - 1) : 0.0};
}

OutputTimes TrajectoryLayout::times_of(const FieldOutput& of) const {
  if (of.times.given()) return of.times;
  return {sensors[static_cast<std::size_t>(of.sensor)].every};
}

std::int64_t TrajectoryLayout::frames(const FieldOutput& of) const {
  const OutputTimes times = times_of(of);
  return times.before(steps + 1, steps, first_step) - times.before(1, steps, first_step);
}

void TrajectoryLayout::check() const {
  const auto same = [](const char* what, std::size_t names, std::size_t units) {
    if (names != units)
      throw InputError(fmt::format("{} names and {} units for {}", names, units, what));
  };
  if (steps < 0) throw InputError(fmt::format("{} steps, expected 0 or more", steps));
  if (first_step < 0)
    throw InputError(fmt::format("first step {}, expected 0 or more", first_step));
  if (environments < 1)
    throw InputError(fmt::format("{} environments, expected at least 1", environments));
  same("q", q_names.size(), q_units.size());
  same("v", v_names.size(), v_units.size());
  same("u", u_names.size(), u_units.size());
  same("what varies", randomized_names.size(), randomized_units.size());
  if (randomized_values.size() != randomized_names.size() * std::size_t(environments))
    throw InputError(fmt::format("{} randomised values, expected {} for each of {} environments",
                                 randomized_values.size(), randomized_names.size(), environments));
  std::set<std::string> names;
  for (const SensorLayout& sensor : sensors) check_sensor(sensor, names);
  check_outputs(fields, sensors.size());
  static_cast<void>(bytes());
}

std::uint64_t TrajectoryLayout::bytes_without_tactile() const {
  Bytes sum;
  add_small(*this, sum);
  return sum.sum(*this);
}

std::uint64_t TrajectoryLayout::bytes() const {
  Bytes sum;
  add_small(*this, sum);
  sum.add({rows(of_memory), environments, count_of(memory.row_of), 3 * 8});
  for (const FieldOutput of : fields) {
    const SensorLayout& sensor = sensors[static_cast<std::size_t>(of.sensor)];
    sum.add({frames(of), environments,
             static_cast<std::int64_t>(numbers_of(sensor.points, of.form)), 8});
  }
  return sum.sum(*this);
}

}  // namespace tangere
