// SPDX-License-Identifier: Apache-2.0
// Takes one block through a rollout and back: forward with tapes or checkpoints, then stretch by
// stretch from the end. Derived classes define a stretch, its steps, and how derivatives enter and
// leave: the losses of a scene (loss_block.hpp) and the actions of a task (action_block.hpp).
#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/readout_pullback.hpp"
#include "tasks/gradients/gradient_options.hpp"
#include "tasks/run/block_threads.hpp"

namespace tangere {

/// How a rollout is split into tapes. Each tape holds a stretch of it.
struct TapePlan {
  std::int64_t stretches = 1;  ///< in a rollout
  std::int64_t steps = 1;      ///< in a stretch; the last one may have fewer
  std::int64_t segment = 1;    ///< stretches that are on tapes at a time
  [[nodiscard]] bool whole() const { return segment == stretches; }
};

/// Returns how many of a rollout's `all` units are on tapes at a time: all, or the number that
/// makes tapes and checkpoints together smallest. `bytes_with(n)`: tapes of n units and the
/// checkpoints between them [bytes]. `one`: the tape of one unit [bytes]. Throws InputError when
/// they do not fit into `most` bytes.
std::int64_t units_on_tape(const Model& model, std::int64_t all, double one, double most,
                           const std::function<double(std::int64_t)>& bytes_with,
                           const char* units);
/// Size of a block's checkpoint [bytes].
double checkpoint_bytes(const Model& model);

/// Scratch of one thread.
class GradientBlock {
 public:
  virtual ~GradientBlock() = default;
  GradientBlock(GradientBlock&&) noexcept = default;

  /// Sets the counts to 0. An empty `go_on` means always; it must outlive the runs that follow.
  void begin(const GradientGoOn& go_on);
  [[nodiscard]] bool stopped() const { return stopped_; }
  [[nodiscard]] std::int64_t newton_iterations() const { return newton_iterations_; }
  [[nodiscard]] std::int64_t recomputed_steps() const { return recomputed_steps_; }

 protected:
  GradientBlock(const Model& model, const StepperOptions& stepper, const AdjointOptions& wanted,
                const TapePlan& plan);

  /// Runs forward and back from the current state of `block`.
  void run(Batch& batch, int block);
  // The parts of run(), for callers that choose when to go on and when to go back: start_forward;
  // begin_stretch and take_stretch for each stretch; start_back; then reverse_stretch for each.
  void start_forward();
  /// Takes the steps of the stretch that has begun, with a checkpoint before it where one is due.
  void take_stretch(Batch& batch, int block);
  /// Sets all cotangents to zero after the last stretch. May be called again to go back again.
  void start_back();
  /// Reverses the last stretch that is not reversed yet. Steps that are on no tape are taken again.
  void reverse_stretch(Batch& batch, int block);
  /// Returns false when no environment goes on.
  virtual bool begin_stretch(std::int64_t stretch) = 0;
  /// Takes the steps of a stretch. Clears `tape`, if any, and records them on it.
  virtual void take_steps(std::int64_t stretch, BlockTape* tape) = 0;
  /// Takes the same steps again, from a checkpoint or from the end of the stretch before.
  virtual void retake_steps(std::int64_t stretch, bool from_checkpoint, BlockTape& tape) = 0;
  /// Moves the adjoint's cotangents from the state after a stretch to the state before it.
  virtual void reverse(std::int64_t stretch, const BlockTape& tape) = 0;

  [[nodiscard]] bool may_go_on();
  /// Fills derivatives by a lane's first state and by the scene's numbers. Skips empty spans.
  void get_start(int loss, const Batch& batch, int environment, std::span<double> q,
                 std::span<double> v, std::span<double> parameters, std::span<double> points) const;

  Model model_;
  Adjoint adjoint_;
  ReadoutPullback pullback_;
  NumberGradients parameters_;
  TapePlan plan_;
  std::int64_t taken_ = 0;  // stretches
  std::int64_t left_ = 0;   // of these, to reverse
  std::int64_t newton_iterations_ = 0;

 private:
  std::vector<BlockTape> tapes_;  // (segment)
  std::vector<BlockState> checkpoints_;
  const GradientGoOn* go_on_ = nullptr;
  bool stopped_ = false;
  std::int64_t recomputed_steps_ = 0;
};

/// Takes all blocks forward and back on all threads, `run` one of them with a worker of a thread;
/// fills in what a summary counts. The same bits for any number of threads.
template <class Worker, class Run>
void run_gradients(BlockThreads& threads, std::vector<Worker>& workers, int blocks,
                   const GradientGoOn& go_on, GradientCounts& out, const Run& run) {
  std::vector<std::vector<FailedEnvironment>> failures(static_cast<std::size_t>(blocks));
  for (Worker& worker : workers) worker.begin(go_on);
  threads.for_each(blocks, workers, [&](Worker& worker, int b) {
    run(worker, b, failures[static_cast<std::size_t>(b)]);
  });
  for (const auto& of_block : failures)
    out.failures.insert(out.failures.end(), of_block.begin(), of_block.end());
  std::sort(out.failures.begin(), out.failures.end(),
            [](const auto& a, const auto& b) { return a.environment < b.environment; });
  for (const Worker& worker : workers) {
    out.newton_iterations += worker.newton_iterations();
    out.recomputed_steps += worker.recomputed_steps();
    out.stopped = out.stopped || worker.stopped();
  }
}

}  // namespace tangere
