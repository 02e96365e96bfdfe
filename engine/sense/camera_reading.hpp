// SPDX-License-Identifier: Apache-2.0
// What a camera of the scene sees of an environment: colours, depths and numbers of bodies
// (docs/cameras.md).
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "engine/model/model.hpp"
#include "engine/scene/field_form.hpp"
#include "engine/sense/imperfect_field.hpp"
#include "engine/sense/pad_reader.hpp"

namespace tangere {

/// Owns the scratch of one thread. The pictures of the last environments are kept: their colours,
/// depths and numbers are computed once, as long as nothing in them has moved.
class CameraReading {
 public:
  CameraReading(const Model& model, int camera);
  ~CameraReading();
  CameraReading(CameraReading&&) noexcept;
  CameraReading& operator=(CameraReading&&) noexcept;

  /// Chooses an environment, to whose group the reader was moved.
  void set(const PadReader& reader, const Batch& batch, int environment);

  /// Writes a picture, (height, width, 3) in colours, else (height, width, 1). Colours are whole
  /// grey levels. T: double or float; a byte for colours, an int16 for numbers of bodies.
  template <class T>
  void read(FieldForm form, std::span<T> picture);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
