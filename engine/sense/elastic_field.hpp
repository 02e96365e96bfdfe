// SPDX-License-Identifier: Apache-2.0
// Field of a sensor with shear springs: the contact law at the state and shear state after the last
// step (docs/shear.md).
#pragma once

#include <span>

#include "engine/sense/pad_reader.hpp"
#include "engine/step/touching_sensor_points.hpp"

namespace tangere {

/// Owns the scratch of one thread. Allocates only when made, and only for a model with such a
/// sensor.
class ElasticField {
 public:
  explicit ElasticField(const Model& model);

  /// Computes the field, (points, 3) [N], of one environment. PadReader::move() must have been
  /// called for its group.
  void read(const PadReader& reader, const Batch& batch, int environment, int sensor,
            std::span<double> field);

  /// Contribution of one touched body to the cotangents.
  struct Share {
    const kernels::ShearSpringContact* of;
    kernels::TouchCotangent<double> motion;  ///< body 1's axes and origin
  };
  /// Pulls a cotangent of the field back: returns the contribution of each touched body, valid
  /// until the next call, and adds the cotangent of the shear state to `memory`, three numbers for
  /// each entry of the environment, and those of the points' own numbers to `points_bar`,
  /// (points, kPointNumbers) or empty.
  std::span<const Share> pull_back(const PadReader& reader, const Batch& batch, int environment,
                                   int sensor, std::span<const double> cotangent,
                                   std::span<double> memory, std::span<double> points_bar);

 private:
  template <class F>
  void for_each_touched(const PadReader& reader, const Batch& batch, int environment, int sensor,
                        const F& f);
  Model model_;
  TouchingSensorPoints sensor_points_;
  std::vector<Share> shares_;
  AlignedVector<double> s_start_, s_, force_;  // (3, stride), (4, stride), (3, stride)
  AlignedVector<double> anchors_, own_;        // (6, stride), (kPointNumbers, stride)
};

}  // namespace tangere
