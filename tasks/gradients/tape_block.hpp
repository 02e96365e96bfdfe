// SPDX-License-Identifier: Apache-2.0
// The primitive of all gradients of rollouts: one block forward onto tapes, segment by segment with
// a checkpoint before each, then back from the last state to the first. Cotangents enter on the way
// back. Derived classes define the steps of a tape and what enters and leaves: losses of a scene
// (scene_block.hpp), or rewards, observations and states of a task (task_block.hpp).
#pragma once

#include <functional>
#include <stop_token>
#include <vector>

#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/readout_pullback.hpp"
#include "tasks/gradients/tape_options.hpp"

namespace tangere {

/// How a rollout is split into tapes: of a scene one for each segment, of a task one for each
/// action.
struct TapePlan {
  std::int64_t tapes = 1;    ///< of a rollout
  std::int64_t steps = 1;    ///< on each; the last one may have fewer
  std::int64_t segment = 1;  ///< tapes between two checkpoints, all in memory at once
  [[nodiscard]] bool whole() const { return segment == tapes; }
};

/// Returns how many of a rollout's `all` units are on tape at a time: all, or the number that makes
/// tapes and checkpoints together smallest. `bytes_with(n)`: tapes of n units and the checkpoints
/// between them [bytes]. `one`: the tape of one unit [bytes]. Throws InputError when they do not
/// fit into `most` bytes.
std::int64_t units_on_tape(const Model& model, std::int64_t all, double one, double most,
                           const std::function<double(std::int64_t)>& bytes_with,
                           const char* units);
/// Size of the checkpoints of `all` units in segments of n; 0 if there is only one [bytes].
double checkpoint_bytes(const Model& model, std::int64_t all, std::int64_t n);

/// Scratch of one thread, or one block of a TaskTape.
class TapeBlock {
 public:
  virtual ~TapeBlock() = default;
  TapeBlock(TapeBlock&&) noexcept = default;

  /// Sets the counts to 0. `stop`: checked before every step.
  void begin(std::stop_token stop);
  [[nodiscard]] bool stopped() const { return stopped_; }
  [[nodiscard]] std::int64_t newton_iterations() const { return newton_iterations_; }
  [[nodiscard]] std::int64_t recomputed_steps() const { return recomputed_steps_; }

 protected:
  TapeBlock(const Model& model, const TapeOptions& options, int losses, const TapePlan& plan);

  /// `record`: whether the steps that follow can be reversed.
  void start_forward(bool record = true);
  /// Takes the steps of the next tape, after a checkpoint where one is due.
  void take_tape(Batch& batch, int block);
  /// Sets all cotangents to zero after the last tape. May be called again to go back again.
  void start_back();
  /// Reverses the last tape that is not reversed yet. Recomputes its segment if it is not on tape.
  void reverse_tape(Batch& batch, int block);
  /// Takes the steps of tape number k. Clears `tape`, if any, and records them on it.
  virtual void take_steps(std::int64_t k, BlockTape* tape) = 0;
  /// Takes the same steps again, from a checkpoint or from the end of the tape before.
  virtual void retake_steps(std::int64_t k, bool from_checkpoint, BlockTape& tape) = 0;
  /// Moves the adjoint's cotangents from the state after a tape to the state before it.
  virtual void reverse_steps(std::int64_t k, const BlockTape& tape) = 0;

  [[nodiscard]] bool may_go_on();
  /// Fills derivatives by a lane's first state and by the scene's numbers. Skips empty spans.
  void get_start(int loss, const Batch& batch, int environment, std::span<double> q,
                 std::span<double> v, std::span<double> parameters, std::span<double> points) const;

  Model model_;
  Adjoint adjoint_;
  ReadoutPullback pullback_;
  NumberGradients parameters_;
  TapePlan plan_;
  std::int64_t taken_ = 0;  // tapes
  std::int64_t left_ = 0;   // of these, to reverse
  std::int64_t newton_iterations_ = 0;

 private:
  std::vector<BlockTape> tapes_;  // (segment)
  std::vector<BlockState> checkpoints_;
  std::stop_token stop_;
  bool stopped_ = false;
  std::int64_t recomputed_steps_ = 0;
  bool recording_ = true;
};

}  // namespace tangere
