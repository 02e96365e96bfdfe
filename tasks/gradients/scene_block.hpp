// SPDX-License-Identifier: Apache-2.0
// The tape of a scene's losses: each loss is evaluated at every state, and its derivatives by the
// state, the readings and the controls enter there.
#pragma once

#include <memory>
#include <vector>

#include "engine/derivative/loss.hpp"
#include "engine/sense/readout.hpp"
#include "tasks/gradients/tape_block.hpp"
#include "tasks/run/step_tally.hpp"

namespace tangere {

/// The inputs of a loss at one environment's state, and room for its derivatives by them. Made once
/// and used for state after state.
class LossReading {
 public:
  explicit LossReading(const Model& model);

  /// Sets a sensor's field that has been read already. The frame must outlive the next evaluate().
  void set_field(std::size_t sensor, const CompactFrame<double>& frame) {
    fields_[sensor] = &frame;
  }
  /// Reads an environment's fields and sets them.
  void read_fields(const Batch& batch, Readout& readout, int environment);
  [[nodiscard]] const CompactFrame<double>& field(std::size_t sensor) const {
    return *fields_[sensor];
  }
  /// Reads the rest and evaluates. `u`: controls of the step that follows; empty after the last.
  double evaluate(const RolloutLoss& loss, const Batch& batch, Readout& readout, int environment,
                  std::int64_t step, std::int64_t steps, std::span<const double> u);

  // Derivatives of the loss evaluated last; those by end effectors and fields only if it reads
  // them.
  [[nodiscard]] std::span<const double> q_bar() const { return q_bar_; }
  [[nodiscard]] std::span<const double> v_bar() const { return v_bar_; }
  [[nodiscard]] std::span<const double> u_bar() const {
    return u_bar_;
  }  ///< zeros after the last step
  [[nodiscard]] std::span<const double> end_effectors_bar() const { return end_effectors_bar_; }
  [[nodiscard]] std::span<const double> field_bar(std::size_t sensor) const {
    return field_bars_[sensor];
  }

 private:
  std::vector<double> q_, v_, end_effectors_, q_bar_, v_bar_, u_bar_, end_effectors_bar_;
  std::vector<const CompactFrame<double>*> fields_;         // (sensors)
  std::vector<std::unique_ptr<CompactFrame<double>>> own_;  // (sensors), if read_fields was called
  std::vector<std::vector<double>> field_bars_;             // (sensors)
  std::vector<std::span<double>> field_spans_;
};

class SceneBlock : public TapeBlock {
 public:
  SceneBlock(const Model& model, const TapeOptions& options,
             std::span<const RolloutLoss* const> losses);

  /// Writes results to `out` and failures of the block to `failures`. Blocks of one batch may run
  /// at the same time. `u`: room for the batch's controls.
  void run(Batch& batch, int block, const StepControls& controls, std::span<double> u,
           GradientSummary& out, std::vector<FailedEnvironment>& failures);

 private:
  struct Context {
    Batch& batch;
    int block, first, last;
    const StepControls& controls;
    std::span<double> u;
    GradientSummary& out;
    StepTally tally;
  };
  void take_steps(std::int64_t segment, BlockTape* tape) override;
  void retake_steps(std::int64_t segment, bool from_checkpoint, BlockTape& tape) override;
  void reverse_steps(std::int64_t segment, const BlockTape& tape) override;
  [[nodiscard]] std::int64_t end_of(std::int64_t segment) const;
  std::span<const double> evaluate_controls(std::int64_t step, int environment);
  void step(std::int64_t step, BlockTape* tape);
  void add_losses(std::int64_t step);
  void add_loss(std::int64_t step, std::size_t loss, int environment);
  void finish();

  TapeOptions options_;
  std::vector<const RolloutLoss*> losses_;
  Stepper stepper_;
  Readout readout_;
  std::vector<std::vector<CompactFrame<double>>> frames_;  // (sensors, 16)
  LossReading reading_;
  Context* context_ = nullptr;  // set during run()
};

}  // namespace tangere
