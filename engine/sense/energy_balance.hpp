// SPDX-License-Identifier: Apache-2.0
// Energy and momentum of an environment, and what motors, damping and friction do to them. What a
// step changes beyond that, its scheme made.
#pragma once

#include <array>
#include <memory>
#include <span>

#include "engine/step/batch.hpp"

namespace tangere {

/// One environment at one instant.
struct Audit {
  double motion = 0;  ///< energy of moving bodies [J]
  double height = 0;  ///< -Σ m gravity·x [J]
  double held = 0;    ///< by springs, limits and contacts: Σ k_n d²/2 [J]
  double motors = 0;  ///< power of the motors [W]
  double taken = 0;   ///< power that damping and friction take [W]
  /// Of all bodies: linear [kg m/s], then angular about the world's origin [kg m²/s], world axes.
  std::array<double, 6> momentum{};
  [[nodiscard]] double energy() const { return motion + height + held; }
};

/// What passed in a step, by the trapezoid rule over its two ends [J].
struct StepEnergyBalance {
  double motors = 0;  ///< work of the motors
  double taken = 0;   ///< by damping and friction
  double made = 0;    ///< by the scheme: the change of energy less motors, plus taken
};
/// `h`: [s]. Both ends under the controls of the step.
StepEnergyBalance between(const Audit& start, const Audit& end, double h);

/// Scratch for audits of batches of a model. One per thread.
class EnergyBalanceReader {
 public:
  explicit EnergyBalanceReader(const Model& model);
  ~EnergyBalanceReader();
  EnergyBalanceReader(EnergyBalanceReader&&) noexcept;
  EnergyBalanceReader& operator=(EnergyBalanceReader&&) noexcept;

  /// `u`: (nu) controls of the environment, as a step takes them.
  Audit audit(const Batch& batch, int environment, std::span<const double> u);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
