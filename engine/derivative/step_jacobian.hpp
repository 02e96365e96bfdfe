// SPDX-License-Identifier: Apache-2.0
// The Jacobian of a taped step: how the state after it depends on the states and controls before
// it. One assembly and one factorisation serve all of its rows.
#pragma once

#include "engine/derivative/adjoint.hpp"

namespace tangere {

/// The Jacobian of one environment, row-major. Rows: displacement and velocity after the step,
/// (2 nv). Columns likewise; positions along the dofs of v, rotations on the right.
struct StepJacobian {
  std::vector<double> state;  ///< (2 nv, 2 nv) by the state before the step
  /// (2 nv, 2 nv) by the state one step earlier: not zero only under BDF2.
  std::vector<double> previous;
  std::vector<double> u;  ///< (2 nv, nu) by the controls of the step
};

/// Owns the scratch of one thread.
class StepJacobians {
 public:
  explicit StepJacobians(const Model& model, const StepperOptions& options = {});

  /// Evaluates step `step` of a block's tape. `controls`: (E, nu), those of that step.
  void evaluate(const Batch& batch, int block, const BlockTape& tape, std::int64_t step,
                std::span<const double> controls);
  /// Copies the Jacobian of lane `lane` of that block.
  void get(int lane, StepJacobian& out) const;

 private:
  int nv_, nu_;
  Adjoint adjoint_;
};

}  // namespace tangere
