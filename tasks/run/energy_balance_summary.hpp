// SPDX-License-Identifier: Apache-2.0
// The sum of the books of energy that a rollout keeps.
#pragma once

namespace tangere {

/// What the books of a run come to.
struct EnergyBalanceSummary {
  double motors = 0, taken = 0, made = 0;  ///< sums over environments and steps [J]
  /// The largest |sum of what the scheme made| of an environment, as a share of what it had: the
  /// largest energy of motion and held, what motors did, or what was taken, whichever is most.
  double worst_share = 0;
  int worst_environment = 0;
};

}  // namespace tangere
