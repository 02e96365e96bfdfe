// SPDX-License-Identifier: Apache-2.0
// Everything that a trajectory file says besides its numbers. It is known before the first step.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene/field_form.hpp"
#include "engine/scene/scene.hpp"
#include "engine/step/shear_state_arrays.hpp"
#include "io/trajectory/run_facts.hpp"

namespace tangere {

/// A tactile sensor as files describe it.
struct SensorLayout {
  std::string name;
  std::string body;
  int rows = 0, cols = 0;  ///< of a rectangular array, points row-major; both 0 for a list
  int points = 0;          ///< rows * cols for a rectangular array
  int every = 1;  ///< K: fields are read after steps K, 2K, … of the first run of a chain
  ContactLaw law = ContactLaw::clamped;  ///< decides the unit of its damping
  int pressure_sign = 1;  ///< times the third force component: positive under pressure
  /// Rectangular arrays: p(i, j) = corner0 + i pitch0 axis0 + j pitch1 axis1, body frame [m].
  std::array<double, 3> corner0{}, corner1{};
  std::array<double, 3> axis0{}, axis1{};  ///< unit, orthogonal

  std::string imperfections;       ///< text_of() those of the sensor; "": none
  std::vector<TactilePoint> list;  ///< a list of points in the field's order; empty for arrays

  [[nodiscard]] bool rectangular() const { return rows > 0; }
  /// {pitch0, pitch1} [m]; negative when the corners run against an axis, 0 for a single row.
  [[nodiscard]] std::array<double, 2> pitch() const;
};

/// Returns the shape of one reading: {rows, cols, components}, {points, components} or {6}.
std::vector<std::uint64_t> reading_shape(const SensorLayout& sensor, FieldForm form);

/// A value of /solver/status and what it means.
struct StatusMeaning {
  std::int8_t value = 0;
  std::string meaning;
};

/// A trajectory has no names of end effectors where it does not record them.
struct TrajectoryLayout : RunFacts {
  std::int64_t steps = 0;               ///< T
  std::int64_t first_step = 0;          ///< steps before row 0, from runs that this one continues
  int environments = 1;                 ///< E
  std::vector<std::string> body_names;  ///< (nb) recorded, empty when no poses are
  ShearStateArrays memory;              ///< what friction remembers; no points: it is not recorded
  std::vector<std::string> trees;       ///< that may sleep, each by its first body; none: no sleep
  /// At which rows q and v, bodies, end effectors and memory are recorded; none: at all. Where
  /// `states` are given, there are no controls, and of the solver's numbers the status alone.
  OutputTimes states = {}, of_bodies = {}, of_end_effectors = {}, of_memory = {};
  std::vector<SensorLayout> sensors;
  std::vector<FieldOutput> fields;  ///< what is recorded of them; without times: every K steps
  bool audit = false;               ///< the books are recorded
  std::vector<StatusMeaning> statuses;
  std::vector<double> randomized_values;  ///< (E, k)

  std::string scene_path, command_line;
  int every = 0;  ///< the option as given; 0: each sensor's own interval
  std::int64_t first_episode = 0;
  std::string policy;  ///< of a task

  /// Rows of q, bodies or end effectors that are taken at these times.
  [[nodiscard]] std::int64_t rows(const OutputTimes& times) const {
    return times.before(steps + 1, steps, first_step);
  }
  /// When a reading is taken, and how many the file has.
  [[nodiscard]] OutputTimes times_of(const FieldOutput& of) const;
  [[nodiscard]] std::int64_t frames(const FieldOutput& of) const;

  /// Throws InputError when counts contradict each other or a sensor cannot be a name in a file.
  void check() const;
  /// Size without compression of everything except the tactile fields, and of everything [bytes].
  /// Throws InputError when the size exceeds 2^63.
  [[nodiscard]] std::uint64_t bytes_without_tactile() const;
  [[nodiscard]] std::uint64_t bytes() const;
};

}  // namespace tangere
