// SPDX-License-Identifier: Apache-2.0
// Scratch of one thread: one group of eight lanes through one step. Nothing here outlives a step.
#pragma once

#include <Eigen/LU>
#include <cstdint>
#include <vector>

#include "engine/aligned.hpp"
#include "engine/compiled_model.hpp"
#include "kernels/kernel_table.hpp"

namespace tangere {

/// Bit l: lane l of the group.
using LaneBits = unsigned;
inline constexpr LaneBits kNoLane = 0;
inline constexpr LaneBits kAllLanes = (1U << kernels::kGroup) - 1;
inline bool has(LaneBits bits, int lane) { return ((bits >> lane) & 1U) != 0; }

struct Workspace {
  explicit Workspace(const CompiledModel& model);
  static std::size_t bytes(const CompiledModel& model);

  using Rows = AlignedVector<kernels::LaneRow>;
  Rows memory;               ///< every row below, in one allocation
  AlignedVector<std::byte> scratch;
  std::vector<kernels::GroupStage::List> lists;
  LaneBits in_rows = 0;      ///< lanes whose lists stand in the rows as well
  kernels::GroupStage stage;

  // The group's states: now, one step before, and the result of the solve in hand.
  kernels::LaneRow *q0, *v0, *q_before, *v_before, *q1, *v1;
  // SDIRK2's first stage, relative to q0.
  kernels::LaneRow *x_gamma, *v_gamma;
  // Newton: direction, point it starts from, natural test vector.
  kernels::LaneRow *delta, *base, *test, *poses;
  kernels::LaneRow sound;
  std::vector<Eigen::PartialPivLU<Eigen::MatrixXd>> pivoted;  ///< (8) factor of lanes whose plain LU is useless
  std::vector<Eigen::MatrixXd> dense;                         ///< (1) the matrix being factored
  Eigen::VectorXd rhs;
};

}  // namespace tangere
