// SPDX-License-Identifier: Apache-2.0
// How the surface of a soft layer moves under its own field (docs/layer.md): u = C q, where q is
// the traction of the ideal field on a cell. Between the middles of cells u is bilinear.
#pragma once

#include <span>

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// The map is linear: it is its own tangent map. Several threads may use it at once. Each thread
/// allocates scratch at its first call. The sensor must outlive the map.
class SurfaceMap {
 public:
  /// The sensor must have a layer and markers.
  explicit SurfaceMap(const CompiledSensor& sensor) : sensor_(&sensor) {}

  /// Computes displacements along axis0, axis1 and out of the layer, (points, 3) [m], from the
  /// ideal field, (points, 3) [N].
  void displace(std::span<const double> field, std::span<double> displacement) const;
  /// Pulls the cotangent of the displacements, (points, 3), back to the field and adds it, (points,
  /// 3), at points of cells that carry a force: no derivative passes through others.
  void pull_back(std::span<const double> field, std::span<const double> displacement_bar,
                 std::span<double> field_bar) const;

 private:
  const CompiledSensor* sensor_;
};

}  // namespace tangere
