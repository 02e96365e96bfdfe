// SPDX-License-Identifier: Apache-2.0
// A camera of the scene: a pinhole that sees bodies and the ground (docs/cameras.md).
#pragma once

#include <string>

#include "engine/base/error.hpp"
#include "engine/base/vector3.hpp"
#include "engine/scene/number_address.hpp"

namespace tangere {

/// The picture's columns follow the camera's x axis and its rows the y axis; z points into the
/// picture: right, down, forward. With f = rows / (2 tan(fov/2)), pixel (i, j) has the ray
/// ((j + ½ - cols/2) / f, (i + ½ - rows/2) / f, 1).
struct CameraDescription {
  std::string name;
  std::string body;         ///< it moves with this body; empty: it stands in the world
  Vector3 position{};       ///< of the pinhole, in the body's frame or the world's [m]
  Vector3 target{0, 0, 0};  ///< a point in the middle of the picture, same frame [m]
  Vector3 up{0, 0, 1};      ///< points to the upper edge of the picture, same frame
  double fov = 45;          ///< angle from the upper edge to the lower one [degrees]
  int rows = 128, cols = 128;
  double far = 10;                  ///< depth beyond which nothing is seen, and that of the sky [m]
  Vector3 light{0.35, -0.6, 0.75};  ///< points to the lamp, which is far away, world axes
  double ambient = 0.35;            ///< share of light that comes from everywhere
  double brightness = 1;            ///< factor of all light
  double noise = 0;                 ///< deviation of every number of a picture [grey levels]
  double gain = 0;                  ///< deviation of a factor per channel and episode
  Source source;
};

/// Returns the number of a camera that `field` and `component` (0 to 2) name: pos, look, light,
/// ambient or brightness.
double* camera_number(CameraDescription& camera, NumberField field, int component);

/// Sides of the squares of the ground in pictures of cameras [m].
inline constexpr double kGroundSquare = 0.05;

/// Axes of a camera in the frame in which it is described.
struct CameraAxes {
  Vector3 right{}, down{}, forward{};  ///< unit
};
/// Returns the axes of a camera whose camera_fault() is empty.
CameraAxes axes_of(const CameraDescription& camera);
/// Returns an error text for a camera without a direction; "" if it has one.
std::string camera_fault(const CameraDescription& camera);

}  // namespace tangere
