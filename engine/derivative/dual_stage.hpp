// SPDX-License-Identifier: Apache-2.0
// One environment's stage in dual numbers: the plain templates of the kernels with a tangent beside
// every input. Slow. For tangents that the adjoint is checked against, and for the adjoint of the
// linearly implicit step.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "engine/model/compiled_model.hpp"
#include "kernels/numbers/dual.hpp"

namespace tangere {

using DualNumber = kernels::Dual<double>;

/// Inputs are set by the caller. Contacts are summed over the points that touch.
class DualStage {
 public:
  explicit DualStage(const CompiledModel& model);
  ~DualStage();

  std::vector<DualNumber> centre, x, r, s, tau, target;  ///< (nq), then (nv) each
  double c0_over_h = 0, inverse_h = 0;
  std::vector<DualNumber> v, g;  ///< (nv) out

  /// The numbers of an environment whose column of a block this is, and their tangents:
  /// (parameter_numbers) as in kernels/table/kernel_table.hpp; empty: zeros.
  void set_numbers(const double* column, std::span<const double> tangents = {});

  /// While frozen, the numbers' tangents count as zero.
  void freeze_numbers(bool frozen);

  /// v and g; the tangents of masses included.
  void residual();
  /// v alone.
  void rates();

  /// How the field of a sensor, (points, 3), changes at the state centre ⊕ 0 with twist r
  /// (c0_over_h = 0, inverse_h = 1). `numbers`: tangents as rows of BlockCotangent::parameters,
  /// `points`: (points, kPointNumbers) of every point's own; or empty.
  void field(int sensor, const double* column, std::span<const double> numbers,
             std::span<const double> points, std::span<double> field_dot);

  /// For the values: A of residual() by its tangent inputs, (n, n) row-major, and its own tangents.
  void jacobian(std::vector<DualNumber>& A);
  /// After jacobian(): Cᵀ λ, M λ and the targets' cotangents, (nv) each, and parameter_products(),
  /// added to `numbers`.
  void products(std::span<const double> lambda, std::vector<DualNumber>& c_lambda,
                std::vector<DualNumber>& m_lambda, std::vector<DualNumber>& targets,
                std::vector<DualNumber>* numbers);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
