// SPDX-License-Identifier: Apache-2.0
// Where a sensor's points are among those of a block.
#include "engine/derivative/block_cotangent.hpp"

#include "engine/derivative/tactile_point_numbers.hpp"
#include "kernels/step/model_view.hpp"

namespace tangere {

using kernels::kBlock;

std::span<double> BlockCotangent::points_of(const Model& model, int sensor, int lane) {
  if (points.empty()) return {};
  const auto size = [](int n) { return std::size_t(n) * std::size_t(kPointNumbers); };
  return std::span(points)
      .subspan(points.size() / kBlock * std::size_t(lane))
      .subspan(size(first_tactile_point(model, sensor)),
               size(model.sensors()[std::size_t(sensor)].points));
}

}  // namespace tangere
