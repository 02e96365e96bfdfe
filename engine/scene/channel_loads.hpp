// SPDX-License-Identifier: Apache-2.0
// Loads of the nodes of a map of channels (engine/scene/channels.hpp): sums of a field, weighted by
// bilinear hats between nodes.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "engine/scene/channels.hpp"

namespace tangere {

/// Nodes near a point, and the weights with which it counts there. Weights may be 0.
struct NodeWeights {
  std::array<int, 4> node{};
  std::array<double, 4> weight{};
};
/// Returns those of rows × cols points on a map's nodes. Of a list of points, `rows` is 1.
std::vector<NodeWeights> node_weights(const ChannelMap& map, int rows, int cols);

/// Loads of the nodes, (map.loads()) [N], of a field, (points, 3) [N]. `pressure_sign`: as in
/// SensorInfo.
void node_loads(const ChannelMap& map, std::span<const NodeWeights> weights, int pressure_sign,
                std::span<const double> field, std::span<double> loads);

}  // namespace tangere
