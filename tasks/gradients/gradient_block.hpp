// SPDX-License-Identifier: Apache-2.0
// One block through a rollout and back: forward with tapes or checkpoints, then stretch by stretch
// from the end. What a stretch is, how it is stepped and how derivatives enter and leave is said by
// the losses of a scene (loss_block.hpp) and by the return of a task (return_block.hpp).
#pragma once

#include <algorithm>
#include <functional>
#include <vector>

#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/readout_pullback.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/run/block_threads.hpp"

namespace tangere {

/// How a rollout lies on tapes, each of which holds a stretch of it.
struct TapePlan {
  std::int64_t stretches = 1;  ///< of a rollout
  std::int64_t steps = 1;      ///< of a stretch; the last one may have fewer
  std::int64_t segment = 1;    ///< stretches on tapes at a time
  [[nodiscard]] bool whole() const { return segment == stretches; }
};

/// Of `all` units of a rollout those on tapes at a time: all, or as many as make tapes and
/// checkpoints together smallest. `bytes_with`: of tapes of so many and the checkpoints between
/// them; `one`: of a unit's tape [bytes]. Throws InputError when they do not fit into `most` bytes.
std::int64_t units_on_tape(const Model& model, std::int64_t all, double one, double most,
                           const std::function<double(std::int64_t)>& bytes_with,
                           const char* units);
/// Of a block [bytes].
double checkpoint_bytes(const Model& model);

/// Scratch of one thread.
class GradientBlock {
 public:
  virtual ~GradientBlock() = default;
  GradientBlock(GradientBlock&&) noexcept = default;

  /// Counts from 0; `go_on` (empty: always) must outlive the runs that follow.
  void begin(const GradientGoOn& go_on);
  [[nodiscard]] bool stopped() const { return stopped_; }
  [[nodiscard]] std::int64_t newton_iterations() const { return newton_iterations_; }
  [[nodiscard]] std::int64_t recomputed_steps() const { return recomputed_steps_; }

 protected:
  GradientBlock(const Model& model, const StepperOptions& stepper, const AdjointOptions& wanted,
                const TapePlan& plan);

  /// Forward and back, from the state that `block` has.
  void run(Batch& batch, int block);
  /// False: nobody goes on.
  virtual bool begin_stretch(std::int64_t stretch) = 0;
  /// Onto `tape`, if any, which is begun anew.
  virtual void take_steps(std::int64_t stretch, BlockTape* tape) = 0;
  /// The same steps again, from a checkpoint or from where the stretch before ended.
  virtual void retake_steps(std::int64_t stretch, bool from_checkpoint, BlockTape& tape) = 0;
  /// From the state after a stretch, whose cotangents stand in the adjoint, to that before it.
  virtual void reverse(std::int64_t stretch, const BlockTape& tape) = 0;

  [[nodiscard]] bool may_go_on();
  /// Derivatives by a lane's first state and by the scene's numbers; what is empty is left out.
  void get_start(int loss, const Batch& batch, int environment, std::span<double> q,
                 std::span<double> v, std::span<double> parameters, std::span<double> points) const;

  Model model_;
  Adjoint adjoint_;
  ReadoutPullback pullback_;
  NumberGradients parameters_;
  TapePlan plan_;
  std::int64_t taken_ = 0;  // stretches
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
