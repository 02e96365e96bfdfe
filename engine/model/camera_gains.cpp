// SPDX-License-Identifier: Apache-2.0
// Without deviation nothing is drawn, and every factor is 1.
#include "engine/model/camera_gains.hpp"

#include "engine/model/random_run.hpp"

namespace tangere {

std::array<double, kColours> camera_gains(const CameraKey& key, double deviation) {
  std::array<double, kColours> gains{1, 1, 1};
  if (deviation == 0) return gains;
  for (std::size_t c = 0; c < kColours; ++c)
    gains[c] =
        1 + normal({key.seed, key.episode, 0, Purpose::picture_gain, static_cast<std::uint32_t>(c)},
                   0, deviation);
  return gains;
}

}  // namespace tangere
