// SPDX-License-Identifier: Apache-2.0
// Losses of a scene: one block of a batch through its rollout and back, the losses looking at every
// state on the way.
#pragma once

#include <vector>

#include "engine/sense/readout.hpp"
#include "tasks/gradients/gradient_block.hpp"
#include "tasks/gradients/loss_reading.hpp"

namespace tangere {

class LossBlock : public GradientBlock {
 public:
  LossBlock(const Model& model, const GradientOptions& options,
            std::span<const RolloutLoss* const> losses);

  /// Results go to `out`, failures of the block to `failures`; blocks of one batch may run at the
  /// same time. `u`: room for the batch's controls.
  void run(Batch& batch, int block, const StepControls& controls, std::span<double> u,
           GradientSummary& out, std::vector<FailedEnvironment>& failures);

 private:
  struct InHand {
    Batch& batch;
    int block, first, last;
    const StepControls& controls;
    std::span<double> u;
    GradientSummary& out;
    StepTally tally;
  };
  bool begin_stretch(std::int64_t) override { return true; }
  void take_steps(std::int64_t stretch, BlockTape* tape) override;
  void retake_steps(std::int64_t stretch, bool from_checkpoint, BlockTape& tape) override;
  void reverse(std::int64_t stretch, const BlockTape& tape) override;
  [[nodiscard]] std::int64_t end_of(std::int64_t stretch) const;
  void ask(std::int64_t step);
  void look(std::int64_t step);
  void judge(std::int64_t step, std::size_t loss, int e);
  void read(std::int64_t step);
  void finish();

  GradientOptions options_;
  std::vector<const RolloutLoss*> losses_;
  Stepper stepper_;
  Readout readout_;
  std::vector<std::vector<CompactFrame<double>>> frames_;  // (sensors, 16)
  LossReading reading_;
  InHand* hand_ = nullptr;  // of run()
};

}  // namespace tangere
