// SPDX-License-Identifier: Apache-2.0
// Energy and momentum of an environment, work of motors, and dissipation by damping and friction.
// The remaining change of energy in a step is the error of the integrator.
#pragma once

#include <array>
#include <memory>
#include <span>

#include "engine/step/batch.hpp"

namespace tangere {

/// One environment at one instant.
struct EnergyBalance {
  double kinetic = 0;      ///< energy of moving bodies [J]
  double potential = 0;    ///< -Σ m gravity·x [J]
  double elastic = 0;      ///< by springs, limits and contacts: Σ k_n d²/2 [J]
  double motor_power = 0;  ///< power of the motors [W]
  double dissipation = 0;  ///< power that damping and friction take [W]
  /// Of all bodies: linear [kg m/s], then angular about the world's origin [kg m²/s], world axes.
  std::array<double, 6> momentum{};
  [[nodiscard]] double energy() const { return kinetic + potential + elastic; }
};

/// Work and dissipation in one step, by the trapezoid rule over its two ends [J].
struct StepEnergyBalance {
  double motor_work = 0;        ///< work of the motors
  double dissipated = 0;        ///< by damping and friction
  double integrator_error = 0;  ///< by the scheme: the change of energy less motors, plus taken
};
/// `h`: [s]. Both ends under the controls of the step.
StepEnergyBalance between(const EnergyBalance& start, const EnergyBalance& end, double h);

/// Totals over all steps and environments of a run.
struct EnergyBalanceSummary {
  double motors = 0, taken = 0, made = 0;  ///< sums over environments and steps [J]
  /// The largest |sum of integrator errors| of an environment, divided by the largest of: kinetic +
  /// elastic energy, work of motors, dissipation.
  double worst_share = 0;
  int worst_environment = 0;
};

/// Scratch for audits of batches of a model. One per thread.
class EnergyBalanceReader {
 public:
  explicit EnergyBalanceReader(const Model& model);
  ~EnergyBalanceReader();
  EnergyBalanceReader(EnergyBalanceReader&&) noexcept;
  EnergyBalanceReader& operator=(EnergyBalanceReader&&) noexcept;

  /// `u`: (nu) controls of the environment, as a step takes them.
  EnergyBalance read(const Batch& batch, int environment, std::span<const double> u);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
