// SPDX-License-Identifier: Apache-2.0
// A camera gel: how its surface follows a body, and its colours as a function of the surface's
// normal (docs/pictures.md). io/scene/gel_file.hpp reads it from a file.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/base/error.hpp"

namespace tangere {

inline constexpr std::size_t kColours = 3;      ///< R, G, B
inline constexpr std::size_t kShades = 8;       ///< functions of the normal
inline constexpr std::size_t kShadePlaces = 3;  ///< 1, x, y

/// With the normal n and the place (x, y) from the picture's middle over its smaller side, channel
/// c differs from the background by
///   Σ_j φ_j(n) (a_cj + b_cj x + d_cj y),  φ = n_x, n_y, n_z - 1, n_x², n_x n_y, n_y², n_x n_z,
///   n_y n_z
/// [grey levels]. The numbers: for each channel, for each φ_j, a, b, d.
using GelLamps = std::array<std::array<std::array<double, kShadePlaces>, kShades>, kColours>;

/// The picture of an untouched gel.
struct GelBackground {
  int rows = 0, cols = 0;
  std::vector<float> levels;  ///< (rows, cols, 3), R, G, B, 0 to 255
};

struct Gel {
  std::string name;                  ///< of its file, without ending
  std::uint64_t checksum = 0;        ///< of its files; 0: not from a file
  double pixel = 0;                  ///< of the background [m], for a warning; 0: not known
  std::optional<double> reach = {};  ///< ℓ: how far a dent reaches [m]; none: 0.2 thickness
  double blur = 0;                   ///< deviation of a Gaussian b [m]
  GelLamps lamps{};
  GelBackground background;
};

/// A gel without photographs: red, green and blue lamps from three sides, and a grey background.
Gel default_gel();

/// The picture of a camera behind a sensor's gel.
struct PictureDescription {
  int rows = 240, cols = 320;  ///< pixels
  /// Height and width that the picture shows [m]; none: the points and half a pitch around them.
  std::optional<std::array<double, 2>> size{};
  bool mirror = false;             ///< columns count from right to left
  double noise = 0;                ///< deviation of every number of a picture [grey levels]
  double gain = 0;                 ///< deviation of a factor per channel and episode
  std::array<int, 2> markers{};    ///< columns and rows of printed markers; 0: none
  double marker_pitch = 0;         ///< [m]; 0: spread over the picture
  double marker_radius = 0;        ///< [m]; 0: a tenth of the distance between them
  std::shared_ptr<const Gel> gel;  ///< not null
  Source source;
};

/// Height and width that a picture shows [m]. `pitch`: between rows and columns of points.
std::array<double, 2> shown_size(const PictureDescription& picture, int rows, int cols,
                                 const std::array<double, 2>& pitch);

}  // namespace tangere
