// SPDX-License-Identifier: Apache-2.0
// The draws are those of the readings of these pictures.
#include "engine/rows/picture_gains.hpp"

#include "engine/model/camera_gains.hpp"
#include "engine/model/compiled_model.hpp"

namespace tangere {

std::vector<GainedPicture> gained_pictures(const Model& model) {
  std::vector<GainedPicture> list;
  const Scene& scene = model.scene();
  for (std::size_t i = 0; i < scene.sensors.size(); ++i)
    if (const auto& picture = scene.sensors[i].picture; picture && picture->gain > 0)
      list.push_back({std::string(model.sensors()[i].name), false, static_cast<int>(i),
                      picture->gain, compiled(model).sensors[i].name_bits});
  for (std::size_t i = 0; i < scene.cameras.size(); ++i)
    if (scene.cameras[i].gain > 0)
      list.push_back({scene.cameras[i].name, true, static_cast<int>(i), scene.cameras[i].gain,
                      compiled(model).cameras[i].name_bits});
  return list;
}

std::vector<std::string> picture_gain_names(std::span<const GainedPicture> pictures) {
  std::vector<std::string> names;
  for (const GainedPicture& picture : pictures)
    for (const char* colour : {" red", " green", " blue"}) names.push_back(picture.name + colour);
  return names;
}

std::vector<double> picture_gains(std::span<const GainedPicture> pictures, std::uint64_t seed,
                                  std::int64_t episode) {
  std::vector<double> all;
  for (const GainedPicture& picture : pictures)
    for (const double gain : camera_gains({seed ^ picture.bits, episode, 0}, picture.deviation))
      all.push_back(gain);
  return all;
}

}  // namespace tangere
