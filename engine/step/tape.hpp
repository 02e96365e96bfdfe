// SPDX-License-Identifier: Apache-2.0
// Tape of one block's rollout for the reverse sweep: states, inner stages, and the solves of steps
// that were not plain steps of the scheme.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/model/model.hpp"
#include "engine/step/shear_state.hpp"

namespace tangere {

class Batch;

/// One solve of a step that differs from a plain step: a start, or a part of a split step.
struct TapedSolve {
  Integrator integrator;
  double h;                   ///< [s]
  std::vector<double> q, v;   ///< its result: (nq), (nv)
  std::vector<double> inner;  ///< inner stages relative to the solve's start, (inner_stages, nv)
  ShearState memory;          ///< shear state after it
};

/// The solves of one environment's step, first to last.
struct TapedStep {
  std::int64_t step;
  int lane;  ///< of the block
  std::vector<TapedSolve> solves;
};

/// States of the 16 environments of a block after 0, 1, … steps, and one step before the first.
class BlockTape {
 public:
  /// Makes room for `steps` steps, with the inner stages of schemes that have some.
  BlockTape(const Model& model, Integrator integrator, std::int64_t steps);

  /// Clears the tape and stores the states of a block as step 0.
  void start(const Batch& batch, int block);
  /// Adds the present states of a block. Lanes that have failed or are held keep theirs.
  void append(const Batch& batch, int block);
  /// Where to write the inner stages of the step that is appended next, rows (inner_stages, nv,
  /// 16); null when the scheme has none.
  [[nodiscard]] double* next_inner();
  void add(TapedStep step) { special_.push_back(std::move(step)); }

  /// Copies the states after `step` steps, and their steps since the start of the episodes, into a
  /// block, for reading, with the earlier states that sensors with lag read. The state one step
  /// before is not restored.
  void show(std::int64_t step, Batch& batch, int block) const;

  [[nodiscard]] std::int64_t steps() const { return steps_; }
  /// Rows (nq + nv, 16) after `step` steps. -1: one step before the first.
  [[nodiscard]] const double* state(std::int64_t step) const {
    return states_.data() + std::size_t(step + 1) * row_count_ * 16;
  }
  /// Rows (inner_stages, nv, 16) of step `step`, each relative to where the step began.
  [[nodiscard]] const double* inner(std::int64_t step) const {
    return state(step + 1) + std::size_t(nq_ + nv_) * 16;
  }
  /// Shear state after `step` steps.
  [[nodiscard]] std::span<const ShearEntry> memory(std::int64_t step, int lane) const;
  /// The solves of one environment's step; null for a plain step.
  [[nodiscard]] const TapedStep* special(std::int64_t step, int lane) const;
  /// Whether the environment took that step.
  [[nodiscard]] bool took(std::int64_t step, int lane) const {
    return step < taken_[std::size_t(lane)];
  }
  /// Steps of the lane's episode until the state after `step` steps.
  [[nodiscard]] std::int64_t episode_step(std::int64_t step, int lane) const {
    return before_[std::size_t(lane)] + std::min(step, taken_[std::size_t(lane)]);
  }
  /// Size of a block's tape for this many steps [bytes].
  static std::size_t bytes(const Model& model, Integrator integrator, std::int64_t steps);

 private:
  static int rows(const Model& model, Integrator integrator);
  double* slot(std::int64_t step) {
    return states_.data() + std::size_t(step + 1) * row_count_ * 16;
  }
  void copy(const Batch& batch, int block, int first_row, double* to) const;
  void keep_memory(const Batch& batch, int block);
  void show_past(std::int64_t step, int lane, double* column) const;

  Model model_;
  int nq_, nv_;
  std::size_t row_count_;
  std::int64_t steps_ = 0;
  AlignedVector<double> states_;      // (steps + 2, rows, 16)
  std::vector<TapedStep> special_;    // rising steps
  std::vector<std::int64_t> taken_;   // (16)
  std::vector<std::int64_t> before_;  // (16) steps of the episodes before the tape began
  std::vector<double> past_;          // rows of earlier states in the block when the tape began
  // Shear states, and the end of each lane's part: (steps + 1, 16). Empty without shear springs.
  ShearState memory_;
  std::vector<std::size_t> memory_end_;
};

}  // namespace tangere
