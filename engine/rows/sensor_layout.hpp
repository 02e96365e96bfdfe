// SPDX-License-Identifier: Apache-2.0
// A tactile sensor as files describe it, and its readings as channels.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/model/model.hpp"
#include "engine/rows/channel.hpp"
#include "engine/scene/field_form.hpp"

namespace tangere {

struct SensorLayout {
  std::string name;
  std::string body;
  int rows = 0, cols = 0;        ///< of a rectangular array, points row-major; both 0 for a list
  int points = 0;                ///< rows * cols for a rectangular array
  std::array<int, 2> picture{};  ///< pixels down and across of its pictures; 0: it has none
  int channels = 0;              ///< of its hardware; 0: it has none
  int every = 1;          ///< K: fields are read after steps K, 2K, … of the first run of a chain
  int pressure_sign = 1;  ///< times the third force component: positive under pressure
  /// Rectangular arrays: p(i, j) = corner0 + i pitch0 axis0 + j pitch1 axis1, body frame [m].
  std::array<double, 3> corner0{}, corner1{};
  std::array<double, 3> axis0{}, axis1{};  ///< unit, orthogonal

  std::string imperfections;       ///< text_of() those of the sensor; "": none
  Attributes picture_facts;        ///< of its pictures: the gel, metres a pixel, flaws
  Attributes channel_facts;        ///< of its channels: unit, names, their map, flaws
  std::vector<TactilePoint> list;  ///< a list of points in the field's order; empty for arrays

  [[nodiscard]] bool rectangular() const { return rows > 0; }
  /// {pitch0, pitch1} [m]; negative when the corners run against an axis, 0 for a single row.
  [[nodiscard]] std::array<double, 2> pitch() const;
};

/// Describes a sensor of a model. `every`: SensorLayout::every.
SensorLayout sensor_layout(const SensorInfo& info, const TactileDescription& description,
                           int every);

/// Throws InputError when a sensor's name cannot be a name in a file.
void check_sensor_name(const std::string& name);

/// Returns the shape of one reading: {rows, cols, components}, {points, components}, {height,
/// width, components} of a picture, {channels} or {6}.
std::vector<std::uint64_t> reading_shape(const SensorLayout& sensor, FieldForm form);
/// Returns the name of a reading's dataset in a trajectory: "force" for a field, else the form's.
const char* dataset_of(FieldForm form);
/// Returns the unit of a reading: "N", "m", "1", "N, N, N, m, m, m", that of the channels' map.
std::string unit_text(const SensorLayout& sensor, FieldForm form);
/// Describes the components of a reading: "f.axis0, f.axis1; f is the force on the body".
std::string components_text(const SensorLayout& sensor, FieldForm form);

/// Returns units, body, pressure_sign, components, frame, imperfections and, for a rectangular
/// array, its place. Of a picture: units, body, components and picture_facts.
/// Of channels: body, components and channel_facts.
Attributes reading_attributes(const SensorLayout& sensor, FieldForm form);
/// For a list of points, returns position, normal, axis0, axis1 (points, 3) and, if they have an
/// image, pixel (points, 2). `group`: stands before their names.
std::vector<Table> point_tables(const SensorLayout& sensor, const std::string& group);

}  // namespace tangere
