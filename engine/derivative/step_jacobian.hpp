// SPDX-License-Identifier: Apache-2.0
// The Jacobian of a taped step: how the state after it hangs on the states and controls before it.
// One assembly and one factorisation for all of its rows.
#pragma once

#include "engine/derivative/adjoint.hpp"

namespace tangere {

/// Of one environment, row-major. Rows: displacement and velocity after the step, (2 nv); columns
/// likewise, positions along the dofs of v, rotations on the right.
struct StepJacobian {
  std::vector<double> state;  ///< (2 nv, 2 nv) by the state before the step
  std::vector<double>
      previous;           ///< (2 nv, 2 nv) by the state one step earlier: not zero under BDF2 alone
  std::vector<double> u;  ///< (2 nv, nu) by its controls
};

/// Owns the scratch of one thread.
class StepJacobians {
 public:
  explicit StepJacobians(const Model& model, const StepperOptions& options = {});

  /// Step `step` of a block's tape; `controls`: (E, nu), those of that step.
  void evaluate(const Batch& batch, int block, const BlockTape& tape, std::int64_t step,
                std::span<const double> controls);
  /// Of lane `lane` of that block.
  void get(int lane, StepJacobian& out) const;

 private:
  int nv_, nu_;
  Adjoint adjoint_;
};

}  // namespace tangere
