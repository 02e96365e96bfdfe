// SPDX-License-Identifier: Apache-2.0
#include "engine/model/sensor_layer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/error.hpp"
#include "engine/model/compiled_layer.hpp"
#include "engine/scene/frames.hpp"

namespace tangere {
namespace {

constexpr double kUsualCell = 0.2;      // of the thickness
constexpr double kMostPitch = 1.0 / 3;  // of the points, by the thickness

[[noreturn]] void fail(const TactileDescription& d, const std::string& message) {
  throw InputError(d.layer->source.prefix() + "<layer> of '" + d.name + "': " + message);
}

/// Returns the points of a cell's side: as many as come nearest to its size.
int side_of(const TactileDescription& d, double pitch) {
  const double size = d.layer->cell > 0 ? d.layer->cell : kUsualCell * d.material->thickness;
  return std::max(1, static_cast<int>(std::lround(size / pitch)));
}

}  // namespace

std::shared_ptr<const CompiledLayer> compile_sensor_layer(const TactileDescription& d,
                                                          const CompiledSensor& sensor,
                                                          int pressure_sign) {
  if (!d.points.empty()) fail(d, "points in a list; expected a flat array, type=\"rect_array\"");
  if (!d.material) fail(d, "no material; expected modulus and thickness");
  if (sensor.past_states() > 0)
    fail(d, "delay, low_pass or hysteresis; expected a sensor without them");
  const Vector3 way = d.array.corner1 - d.array.corner0;
  const double height = std::abs(dot(way, d.array.axis0)) / (d.array.rows - 1),
               width = std::abs(dot(way, d.array.axis1)) / (d.array.cols - 1);
  const double t = d.material->thickness, pitch = std::max(height, width);
  if (!(pitch <= kMostPitch * t))
    fail(d,
         fmt::format("points {:.3g} m apart; expected at most a third of the thickness, {:.3g} m",
                     pitch, kMostPitch * t));
  auto layer = std::make_shared<CompiledLayer>();
  layer->side = side_of(d, std::sqrt(height * width));
  const auto cells = [&](int points) { return (points + layer->side - 1) / layer->side; };
  layer->grid = {
      cells(sensor.rows), cells(sensor.cols), layer->side * height, layer->side * width, t,
      d.layer->poisson,   d.layer->margin};
  if (layer->grid.cells() > kMostLayerCells)
    fail(d, fmt::format("{} × {} cells; expected at most {} of them: a larger cell",
                        layer->grid.rows, layer->grid.cols, kMostLayerCells));
  for (int i = 0; i < sensor.points(); ++i)
    layer->cell_of_point.push_back(i / sensor.cols / layer->side * layer->grid.cols +
                                   i % sensor.cols / layer->side);
  layer->compliance = compile_layer(layer->grid);
  layer->modulus = d.material->modulus;
  layer->stiffness = d.coefficients.kn;
  layer->relaxation = d.material->relaxation;
  layer->area = height * width;
  layer->outward = pressure_sign;
  return layer;
}

}  // namespace tangere
