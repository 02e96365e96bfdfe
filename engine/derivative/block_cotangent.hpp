// SPDX-License-Identifier: Apache-2.0
// Cotangents of losses with respect to the state of one block.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/model/model.hpp"

namespace tangere {

/// Cotangents of one loss in one block, in rows of 16 lanes: dof i of lane l is at [i * 16 + l].
/// Positions are by their right tangent (docs/gradients.md).
struct BlockCotangent {
  AlignedVector<double> q, v;                    ///< (nv, 16) of the newest state
  AlignedVector<double> previous_q, previous_v;  ///< (nv, 16) of the state one step before it
  /// (past states, 2, nv, 16) of q and v of the states 1, 2 … steps before the newest, which
  /// sensors with lag read. Empty: zeros.
  AlignedVector<double> past{};
  AlignedVector<double> u;  ///< (nu, 16) of the controls of the step reversed last
  /// Of the shear state at the newest state: for each lane, three numbers for each of its entries
  /// (engine/step/shear_state.hpp). Empty: zeros.
  std::array<std::vector<double>, 16> shear;
  /// (parameter_rows, 16), summed over steps (engine/derivative/number_gradients.hpp); or empty
  AlignedVector<double> parameters;
  /// (16, tactile points, kPointNumbers), summed over steps
  /// (engine/derivative/tactile_point_numbers.hpp); or empty
  AlignedVector<double> points;

  /// One lane's part of `points` for one sensor; empty if there are none.
  [[nodiscard]] std::span<double> points_of(const Model& model, int sensor, int lane);
};

}  // namespace tangere
