// SPDX-License-Identifier: Apache-2.0
// Pictures that a camera behind a sensor's gel has: of the depth of the bodies, or the surface of
// its layer, and of how its markers move (docs/pictures.md).
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "engine/model/model.hpp"
#include "engine/picture/gel_camera.hpp"
#include "engine/scene/field_form.hpp"
#include "engine/sense/imperfect_field.hpp"
#include "engine/sense/marker_map.hpp"
#include "kernels/tactile/tactile_types.hpp"

namespace tangere {

/// Owns the scratch of one thread. T: float or double, in which pictures are computed.
template <class T>
class PictureReading {
 public:
  /// The sensor must have a picture.
  PictureReading(const Model& model, int sensor);
  ~PictureReading();
  PictureReading(PictureReading&&) noexcept;
  PictureReading& operator=(PictureReading&&) noexcept;

  /// Whether pictures follow from the depth of the bodies: those of a sensor without a layer.
  [[nodiscard]] bool needs_depth() const;
  /// Whether a form needs the ideal field.
  [[nodiscard]] bool needs_field(FieldForm form) const;

  /// Takes the shapes below the pad (PadReader::arguments()), where needs_depth().
  void set_touches(const kernels::TactileArgs<double>& touch);
  /// Takes the ideal field, (points, 3) [N], where needs_field().
  void set_field(FieldForm form, std::span<const double> field);
  /// Chooses noise and gains.
  void set_draws(const ReadingKey& key);

  /// Computes a picture, (height, width, 1) or (height, width, 3); colours as numbers from 0 to 255
  /// that are not rounded.
  void read(FieldForm form, std::span<T> picture);
  /// The same in whole grey levels.
  void read(FieldForm form, std::span<std::uint8_t> picture) requires std::is_same_v<T, float>;
  /// Pulls the cotangent of a picture of a sensor with a layer back to the ideal field that was
  /// taken last, and adds it to `field_bar`, (points, 3).
  void pull_back(FieldForm form, std::span<const double> field, std::span<const T> picture_bar,
                 std::span<double> field_bar);
  /// Pulls the cotangent of a picture back to the shapes that were taken last, where
  /// needs_depth(): pull_back_depths(). Adds that of the ideal field, by which printed markers
  /// move, to `field_bar`, (points, 3), where needs_field().
  void pull_back_touches(FieldForm form, const kernels::TactileArgs<double>& touch,
                         std::span<const T> picture_bar, bool sizes,
                         std::span<kernels::TouchCotangent<double>> touches,
                         std::span<double> field_bar);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
