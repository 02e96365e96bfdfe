// SPDX-License-Identifier: Apache-2.0
// Points do not depend on each other, so the derivative is a slope for each.
#include "engine/sense/table_pressure.hpp"

namespace tangere {

void TablePressure::solve(const CompiledLayer& layer, std::span<const double> depth,
                          double factor) {
  pressure_.assign(depth.size(), 0.0);
  slope_.assign(depth.size(), 0.0);
  for (std::size_t s = 0; s < depth.size(); ++s) {
    if (!(depth[s] > 0)) continue;
    const MonotoneCubic::Point at = layer.table->at(depth[s]);
    pressure_[s] = factor * at.value;
    slope_[s] = factor * at.slope;
  }
}

void TablePressure::pull_back(std::span<const double> pressure_bar,
                              std::span<double> depth_bar) const {
  for (std::size_t s = 0; s < slope_.size(); ++s) depth_bar[s] = slope_[s] * pressure_bar[s];
}

void TablePressure::push_forward(std::span<const double> depth_dot,
                                 std::span<double> pressure_dot) const {
  for (std::size_t s = 0; s < slope_.size(); ++s) pressure_dot[s] = slope_[s] * depth_dot[s];
}

}  // namespace tangere
