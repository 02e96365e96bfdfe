// SPDX-License-Identifier: Apache-2.0
// One block through a rollout and back: the tape, the readings that losses look at, and the reverse sweep.
#pragma once

#include <array>
#include <vector>

#include "engine/parameters.hpp"
#include "engine/readout.hpp"
#include "engine/readout_pullback.hpp"
#include "tasks/gradients.hpp"

namespace tangere {

/// Scratch of one thread.
class GradientBlock {
 public:
  GradientBlock(const Model& model, const GradientOptions& options, std::span<const RolloutLoss* const> losses);

  /// Steps block `block` of `batch` forward and back. Results go to `out`, failures and counts included; blocks of one batch
  /// may run at the same time.
  void run(Batch& batch, int block, const StepControls& controls, std::span<double> u, GradientSummary& out,
           std::vector<FailedEnvironment>& failures);

  void clear_counts() { newton_iterations_ = recomputed_steps_ = 0; }
  [[nodiscard]] std::int64_t newton_iterations() const { return newton_iterations_; }
  [[nodiscard]] std::int64_t recomputed_steps() const { return recomputed_steps_; }

 private:
  struct InHand {
    Batch& batch;
    int block, first, last;
    const StepControls& controls;
    std::span<double> u;
    GradientSummary& out;
  };
  void step(const InHand& h, std::int64_t t, BlockTape* tape);
  void forward(const InHand& h, std::vector<FailedEnvironment>& failures);
  void backward(const InHand& h);
  void reverse_segment(const InHand& h, std::int64_t begin, std::int64_t end);
  void look(const InHand& h, std::int64_t step);
  void judge(const InHand& h, std::int64_t step, std::size_t loss, int e);
  void read(const InHand& h, std::int64_t step);
  void finish(const InHand& h);

  Model model_;
  GradientOptions options_;
  std::vector<const RolloutLoss*> losses_;
  std::int64_t segment_;                    // steps on the tape at a time
  Stepper stepper_;
  Readout readout_;
  ReadoutPullback pullback_;
  Adjoint adjoint_;
  BlockTape tape_;
  std::vector<BlockState> checkpoints_;
  std::vector<std::vector<CompactFrame<double>>> frames_;  // (sensors, 16)
  std::vector<std::vector<double>> field_cotangents_;      // (sensors) of the environment in hand
  bool fields_read_ = false;                               // at the state in hand
  std::vector<const CompactFrame<double>*> fields_;        // (sensors) of the environment in hand
  std::vector<std::span<double>> cotangents_;              // (sensors) spans of field_cotangents_
  std::vector<double> q_, v_, variables_, q_bar_, v_bar_, u_bar_, variables_bar_;
  Parameters parameters_;
  std::int64_t newton_iterations_ = 0, recomputed_steps_ = 0;
};

}  // namespace tangere
