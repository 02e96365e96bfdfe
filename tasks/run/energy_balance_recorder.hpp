// SPDX-License-Identifier: Apache-2.0
// Records the energy balance of a rollout at both ends of every step of every environment.
#pragma once

#include <span>
#include <vector>

#include "engine/sense/energy_balance.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

class EnergyBalanceRecorder {
 public:
  /// `h`: of the steps [s].
  EnergyBalanceRecorder(const Batch& batch, double h);

  /// Computes row 0.
  void start();
  /// Reads the batch before a step. `u`: (E, nu).
  void before(std::span<const double> u);
  /// Computes the row after a step that was taken but not counted yet.
  void after(std::span<const double> u, const StepTally& tally);

  /// (E, 3) kinetic, potential and elastic energy [J]; (E, 6) linear and angular momentum.
  [[nodiscard]] std::span<const double> energy() const { return energy_; }
  [[nodiscard]] std::span<const double> momentum() const { return momentum_; }
  /// (E, 3) work of motors, dissipation and change by the scheme in the last step [J]. Zeros where
  /// an environment took no step.
  [[nodiscard]] std::span<const double> passed() const { return passed_; }

  [[nodiscard]] EnergyBalanceSummary summary() const;
  static double bytes(int environments);

 private:
  [[nodiscard]] EnergyBalance audit(int environment, std::span<const double> u);
  void set_row(int environment, const EnergyBalance& audit);

  const Batch& batch_;
  double h_;
  EnergyBalanceReader auditor_;
  std::vector<EnergyBalance> before_;               // (E)
  std::vector<double> energy_, momentum_, passed_;  // as above
  struct Sums {
    double motors = 0, taken = 0, made = 0, work = 0, most = 0;
  };
  std::vector<Sums> sums_;  // (E)
};

}  // namespace tangere
