// SPDX-License-Identifier: Apache-2.0
// Where a tactile field is kept between readings, so that reading again costs what is touched, not
// what there is.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/model/model.hpp"

namespace tangere {

/// One field as (points, 3), row-major [N]. Reading zeroes the tiles that the reading before wrote,
/// and no others. T is float or double.
template <class T>
class DenseFrame {
 public:
  /// All zero. Throws InputError when there is no such sensor.
  DenseFrame(const Model& model, int sensor);

  [[nodiscard]] int sensor() const { return sensor_; }
  [[nodiscard]] std::span<const T> values() const { return values_; }

 private:
  friend class Readout;
  void mark_all();
  Model model_;
  int sensor_;
  AlignedVector<T> values_;
  std::vector<int>
      written_;  // (tiles), `count_` of them in use: those that may hold something, in rising order
  int count_ = 0;
};

/// One field as the list of 8×8 tiles that something touches, tile after tile along axis1.
template <class T>
class CompactFrame {
 public:
  /// Empty, with room for every tile of the sensor. Throws InputError when there is no such sensor.
  CompactFrame(const Model& model, int sensor);

  [[nodiscard]] int sensor() const { return sensor_; }
  /// Indices of the touched tiles, rising; tile t holds rows 8 (t / tile_cols()) … and columns 8 (t
  /// % tile_cols()) ….
  [[nodiscard]] std::span<const int> tiles() const { return {tiles_.data(), std::size_t(count_)}; }
  [[nodiscard]] int tile_cols() const;
  /// (tiles().size(), 3, 8, 8) [N], zero for points beyond the edge of the array.
  [[nodiscard]] std::span<const T> values() const {
    return {values_.get(), std::size_t(count_) * 192};
  }
  /// Numbers of the whole field, 3 per point.
  [[nodiscard]] std::size_t dense_size() const;
  /// The whole field, (points, 3), zeros included.
  void expand(std::span<T> dense) const;
  /// Numbers in the layout of values(), of the same tiles, as a whole field.
  void spread(std::span<const T> of_tiles, std::span<T> dense) const;

 private:
  friend class Readout;
  struct Free {
    void operator()(T* p) const noexcept { LaneAllocator<T>().deallocate(p, 0); }
  };
  Model model_;
  int sensor_;
  std::vector<int> tiles_;
  std::unique_ptr<T[], Free> values_;  // pages that no tile ever used stay untouched
  int count_ = 0;
};

inline constexpr int kTilePoints = 64;  ///< places of a tile, rows of 8
/// A point of a sensor's field, and its place in a tile.
struct TilePoint {
  int point, place;
};
/// Of every tile of a sensor, (tiles).
std::vector<std::vector<TilePoint>> points_by_tile(const Model& model, int sensor);

extern template class DenseFrame<float>;
extern template class DenseFrame<double>;
extern template class CompactFrame<float>;
extern template class CompactFrame<double>;

}  // namespace tangere
