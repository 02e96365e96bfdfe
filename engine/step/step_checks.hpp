// SPDX-License-Identifier: Apache-2.0
// Checks of the roots of attempts (engine/step/attempt.hpp): tunnelling, velocity jumps, energy
// gain, rotation.
#pragma once

#include <array>
#include <vector>

#include "engine/step/step_settings.hpp"
#include "engine/step/tunnelling_check.hpp"

namespace tangere {

/// Why an attempt at a step is rejected, as bits.
enum Failure : unsigned {
  kNoRoot = 1,
  kTunnelled = 2,      ///< a body passed through one of its contact partners
  kEnergyCreated = 4,  ///< of attempts that are not kTunnelled
  kOverRotated = 8,    ///< a body rotated too far for the scheme, of attempts with neither of these
  kInaccurate = 16,    ///< the estimated error is larger than the accuracy allows
  kAnyFailure = 31
};

class StepChecks {
 public:
  StepChecks(const CompiledModel& model, const StepSettings& settings);

  /// Returns a Failure of each lane, or 0, after a solve by a scheme over a time h [s] that started
  /// at q0, v0 of the workspace and ended in q1, v1 in the lanes `found`. The others have kNoRoot,
  /// and so have lanes of `softened` whose velocities jumped: forces that no search could follow
  /// from the first guess and that throw bodies about are not smooth, as schemes of higher order
  /// assume. Shorter parts resolve them.
  template <int L>
  std::array<unsigned, L> failures(const Scheme& scheme, const kernels::KernelTable& table,
                                   BasicWorkspace<L>& w, LaneBits found, LaneBits softened,
                                   const kernels::Row<L>& h) const;

 private:
  const CompiledModel& model_;
  bool bounded_energy_, cut_;  ///< StepSettings::bounded_energy; accuracy > 0
  TunnellingCheck tunnelling_;
  std::vector<double> component_mass_;  ///< [kg] without densities that vary
};

}  // namespace tangere
