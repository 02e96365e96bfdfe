// SPDX-License-Identifier: Apache-2.0
// The field of a sensor whose friction remembers: the law at the state and the memory after the
// last step (docs/shear.md).
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

  /// Computes the field, (points, 3) [N], in an environment whose group the reader has moved.
  void read(const PadReader& reader, const Batch& batch, int environment, int sensor,
            std::span<double> field);

  /// What a cotangent of the field comes to, by one body that the sensor touches.
  struct Share {
    const kernels::ShearSpringContact* of;
    kernels::TouchCotangent<double> motion;  ///< body 1's axes and origin
  };
  /// Returns what a cotangent of the field comes to, valid until the next call, and adds to
  /// `memory`, three numbers for each entry of the environment's memory.
  std::span<const Share> pull_back(const PadReader& reader, const Batch& batch, int environment,
                                   int sensor, std::span<const double> cotangent,
                                   std::span<double> memory);

 private:
  template <class F>
  void for_each_touched(const PadReader& reader, const Batch& batch, int environment, int sensor,
                        const F& f);
  Model model_;
  TouchingSensorPoints felt_;
  std::vector<Share> shares_;
  AlignedVector<double> remembered_, s_, force_;  // (3, stride), (4, stride), (3, stride)
  AlignedVector<double> anchors_;                 // (6, stride)
};

}  // namespace tangere
