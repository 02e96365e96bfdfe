// SPDX-License-Identifier: Apache-2.0
// Computes the channels of a sensor from its ideal field (engine/scene/channels.hpp), and pulls
// cotangents back:
//   x = B f,  f̄ = Bᵀ x̄,  x̄_k = Σ_c ȳ_c (L_ck + Σ_{l ≥ k} Q_ckl x_l + Σ_{l ≤ k} Q_clk x_l)
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/model/model.hpp"
#include "engine/scene/channel_loads.hpp"
#include "engine/sense/imperfect_field.hpp"

namespace tangere {

/// Several threads may use it at once. Each thread allocates scratch at its first call.
class ChannelReading {
 public:
  /// Throws InputError (file:line) where the sensor has no channels.
  ChannelReading(const Model& model, int sensor);

  [[nodiscard]] std::size_t size() const { return map_->channels(); }
  /// Computes channels without flaws, (size), from the ideal field, (points, 3) [N].
  void evaluate(std::span<const double> field, std::span<double> channels) const;
  /// Adds the pullback of `channels_bar`, (size), at `field` to `field_bar`, both (points, 3).
  void pull_back(std::span<const double> field, std::span<const double> channels_bar,
                 std::span<double> field_bar) const;
  /// Turns channels without flaws into those of the sensor. `time`: since the episode began [s].
  void apply_flaws(const ReadingKey& key, double time, std::span<double> channels) const;

 private:
  std::shared_ptr<const ChannelMap> map_;
  ChannelsDescription flaws_;
  std::vector<NodeWeights> weights_;
  int pressure_sign_ = 1;
  std::uint64_t name_bits_ = 0;
};

}  // namespace tangere
