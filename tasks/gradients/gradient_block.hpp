// SPDX-License-Identifier: Apache-2.0
// One block through a rollout and back: the tape, the readings that losses look at, and the reverse
// sweep.
#pragma once

#include <array>
#include <vector>

#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/readout_pullback.hpp"
#include "engine/sense/readout.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/loss_reading.hpp"

namespace tangere {

/// Scratch of one thread.
class GradientBlock {
 public:
  GradientBlock(const Model& model, const GradientOptions& options,
                std::span<const RolloutLoss* const> losses);

  /// Steps block `block` of `batch` forward and back. Results go to `out`, failures and counts
  /// included; blocks of one batch may run at the same time.
  void run(Batch& batch, int block, const StepControls& controls, std::span<double> u,
           GradientSummary& out, std::vector<FailedEnvironment>& failures);

  /// Counts from 0; `go_on` (empty: always) must outlive the runs that follow.
  void begin(const GradientGoOn& go_on) {
    go_on_ = &go_on;
    newton_iterations_ = recomputed_steps_ = 0;
    stopped_ = false;
  }
  [[nodiscard]] bool stopped() const { return stopped_; }
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
  [[nodiscard]] bool may_go_on();
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
  std::int64_t segment_;  // steps on the tape at a time
  Stepper stepper_;
  Readout readout_;
  ReadoutPullback pullback_;
  Adjoint adjoint_;
  BlockTape tape_;
  std::vector<BlockState> checkpoints_;
  std::vector<std::vector<CompactFrame<double>>> frames_;  // (sensors, 16)
  LossReading reading_;
  NumberGradients parameters_;
  const GradientGoOn* go_on_ = nullptr;
  bool stopped_ = false;
  std::int64_t newton_iterations_ = 0, recomputed_steps_ = 0;
};

}  // namespace tangere
