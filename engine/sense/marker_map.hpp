// SPDX-License-Identifier: Apache-2.0
// Displacements of markers on the surface of a gel, as a camera behind the gel measures them. With
// the ideal field f of the sensor, its shear f_s (along axis0 and axis1) and its pressing force p,
// a marker at point i moves along axis0 and axis1 by
//
//   u_i = Σ_j S_ij (f_s,j - t/2 ∇p_j) / k_s [m]          (docs/sensors.md)
//
// k_s = G 𝒜/t is the shear stiffness of the gel under one point, t its thickness, S its lateral
// spread. The map is linear: it is its own tangent map, and its transpose is the pullback.
#pragma once

#include <memory>
#include <span>

#include "engine/model/model.hpp"

namespace tangere {

/// Several threads may use it at once. Each thread allocates scratch at its first call.
class MarkerMap {
 public:
  /// Throws InputError where the sensor has no markers.
  MarkerMap(const Model& model, int sensor);
  ~MarkerMap();
  MarkerMap(MarkerMap&&) noexcept;
  MarkerMap& operator=(MarkerMap&&) noexcept;

  /// Computes displacements, (points, 2) [m], from the ideal field, (points, 3) [N].
  void displace(std::span<const double> field, std::span<double> displacement) const;
  /// Pulls the cotangent of the displacements, (points, 2), back to the field and adds it, (points,
  /// 3).
  void pull_back(std::span<const double> displacement_bar, std::span<double> field_bar) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
