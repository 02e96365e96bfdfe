// SPDX-License-Identifier: Apache-2.0
// Sums run over points in order.
#include "engine/scene/channel_loads.hpp"

#include <algorithm>
#include <utility>

namespace tangere {
namespace {

/// Returns the node before a point along one axis, and the share of the next one.
std::pair<int, double> before(int point, int points, int nodes) {
  if (nodes == 1) return {0, 0.0};
  const double at = double(point) * (nodes - 1) / (points - 1);
  const int first = std::min(static_cast<int>(at), nodes - 2);
  return {first, at - first};
}

}  // namespace

std::vector<NodeWeights> node_weights(const ChannelMap& map, int rows, int cols) {
  std::vector<NodeWeights> out;
  const int down = map.rows > 1 ? map.cols : 0, right = map.cols > 1 ? 1 : 0;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j) {
      const auto [r, fr] = before(i, rows, map.rows);
      const auto [c, fc] = before(j, cols, map.cols);
      const int first = r * map.cols + c;
      out.push_back({{first, first + right, first + down, first + down + right},
                     {(1 - fr) * (1 - fc), (1 - fr) * fc, fr * (1 - fc), fr * fc}});
    }
  return out;
}

void node_loads(const ChannelMap& map, std::span<const NodeWeights> weights, int pressure_sign,
                std::span<const double> field, std::span<double> loads) {
  std::fill(loads.begin(), loads.end(), 0.0);
  const std::size_t each = map.shear ? 3 : 1;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double* const f = &field[3 * i];
    if (f[0] == 0 && f[1] == 0 && f[2] == 0) continue;
    const double load[3] = {f[0], f[1], pressure_sign * f[2]};
    for (std::size_t n = 0; n < 4; ++n)
      for (std::size_t k = 0; k < each; ++k)
        loads[each * std::size_t(weights[i].node[n]) + k] +=
            weights[i].weight[n] * load[3 - each + k];
  }
}

}  // namespace tangere
