// SPDX-License-Identifier: Apache-2.0
// A camera as files describe it, and its pictures as channels.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/rows/channel.hpp"
#include "engine/scene/field_form.hpp"

namespace tangere {

struct CameraLayout {
  std::string name;
  int rows = 0, cols = 0;  ///< pixels
  /// Its place and axes, angle of view, and errors of its readings.
  Attributes facts;
  std::vector<std::string> bodies;  ///< what the numbers of its pixels stand for, from 0
};

/// Describes a camera of a scene.
CameraLayout camera_layout(const Scene& scene, const CameraDescription& camera);
std::vector<CameraLayout> camera_layouts(const Scene& scene);

/// Returns the shape of one picture: {rows, cols, components}.
std::vector<std::uint64_t> view_shape(const CameraLayout& camera, FieldForm form);
/// Describes the components of a picture: "R, G, B, row 0 on top".
const char* view_text(FieldForm form);
/// Returns units, components, the facts of the camera and, of numbers, the names of bodies.
Attributes view_attributes(const CameraLayout& camera, FieldForm form);

}  // namespace tangere
