// SPDX-License-Identifier: Apache-2.0
// Checks of solved steps: tunnelling, velocity jumps, energy gain, rotation
// (GroupStep::solve_and_check).
#pragma once

#include <vector>

#include "engine/step/newton.hpp"
#include "engine/step/step_settings.hpp"
#include "engine/step/tunnelling_check.hpp"
#include "engine/step/workspace.hpp"

namespace tangere {

/// Lanes that converged, and among them those to reject: a body passed through another, energy was
/// created, or a body rotated too far for the scheme.
struct CheckedSolve {
  LaneBits found = 0, tunnelled = 0, energy_created = 0, over_rotated = 0;
  [[nodiscard]] LaneBits accepted() const {
    return found & ~(tunnelled | energy_created | over_rotated);
  }
};

/// The checked solve started at q0, v0 of the workspace and ended in q1, v1.
class StepChecks {
 public:
  StepChecks(const CompiledModel& model, const StepSettings& settings);

  /// Marks lanes in which a body passed through one of its contact partners.
  template <int L>
  void find_tunnelling(const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                       NewtonReport& report) const;
  /// Returns the lanes whose velocities jumped.
  template <int L>
  LaneBits velocity_jumps(const BasicWorkspace<L>& w, LaneBits lanes, double h) const;
  /// Returns the lanes whose solve created energy.
  template <int L>
  LaneBits energy_gains(const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                        double h) const;
  /// Returns the lanes in which a body rotated too far for the scheme of the solve. Bodies in
  /// contact are not checked, because the scheme may damp them.
  template <int L>
  LaneBits over_rotations(const Scheme& scheme, const kernels::KernelTable& table,
                          BasicWorkspace<L>& w, LaneBits lanes, double h) const;

 private:
  template <int L>
  void find_poses(const kernels::KernelTable& table, BasicWorkspace<L>& w) const;

  const CompiledModel& model_;
  bool bounded_energy_, cut_;  ///< StepSettings::bounded_energy; accuracy > 0
  TunnellingCheck tunnelling_;
  std::vector<double> component_mass_;  ///< [kg] without densities that vary
};

}  // namespace tangere
