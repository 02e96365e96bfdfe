// SPDX-License-Identifier: Apache-2.0
// Counts of a map's numbers.
#include "engine/scene/channels.hpp"

#include <fmt/format.h>

#include <cmath>
#include <set>

namespace tangere {

std::string channel_map_fault(const ChannelMap& map, int rows, int cols) {
  const std::size_t n = map.channels();
  if (n == 0) return "no channel; expected one at least";
  if (n > kMostChannels) return fmt::format("{} channels; expected at most {}", n, kMostChannels);
  if (map.rows < 1 || map.cols < 1 || map.rows > kMostNodes || map.cols > kMostNodes / map.rows)
    return fmt::format("{} x {} nodes; expected at least one and at most {}", map.rows, map.cols,
                       kMostNodes);
  if (rows == 0 && map.rows * map.cols > 1)
    return fmt::format("{} x {} nodes on points in a list; expected one node, or rect_array",
                       map.rows, map.cols);
  if (rows > 0 && (map.rows > rows || map.cols > cols))
    return fmt::format("{} x {} nodes on {} x {} points; expected no more nodes than points",
                       map.rows, map.cols, rows, cols);
  if (map.names.size() != n || map.linear.size() != n * map.loads() ||
      (!map.quadratic.empty() && map.quadratic.size() != n * map.pairs()))
    return fmt::format(
        "{} names, {} linear and {} quadratic numbers of {} channels by {} loads; expected {}, {} "
        "and {} or none",
        map.names.size(), map.linear.size(), map.quadratic.size(), n, map.loads(), n,
        n * map.loads(), n * map.pairs());
  for (const std::vector<double>* numbers : {&map.offset, &map.linear, &map.quadratic})
    for (const double x : *numbers)
      if (!std::isfinite(x)) return "a number that is not finite; expected finite ones";
  if (std::set<std::string>(map.names.begin(), map.names.end()).size() != n)
    return "two channels of one name; expected names that differ";
  return "";
}

}  // namespace tangere
