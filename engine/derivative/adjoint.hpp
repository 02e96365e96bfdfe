// SPDX-License-Identifier: Apache-2.0
// The reverse sweep over a taped rollout, block by block and step by step. It takes any number of
// losses at once.
#pragma once

#include <memory>
#include <span>

#include "engine/derivative/block_cotangent.hpp"
#include "engine/step/stepper.hpp"
#include "engine/step/tape.hpp"

namespace tangere {

struct AdjointOptions {
  int losses = 1;
  bool parameters = false;  ///< also differentiate by the scene's numbers
  bool points = false;      ///< also differentiate by every tactile point's own numbers
};

/// Adds the cotangents of joints that follow others, of one lane, to those of their leaders, and
/// clears them. reverse_step() does that with those before the first step of a tape; a caller that
/// then adds to those of the start does it again. `state`: that of the block there
/// (BlockTape::state). `block`: its numbers (Batch::block).
void fold_followers(const Model& model, BlockCotangent& cotangent, int lane, const double* state,
                    const double* block);

/// Owns the scratch of one thread. Reverses steps of any batch of its model that a Stepper with the
/// same options took.
class Adjoint {
 public:
  explicit Adjoint(const Model& model, const StepperOptions& options = {},
                   const AdjointOptions& requested = {});
  ~Adjoint();
  Adjoint(Adjoint&&) noexcept;
  Adjoint& operator=(Adjoint&&) noexcept;

  /// Sets all cotangents to zero. The newest state is then the one after the last step.
  void clear();
  [[nodiscard]] int losses() const;
  /// Cotangents of loss k. The caller adds the derivative of the loss by the newest state to
  /// (q, v).
  [[nodiscard]] BlockCotangent& loss(int k);
  [[nodiscard]] const BlockCotangent& loss(int k) const;

  /// Turns the cotangents of the states after steps `step` + 1 and `step` into those after `step`
  /// and `step` - 1, and sets u. `batch` supplies its parameters; its state is not read.
  /// `controls`: (E, nu), those of that step. An environment that failed stands still from then on:
  /// its cotangents pass unchanged through steps that it did not take.
  void reverse_step(const Batch& batch, int block, const BlockTape& tape, std::int64_t step,
                    std::span<const double> controls);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
