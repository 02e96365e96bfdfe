// SPDX-License-Identifier: Apache-2.0
// Refuses what the layer would not compute, and chooses its cells.
#include "engine/model/sensor_layer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>

#include "engine/base/error.hpp"
#include "engine/model/compiled_layer.hpp"
#include "engine/model/lateral_spread.hpp"
#include "engine/scene/frames.hpp"
#include "engine/scene/skin_material.hpp"

namespace tangere {
namespace {

constexpr double kUsualCell = 0.2;      // of the thickness
constexpr double kLeastCell = 0.75;     // of the points' distance
constexpr double kMostPitch = 1.0 / 3;  // of the points, by the thickness
constexpr double kRounding = 1e-9;      // relative, of a pitch
constexpr double kThickest = 4;         // thickness by the pad's longer side
constexpr double kLeastWidth = 0.5;     // of a gel with sides, by the thickness
constexpr double kMostSurface = 256e6;  // of the surface's compliance [bytes]
constexpr double kMostMargin = 6;       // by the thickness; sides farther away have no effect

[[noreturn]] void fail(const TactileDescription& d, const std::string& message) {
  if (d.table) throw InputError(d.source.prefix() + "pressure of '" + d.name + "': " + message);
  throw InputError(d.layer->source.prefix() + "<layer> of '" + d.name + "': " + message);
}

/// Refuses sensors that read springs alone.
void check_sensor(const TactileDescription& d, const CompiledSensor& sensor) {
  if (!d.points.empty()) fail(d, "points in a list; expected a flat array, type=\"rect_array\"");
  if (sensor.past_states() > 0)
    fail(d, "delay, low_pass or hysteresis; expected a sensor without them");
}

/// Distances of neighbouring points of an array, from row to row and from column to column [m].
std::array<double, 2> distances(const RectArray& array) {
  const std::array<double, 2> along = pitches(array);
  return {std::abs(along[0]), std::abs(along[1])};
}

/// Returns the points of a cell's side: as many as come nearest to its size.
int cell_side(const TactileDescription& d, double pitch) {
  const double size = d.layer->cell > 0 ? d.layer->cell : kUsualCell * d.material->thickness;
  if (d.layer->cell > 0 && !(size >= kLeastCell * pitch))
    fail(d, fmt::format("cell=\"{}\"; expected at least the distance of the points, {:.3g} m", size,
                        pitch));
  const int least = std::min(d.array.rows, d.array.cols);
  if (!(size <= least * pitch))
    fail(d, fmt::format("cells of {:.3g} m; expected at most the pad's shorter side, {:.3g} m",
                        size, least * pitch));
  return std::max(1, static_cast<int>(std::lround(size / pitch)));
}

/// Refuses free sides that are so near to each other that images of images would count: the
/// compliance would not be positive definite.
void check_sides(const TactileDescription& d, const LayerGrid& grid) {
  if (!grid.margin) return;
  const double least = std::min(grid.height * grid.rows, grid.width * grid.cols) + 2 * *grid.margin;
  if (!(least >= kLeastWidth * grid.thickness))
    fail(d, fmt::format(
                "free sides {:.3g} m apart; expected at least half the thickness, {:.3g} m, or "
                "no margin",
                least, kLeastWidth * grid.thickness));
}

std::optional<double> margin_of(const TactileDescription& d) {
  if (!d.layer->margin) return std::nullopt;
  return std::min(*d.layer->margin, kMostMargin * d.material->thickness);
}

}  // namespace

std::shared_ptr<const CompiledLayer> compile_pressure_table(const TactileDescription& d,
                                                            const CompiledSensor& sensor,
                                                            int pressure_sign) {
  check_sensor(d, sensor);
  const auto [height, width] = distances(d.array);
  auto law = std::make_shared<CompiledLayer>();
  law->table.emplace(d.table->depth, d.table->pressure);
  law->modulus = 1;
  law->area = height * width;
  law->stiffness = d.coefficients.kn > 0 ? d.coefficients.kn : d.table->stiffness() * law->area;
  law->relaxation = d.table->relaxation;
  law->deepest = d.table->thickness > 0 ? d.table->thickness : 2 * d.table->depth.back();
  law->outward = pressure_sign;
  return law;
}

std::shared_ptr<const CompiledLayer> compile_sensor_layer(const TactileDescription& d,
                                                          const CompiledSensor& sensor,
                                                          int pressure_sign) {
  check_sensor(d, sensor);
  if (!d.material) fail(d, "no material; expected modulus and thickness");
  const auto [height, width] = distances(d.array);
  const double t = d.material->thickness, pitch = std::max(height, width);
  if (!(pitch <= kMostPitch * t * (1 + kRounding)))
    fail(d,
         fmt::format("points {:.3g} m apart; expected at most a third of the thickness, {:.3g} m",
                     pitch, kMostPitch * t));
  const double longer = std::max(height * d.array.rows, width * d.array.cols);
  if (!(t <= kThickest * longer))
    fail(d, fmt::format("thickness of {:.3g} m; expected at most {} times the pad's longer side, "
                        "{:.3g} m",
                        t, kThickest, kThickest * longer));
  auto layer = std::make_shared<CompiledLayer>();
  layer->side = cell_side(d, std::sqrt(height * width));
  const auto cells = [&](int points) { return (points + layer->side - 1) / layer->side; };
  layer->grid = {
      cells(sensor.rows), cells(sensor.cols), layer->side * height, layer->side * width, t,
      d.layer->poisson,   margin_of(d)};
  if (layer->grid.cells() > kMostLayerCells)
    fail(d, fmt::format("{} × {} cells; expected at most {} of them: a larger cell",
                        layer->grid.rows, layer->grid.cols, kMostLayerCells));
  check_sides(d, layer->grid);
  for (int i = 0; i < sensor.points(); ++i)
    layer->cell_of_point.push_back(i / sensor.cols / layer->side * layer->grid.cols +
                                   i % sensor.cols / layer->side);
  layer->weights = cell_weights(layer->grid, layer->side, sensor.rows, sensor.cols);
  layer->compliance = compile_layer(layer->grid);
  static std::atomic<std::uint64_t> compiled_layers{0};
  layer->number = ++compiled_layers;
  layer->modulus = d.material->modulus;
  layer->feedback = d.layer->feedback;
  layer->load_control = d.layer->load_control;
  if (layer->feedback && layer->load_control)
    fail(d,
         "load=\"contact\" and feedback, whose loads are the contact's already; expected one of "
         "them");
  layer->stiffness =
      d.coefficients.kn > 0 ? d.coefficients.kn : skin_springs(*d.material).kn * height * width;
  layer->relaxation = d.material->relaxation;
  layer->area = height * width;
  layer->deepest = t;
  layer->outward = pressure_sign;
  for (std::size_t k = 0; k < 2; ++k) layer->direction[k] = pitches(d.array)[k] < 0 ? -1 : 1;
  if (d.markers || d.picture) {
    if (const double bytes = SurfaceCompliance::bytes(layer->grid); !(bytes <= kMostSurface))
      fail(d, fmt::format(
                  "the surface of {} × {} cells takes {:.0f} MB; expected at most {:.0f}: larger "
                  "cells, or the longer side along the rows",
                  layer->grid.rows, layer->grid.cols, bytes / 1e6, kMostSurface / 1e6));
    layer->surface.emplace(layer->grid);
  }
  return layer;
}

std::vector<int> load_contacts(const CompiledModel& m, const CompiledSensor& sensor) {
  const TactileDescription& d = m.scene.sensors[std::size_t(sensor.number)];
  std::vector<int> contacts;
  for (const int target : sensor.targets) {
    for (std::size_t k = 0; k < m.pairs.size(); ++k) {
      const kernels::PairContact& pair = m.pairs[k];
      if (!(pair.body1 == sensor.body && pair.body2 == target) &&
          !(pair.body2 == sensor.body && pair.body1 == target))
        continue;
      if (pair.layer_pad >= 0)
        fail(d, fmt::format("load=\"contact\", but '{}' and '{}' touch by the layer of another "
                            "sensor, '{}'; expected springs",
                            d.body, m.scene.links[std::size_t(target)].body.name,
                            m.scene.pair_contacts[k].sensor));
      contacts.push_back(static_cast<int>(k));
    }
  }
  return contacts;
}

void check_layer_contacts(const CompiledModel& m, const CompiledSensor& sensor) {
  const TactileDescription& d = m.scene.sensors[std::size_t(sensor.number)];
  for (const int target : sensor.targets) {
    bool touched = false;
    for (std::size_t k = 0; k < m.pairs.size(); ++k)
      touched =
          touched || (m.scene.pair_contacts[k].sensor == d.name && m.pairs[k].body2 == target);
    if (!touched)
      fail(d, fmt::format("feedback, but no contact with '{}', which it senses; expected the "
                          "contacts of add_sensor_contacts()",
                          m.scene.links[std::size_t(target)].body.name));
  }
}

}  // namespace tangere
