// SPDX-License-Identifier: Apache-2.0
// The points of an elastic sensor that touch one body.
#pragma once

#include <span>
#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/model/compiled_model.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere {

/// Owns the scratch of one thread, for any sensor of the model.
class TouchingSensorPoints {
 public:
  TouchingSensorPoints() = default;
  explicit TouchingSensorPoints(const CompiledModel& model);

  /// Lists the points that touch. Anchors are not set. The list is valid until the next call.
  kernels::ShearSpringPoints find(const CompiledSensor& sensor, const kernels::KernelTable& table,
                                  const kernels::ShearSpringTouch& touch);
  /// The same, if a ball around the points is known to reach the shape.
  kernels::ShearSpringPoints find_near(const CompiledSensor& sensor,
                                       const kernels::KernelTable& table,
                                       const kernels::ShearSpringTouch& touch);
  /// Numbers of the points in their contact, rising.
  [[nodiscard]] const int* index() const { return index_.data(); }
  /// Adds cotangents of the listed points' own numbers, (kPointNumbers, stride) with places in the
  /// link's axes, to those of all points of the sensor, (points, kPointNumbers) in its body's axes.
  void add_to_points(const CompiledModel& model, const CompiledSensor& sensor,
                     const kernels::ShearSpringPoints& listed, const double* own,
                     std::span<double> points) const;
  /// Scratch of kKeptNumbers rows as long as those of the list.
  [[nodiscard]] double* scratch() { return scratch_.data(); }
  static constexpr int kKeptNumbers = 7;

 private:
  AlignedVector<double> places_, anchors_, factors_, scratch_;
  std::vector<int> index_;
};

}  // namespace tangere
