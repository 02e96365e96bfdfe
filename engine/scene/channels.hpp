// SPDX-License-Identifier: Apache-2.0
// Channels of a sensor: the numbers that its hardware returns, such as those of magnetometers or of
// capacitances (docs/channels.md). With loads x of nodes, which are weighted sums of the ideal
// field, channel c reads
//   y_c = o_c + Σ_k L_ck x_k + Σ_{k ≤ l} Q_ckl x_k x_l
// and then what its electronics do to it:
//   y_c ← o_c + (1 + g)(y_c - o_c) + b + d t + e,   y_c ← Q round(clamp(y_c, ±s)/Q)
// with g ~ N(0, gain²), b ~ N(0, bias²) and d ~ N(0, drift²) of the episode, e ~ N(0, noise²) of
// the step, and t the time since the episode began.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "engine/base/error.hpp"

namespace tangere {

/// The fitted part, which stands in a file. Channels count in `unit`, loads in N.
struct ChannelMap {
  std::string name;  ///< of its file, for people
  std::string unit;  ///< of the channels, as users write it: "uT", "counts"
  /// Nodes along the rows and the columns of the points, evenly spread from the first to the last;
  /// 1: one in which all points count alike. Between nodes weights are bilinear.
  int rows = 1, cols = 1;
  /// Loads of a node: along axis0, along axis1 and pressing; without shear pressing alone.
  bool shear = false;
  std::vector<std::string> names;  ///< (channels)
  std::vector<double> offset;      ///< (channels) o
  std::vector<double> linear;      ///< (channels, loads) L
  std::vector<double> quadratic;   ///< (channels, pairs) Q, pairs (0, 0), (0, 1), …; empty: none
  std::uint64_t checksum = 0;      ///< of the file

  [[nodiscard]] std::size_t channels() const { return offset.size(); }
  [[nodiscard]] std::size_t loads() const {
    return std::size_t(rows) * std::size_t(cols) * (shear ? 3U : 1U);
  }
  [[nodiscard]] std::size_t pairs() const { return loads() * (loads() + 1) / 2; }
};

/// At most so many of each.
inline constexpr int kMostChannels = 1024, kMostNodes = 64;

/// The channels of one sensor. A flaw of 0 is left out. Numbers are in the channels' unit.
struct ChannelsDescription {
  double noise = 0;         ///< standard deviation of what is new in every step
  double bias = 0;          ///< of a channel's constant offset, by episode
  double gain = 0;          ///< of a channel's gain about 1, by episode [1]
  double drift = 0;         ///< of the rate of a channel's offset, by episode [unit/s]
  double saturation = 0;    ///< largest magnitude; 0: none
  double quantisation = 0;  ///< channels are multiples of it; 0: not rounded
  std::shared_ptr<const ChannelMap> map;  ///< not null
  Source source;

  [[nodiscard]] bool perfect() const {
    return noise == 0 && bias == 0 && gain == 0 && drift == 0 && saturation == 0 &&
           quantisation == 0;
  }
};

/// Returns what is wrong with a map for an array of rows × cols points, or for a list of points
/// (both 0); "" if nothing.
std::string channel_map_fault(const ChannelMap& map, int rows, int cols);

}  // namespace tangere
