// SPDX-License-Identifier: Apache-2.0
// The lamps of the default gel shade by Lambert's law: a lamp in direction e of the surface's plane
// adds level · (n · e).
#include "engine/scene/gel.hpp"

#include <cmath>
#include <numbers>

namespace tangere {

Gel default_gel() {
  constexpr double kLevel = 120, kGrey = 100, kBlur = 2e-4;  // grey levels; [m]
  constexpr double kThird = 2 * std::numbers::pi / 3;
  Gel gel;
  gel.name = "default";
  gel.blur = kBlur;
  for (std::size_t c = 0; c < kColours; ++c) {
    const double angle = static_cast<double>(c) * kThird - std::numbers::pi / 2;
    gel.lamps[c][0][0] = kLevel * std::cos(angle);
    gel.lamps[c][1][0] = kLevel * std::sin(angle);
    gel.lamps[c][2][0] = kLevel / 2;
  }
  gel.background = {1, 1, {kGrey, kGrey, kGrey}};
  return gel;
}

std::array<double, 2> shown_size(const PictureDescription& picture, int rows, int cols,
                                 const std::array<double, 2>& pitch) {
  return picture.size.value_or(
      std::array<double, 2>{rows * std::abs(pitch[0]), cols * std::abs(pitch[1])});
}

}  // namespace tangere
