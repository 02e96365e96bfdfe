// SPDX-License-Identifier: Apache-2.0
// What an episode draws for the pictures of its gels and cameras: a factor of each channel.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// A sensor with pictures, or a camera, whose channels have gains that vary by episode.
struct GainedPicture {
  std::string name;        ///< of the sensor or camera
  bool is_camera = false;  ///< of the scene
  int index = 0;           ///< among the sensors or cameras of the model
  double deviation = 0;    ///< of the gains
  std::uint64_t bits = 0;  ///< of the name, for the draws
};

/// Lists those of a model: sensors, then cameras.
std::vector<GainedPicture> gained_pictures(const Model& model);
/// Names of what picture_gains() returns: "pad red", "pad green", "pad blue" …
std::vector<std::string> picture_gain_names(std::span<const GainedPicture> pictures);
/// Returns the gains of R, G and B of each in an episode of a seed.
std::vector<double> picture_gains(std::span<const GainedPicture> pictures, std::uint64_t seed,
                                  std::int64_t episode);

}  // namespace tangere
