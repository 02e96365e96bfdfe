// SPDX-License-Identifier: Apache-2.0
// Poses of the bodies of one environment at the start and after every step, with energy, momentum
// and other conserved sums.
#pragma once

#include <vector>

#include "engine/sense/readout.hpp"

namespace tangere {

/// Frame 0 is the start; frame k comes after step k. Bodies are in file order. Everything is in
/// world axes.
class StressHistory {
 public:
  /// `step`: [s]. The model must be that of the batches that are added.
  StressHistory(const Model& model, double step);

  /// Adds the state of an environment as the next frame.
  void add(Readout& readout, const Batch& batch, int environment);

  [[nodiscard]] const Scene& scene() const { return model_.scene(); }
  [[nodiscard]] double mass(int body) const { return model_.mass(body); }  ///< [kg]
  [[nodiscard]] double step() const { return step_; }                      ///< [s]
  [[nodiscard]] int bodies() const { return model_.nb(); }
  [[nodiscard]] int frames() const { return frames_; }
  [[nodiscard]] int last() const { return frames_ - 1; }

  [[nodiscard]] Vector3 position(int frame, int body) const;  ///< of the body frame [m]
  [[nodiscard]] Quaternion orientation(int frame, int body) const;
  [[nodiscard]] Vector3 velocity(int frame, int body) const;  ///< of the body frame's origin [m/s]
  [[nodiscard]] Vector3 spin(int frame, int body) const;      ///< angular velocity [rad/s]

  /// Of all bodies [J]. Springs, limits and contacts store energy that is not in these.
  [[nodiscard]] double kinetic_energy(int frame) const;
  [[nodiscard]] double height_energy(int frame) const;  ///< -Σ m gravity·x [J]
  /// Of all bodies about their own centres [kg m²/s].
  [[nodiscard]] Vector3 angular_momentum(int frame) const;

 private:
  [[nodiscard]] const double* pose(int frame, int body) const;
  [[nodiscard]] const double* twist(int frame, int body) const;
  [[nodiscard]] Vector3 angular_momentum(int frame, int body) const;

  Model model_;
  double step_;
  int frames_ = 0;
  std::vector<std::array<double, 6>> inertia_;  // (nb) xx xy xz yy yz zz, body axes [kg m²]
  std::vector<double> poses_, twists_;          // (frames, nb, 7) and (frames, nb, 6)
};

}  // namespace tangere
