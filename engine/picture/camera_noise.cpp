// SPDX-License-Identifier: Apache-2.0
// One counter serves the three channels of a pixel.
#include "engine/picture/camera_noise.hpp"

#include <algorithm>

#include "engine/model/random_run.hpp"

namespace tangere {

template <class T>
void add_camera_noise(const CameraKey& key, double deviation, int first, std::span<T> planes) {
  const std::size_t width = planes.size() / kColours;
  RandomWords words;
  RandomNormals normals;
  for (std::size_t k = 0; k < width; k += kRandomRun) {
    random_run({key.seed, key.episode, key.step, Purpose::picture_noise,
                static_cast<std::uint32_t>(first) + static_cast<std::uint32_t>(k)},
               words);
    normal_run(words, normals);
    const std::size_t count = std::min<std::size_t>(kRandomRun, width - k);
    for (std::size_t c = 0; c < kColours; ++c)
      for (std::size_t l = 0; l < count; ++l)
        planes[c * width + k + l] += static_cast<T>(deviation) * static_cast<T>(normals[c][l]);
  }
}

template void add_camera_noise(const CameraKey&, double, int, std::span<float>);
template void add_camera_noise(const CameraKey&, double, int, std::span<double>);

}  // namespace tangere
