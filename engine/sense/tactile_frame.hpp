// SPDX-License-Identifier: Apache-2.0
// Keeps a tactile field between readings, so that reading again costs time for the touched tiles
// alone.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/model/model.hpp"
#include "engine/scene/field_form.hpp"

namespace tangere {

/// One field, pressure or shear as (points, components), row-major [N]. A reading zeroes the tiles
/// that the previous reading wrote, and no others. T is float or double.
template <class T>
class DenseFrame {
 public:
  /// Makes a frame of zeros. Throws InputError when there is no such sensor, and for a sum, which
  /// has no points.
  DenseFrame(const Model& model, int sensor, FieldForm form = FieldForm::field);

  [[nodiscard]] const Model& model() const { return model_; }
  [[nodiscard]] int sensor() const { return sensor_; }
  [[nodiscard]] FieldForm form() const { return form_; }
  [[nodiscard]] std::span<const T> values() const { return values_; }

 private:
  friend class Readout;
  void mark_all();
  Model model_;
  int sensor_;
  FieldForm form_;
  AlignedVector<T> values_;
  // (tiles), of which `count_` are in use: those that may be nonzero, in rising order.
  std::vector<int> written_;
  int count_ = 0;
};

/// One field as the list of 8×8 tiles that something touches, tile after tile along axis1.
template <class T>
class CompactFrame {
 public:
  /// Makes an empty frame with room for every tile of the sensor. Throws InputError when there is
  /// no such sensor.
  CompactFrame(const Model& model, int sensor);

  [[nodiscard]] const Model& model() const { return model_; }
  [[nodiscard]] int sensor() const { return sensor_; }
  /// Indices of the touched tiles, rising. Tile t holds the 8 rows from 8 (t / tile_cols()) on and
  /// the 8 columns from 8 (t % tile_cols()) on.
  [[nodiscard]] std::span<const int> tiles() const { return {tiles_.data(), std::size_t(count_)}; }
  [[nodiscard]] int tile_cols() const;
  /// (tiles().size(), 3, 8, 8) [N], zero for points beyond the edge of the array.
  [[nodiscard]] std::span<const T> values() const {
    return {values_.get(), std::size_t(count_) * 192};
  }
  /// Count of numbers in the whole field, 3 per point.
  [[nodiscard]] std::size_t dense_size() const;
  /// Writes the whole field, (points, 3), zeros included.
  void expand(std::span<T> dense) const;
  /// Writes numbers for the same tiles, laid out as values(), as a whole field.
  void spread(std::span<const T> tile_values, std::span<T> dense) const;

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

inline constexpr int kTilePoints = 64;  ///< points in a tile, in rows of 8
/// A point of a sensor's field, and its place in a tile.
struct TilePoint {
  int point, place;
};
/// Returns the points of every tile of a sensor, (tiles).
std::vector<std::vector<TilePoint>> points_by_tile(const Model& model, int sensor);

extern template class DenseFrame<float>;
extern template class DenseFrame<double>;
extern template class CompactFrame<float>;
extern template class CompactFrame<double>;

}  // namespace tangere
