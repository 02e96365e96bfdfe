// SPDX-License-Identifier: Apache-2.0
// Summary of the energy balance of a rollout.
#pragma once

namespace tangere {

/// Totals over all steps and environments of a run.
struct EnergyBalanceSummary {
  double motors = 0, taken = 0, made = 0;  ///< sums over environments and steps [J]
  /// The largest |sum of integrator errors| of an environment, divided by the largest of: kinetic +
  /// elastic energy, work of motors, dissipation.
  double worst_share = 0;
  int worst_environment = 0;
};

}  // namespace tangere
