// SPDX-License-Identifier: Apache-2.0
// What a batch is measured by: poses and twists of bodies, tactile fields. Reads the state, changes nothing.
#pragma once

#include <memory>
#include <span>

#include "engine/batch.hpp"

namespace tangere {

/// Reads any batch of its model. Owns the scratch of one thread; allocates only when made.
class Readout {
 public:
  explicit Readout(const Model& model);
  ~Readout();
  Readout(Readout&&) noexcept;
  Readout& operator=(Readout&&) noexcept;

  /// World poses (nb, 7: x y z qw qx qy qz of the body frame) and twists (nb, 6: angular, then linear velocity of the
  /// body frame's origin, world axes) of one environment, every body of the scene in file order.
  void bodies(const Batch& batch, int environment, std::span<double> pose, std::span<double> twist);

  /// Tactile field of one sensor and environment, (points, 3) [N]: f·axis0, f·axis1, -f·(axis0 × axis1), f the force on
  /// the sensor's body. Exactly zero where nothing touches. Feels every body that can move against the sensor.
  void tactile(const Batch& batch, int environment, int sensor, std::span<double> force);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
