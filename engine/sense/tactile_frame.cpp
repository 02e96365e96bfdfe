// SPDX-License-Identifier: Apache-2.0
// Storage of frames, which Readout fills.
#include "engine/sense/tactile_frame.hpp"

#include <numeric>
#include <string>

#include "engine/base/error.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/sense/dense_tiles.hpp"

namespace tangere {

namespace {

const CompiledSensor& checked(const Model& model, int sensor) {
  const auto& sensors = compiled(model).sensors;
  if (sensor < 0 || std::size_t(sensor) >= sensors.size())
    throw InputError("no tactile sensor " + std::to_string(sensor) + ": the scene has " +
                     std::to_string(sensors.size()));
  return sensors[std::size_t(sensor)];
}

}  // namespace

template <class T>
DenseFrame<T>::DenseFrame(const Model& model, int sensor, FieldForm form)
    : model_(model),
      sensor_(sensor),
      form_(form),
      values_(numbers_of(compiled(model).sensor_info[std::size_t(checked(model, sensor).number)],
                         form)),
      written_(std::size_t(checked(model, sensor).n_tiles())) {
  if (form == FieldForm::sum)
    throw InputError("a frame of a sum; expected a field, a pressure or a shear");
}

template <class T>
void DenseFrame<T>::mark_all() {
  count_ = static_cast<int>(written_.size());
  std::iota(written_.begin(), written_.end(), 0);
}

template <class T>
CompactFrame<T>::CompactFrame(const Model& model, int sensor)
    : model_(model),
      sensor_(sensor),
      tiles_(std::size_t(checked(model, sensor).n_tiles())),
      values_(LaneAllocator<T>().allocate(tiles_.size() * 3 * kernels::kTactileTile)) {}

template <class T>
int CompactFrame<T>::tile_cols() const {
  return compiled(model_).sensors[std::size_t(sensor_)].tile_cols;
}

template <class T>
std::size_t CompactFrame<T>::dense_size() const {
  return 3 * std::size_t(compiled(model_).sensors[std::size_t(sensor_)].points());
}

template <class T>
void CompactFrame<T>::expand(std::span<T> dense) const {
  spread(values(), dense);
}

template <class T>
void CompactFrame<T>::spread(std::span<const T> tile_values, std::span<T> dense) const {
  const kernels::PadTiles pad = compiled(model_).sensors[std::size_t(sensor_)].tiles();
  clear_tiles_between<T>(pad, tiles(), 3, dense.data());
  for (std::size_t k = 0; k < std::size_t(count_); ++k)
    expand_tile<3>(pad, tiles_[k], tile_values.data() + 3 * kernels::kTactileTile * k,
                   dense.data());
}

static_assert(kTilePoints == kernels::kTactileTile);

std::vector<std::vector<TilePoint>> points_by_tile(const Model& model, int sensor) {
  const kernels::PadTiles pad = checked(model, sensor).tiles();
  std::vector<std::vector<TilePoint>> all(std::size_t(pad.tiles()));
  for (int tile = 0; tile < pad.tiles(); ++tile)
    for_points_of_tile(pad, tile, [&](int place, int point) {
      all[std::size_t(tile)].push_back({point, place});
    });
  return all;
}

template class DenseFrame<float>;
template class DenseFrame<double>;
template class CompactFrame<float>;
template class CompactFrame<double>;

}  // namespace tangere
