// SPDX-License-Identifier: Apache-2.0
// Sizes of readings: points of a field, pixels of a picture or channels.
#include "engine/model/model_info.hpp"

namespace tangere {

std::size_t numbers_of(const SensorInfo& sensor, FieldForm form) {
  if (form == FieldForm::channels) return static_cast<std::size_t>(sensor.channels);
  const int places = is_picture(form) ? sensor.picture[0] * sensor.picture[1] : sensor.points;
  return numbers_of(places, form);
}

std::vector<std::size_t> reading_shape(const SensorInfo& sensor, FieldForm form) {
  const auto components = static_cast<std::size_t>(components_of(form));
  const auto grid = [&](int rows, int cols) {
    return std::vector{static_cast<std::size_t>(rows), static_cast<std::size_t>(cols), components};
  };
  if (form == FieldForm::sum || form == FieldForm::channels) return {numbers_of(sensor, form)};
  if (is_picture(form)) return grid(sensor.picture[0], sensor.picture[1]);
  if (sensor.rows > 0) return grid(sensor.rows, sensor.cols);
  return {static_cast<std::size_t>(sensor.points), components};
}

}  // namespace tangere
