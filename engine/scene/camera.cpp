// SPDX-License-Identifier: Apache-2.0
// right = forward x up, down = forward x right.
#include "engine/scene/camera.hpp"

#include <fmt/format.h>

#include <cmath>

namespace tangere {
namespace {

constexpr double kLeastSine = 1e-6;  // of the angle between the view and `up`

double length(const Vector3& a) { return std::sqrt(dot(a, a)); }

}  // namespace

CameraAxes axes_of(const CameraDescription& camera) {
  CameraAxes axes;
  axes.forward = unit(camera.target - camera.position);
  axes.right = unit(cross(axes.forward, camera.up));
  axes.down = cross(axes.forward, axes.right);
  return axes;
}

double* camera_number(CameraDescription& camera, NumberField field, int component) {
  const auto k = static_cast<std::size_t>(component);
  switch (field) {
    case NumberField::pos: return &camera.position[k];
    case NumberField::look: return &camera.target[k];
    case NumberField::light: return &camera.light[k];
    case NumberField::ambient: return &camera.ambient;
    default: return &camera.brightness;
  }
}

std::string camera_fault(const CameraDescription& camera) {
  const Vector3 view = camera.target - camera.position;
  if (!(length(view) > 0)) return "pos and look are the same point; expected two";
  if (!(length(camera.up) > 0)) return "up has no length; expected a direction";
  if (length(cross(view, camera.up)) > kLeastSine * length(view) * length(camera.up)) {
    if (length(camera.light) > 0) return "";
    return "light has no length; expected a direction";
  }
  const bool along_y = std::abs(view[1]) > std::abs(view[0]) + std::abs(view[2]);
  return fmt::format(
      "up=\"{} {} {}\" lies along the view from pos to look; expected another direction, such as "
      "up=\"{}\"",
      camera.up[0], camera.up[1], camera.up[2], along_y ? "0 0 1" : "0 1 0");
}

}  // namespace tangere
