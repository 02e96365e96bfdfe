// SPDX-License-Identifier: Apache-2.0
// Fits the channels of a sensor (engine/scene/channels.hpp) to recorded presses: ridge regression
// of channels by the loads of nodes and their products, which the simulated sensor has there. With
// A the loads and products of the rows, each less its mean and over its deviation, and Y channels
// less their means over their deviations,
//   w = (AᵀA + λ n I)⁻¹ AᵀY
// λ has the least generalised cross-validation ‖Y - A w‖²/(1 - 1.4 tr H/n)²,
// H = A (AᵀA + λ n I)⁻¹ Aᵀ.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// Recorded presses, one number for each row. Columns that were not recorded are empty.
struct ChannelRecording {
  std::vector<double> depth;  ///< of the indenter below the first touch [m]
  std::vector<double> x, y;   ///< place of the indenter from the middle of the skin [m]
  std::vector<double> shear;  ///< displacement along x on a path, in place of x and y [m]
  std::vector<std::string> names;
  std::vector<std::vector<double>> channels;  ///< (channels, rows)

  [[nodiscard]] std::size_t rows() const { return depth.size(); }
};

/// R² = 1 - Σ (y - ŷ)²/Σ (y - mean)² over some rows, by channel, and with the sums over all of
/// them.
struct ChannelScore {
  int rows = 0;
  std::vector<double> each;  ///< (channels); 1 where a channel is constant and met, else -inf
  double whole = 0;
  [[nodiscard]] double mean() const;
};

struct ChannelFit {
  ChannelMap map;
  double ridge = 0;  ///< λ
  ChannelScore fitted, held_out;
};

/// What a fit is to have.
struct ChannelRequest {
  int rows = 3, cols = 3;  ///< nodes
  bool shear = false;      ///< loads along the skin as well
  std::string unit = "1";
  double zero = 0;      ///< added to every depth [m]
  double hold_out = 0;  ///< as held_out_rows()
};

/// Fits. `scene`: of placed_indenter(). Throws InputError for columns of unlike lengths, for places
/// beside a shear, for fewer than three rows to fit, for nodes that the sensor cannot have, and
/// where nothing is pressed.
ChannelFit fit_channels(const Scene& scene, const ChannelRequest& request,
                        const ChannelRecording& recording);

/// Compares another recording, whose channels have the same names, with a map.
ChannelScore check_channels(const Scene& scene, const ChannelRequest& request,
                            const ChannelMap& map, const ChannelRecording& recording);

}  // namespace tangere
