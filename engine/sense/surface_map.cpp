// SPDX-License-Identifier: Apache-2.0
// Components change their signs between the field's axes and those of the cells: rows may count
// against axis0, and a pressing force points into the layer.
#include "engine/sense/surface_map.hpp"

#include <algorithm>
#include <vector>

#include "engine/model/compiled_layer.hpp"

namespace tangere {
namespace {

/// Scratch of a thread: tractions and displacements of cells, (3, cells).
struct Cells {
  std::vector<double> traction, displacement;

  void resize(const CompiledLayer& layer) {
    const auto numbers = 3 * static_cast<std::size_t>(layer.grid.cells());
    traction.assign(numbers, 0.0), displacement.assign(numbers, 0.0);
  }
};

Cells& scratch(const CompiledLayer& layer) {
  thread_local Cells cells;
  cells.resize(layer);
  return cells;
}

/// Signs of (axis0, axis1, out of the layer) by the axes of the cells.
std::array<double, 3> signs(const CompiledLayer& layer) {
  return {double(layer.direction[0]), double(layer.direction[1]), 1};
}

/// Factors of a point's force in the traction of its cell, at E = 1 [1/m²].
std::array<double, 3> traction_factors(const CompiledLayer& layer) {
  const double scale = 1 / (layer.side * layer.side * layer.area * layer.modulus);
  const std::array<double, 3> sign = signs(layer);
  return {sign[0] * scale, sign[1] * scale, -layer.outward * scale};
}

void add_tractions(const CompiledLayer& layer, std::span<const double> field,
                   std::vector<double>& traction) {
  const auto cells = static_cast<std::size_t>(layer.grid.cells());
  const std::array<double, 3> factor = traction_factors(layer);
  for (std::size_t s = 0; s < layer.cell_of_point.size(); ++s)
    for (std::size_t a = 0; a < 3; ++a)
      traction[a * cells + std::size_t(layer.cell_of_point[s])] += factor[a] * field[3 * s + a];
}

}  // namespace

void SurfaceMap::displace(std::span<const double> field, std::span<double> displacement) const {
  const CompiledLayer& layer = *sensor_->layer;
  const auto cells = static_cast<std::size_t>(layer.grid.cells());
  Cells& of = scratch(layer);
  add_tractions(layer, field, of.traction);
  layer.surface->displace(of.traction, of.displacement);
  const std::array<double, 3> sign = signs(layer);
  for (std::size_t s = 0; s < layer.weights.size(); ++s)
    for (std::size_t a = 0; a < 3; ++a) {
      const CellWeights& w = layer.weights[s];
      double sum = 0;
      for (std::size_t k = 0; k < w.cell.size(); ++k)
        sum += w.weight[k] * of.displacement[a * cells + std::size_t(w.cell[k])];
      displacement[3 * s + a] = sign[a] * sum;
    }
}

void SurfaceMap::pull_back(std::span<const double> field, std::span<const double> displacement_bar,
                           std::span<double> field_bar) const {
  const CompiledLayer& layer = *sensor_->layer;
  const auto cells = static_cast<std::size_t>(layer.grid.cells());
  Cells& of = scratch(layer);
  add_tractions(layer, field, of.traction);
  const std::array<double, 3> sign = signs(layer), factor = traction_factors(layer);
  for (std::size_t s = 0; s < layer.weights.size(); ++s)
    for (std::size_t a = 0; a < 3; ++a) {
      const CellWeights& w = layer.weights[s];
      for (std::size_t k = 0; k < w.cell.size(); ++k)
        of.displacement[a * cells + std::size_t(w.cell[k])] +=
            w.weight[k] * sign[a] * displacement_bar[3 * s + a];
    }
  thread_local std::vector<double> traction_bar;
  traction_bar.resize(3 * cells);
  layer.surface->pull_back(of.traction, of.displacement, traction_bar);
  for (std::size_t s = 0; s < layer.cell_of_point.size(); ++s)
    for (std::size_t a = 0; a < 3; ++a)
      field_bar[3 * s + a] +=
          factor[a] * traction_bar[a * cells + std::size_t(layer.cell_of_point[s])];
}

}  // namespace tangere
