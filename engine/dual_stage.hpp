// SPDX-License-Identifier: Apache-2.0
// One environment's stage in dual numbers: the plain templates of the kernels with a tangent beside every input. Slow; for
// tangents that the adjoint is checked against, and for the adjoint of the linearly implicit step.
#pragma once

#include <vector>

#include "engine/compiled_model.hpp"
#include "kernels/dual.hpp"
#include "kernels/kernel_table.hpp"

namespace tangere {

using DualNumber = kernels::Dual<double>;

/// Inputs are set by the caller; contacts are summed over every point of a pair, none is culled.
class DualStage {
 public:
  explicit DualStage(const CompiledModel& model);
  ~DualStage();

  std::vector<DualNumber> centre, x, r, s, tau, target;  ///< (nq), (nv) …
  double c0_over_h = 0, inverse_h = 0;
  std::vector<DualNumber> v, g;                          ///< out, (nv)

  /// Value and tangent of a number that the scene gives; rows of the block are those of `block_rows`.
  void set_block(const double* column);
  DualNumber& contact(bool ground, int k, int field);      ///< kn, kt, mu, damping
  DualNumber& dof(int dof, int field);                     ///< damping, stiffness, P, D

  /// v and g.
  void residual();
  /// v alone.
  void rates();
  /// Everything: then jacobian_entry and products are there.
  void evaluate();
  [[nodiscard]] DualNumber entry(int i, int j) const;
  /// M λ and Cᵀ λ by the sweeps of the adjoint.
  void products(const std::vector<double>& lambda, std::vector<DualNumber>& c_lambda, std::vector<DualNumber>& m_lambda);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
