// SPDX-License-Identifier: Apache-2.0
// The reverse sweep over a taped rollout, block by block and step by step, for any number of losses
// at once.
#pragma once

#include <memory>
#include <span>

#include "engine/step/stepper.hpp"
#include "engine/step/tape.hpp"

namespace tangere {

/// Cotangents of one loss in one block, rows of 16 lanes: dof i of lane l at [i * 16 + l].
/// Positions by their right tangent (docs/gradients.md).
struct BlockCotangent {
  AlignedVector<double> q, v;                    ///< (nv, 16) of the newest state
  AlignedVector<double> previous_q, previous_v;  ///< (nv, 16) of the state one step before it
  AlignedVector<double> u;  ///< (nu, 16) of the controls of the step reversed last
  /// (parameter_rows, 16), summed over steps (engine/derivative/number_gradients.hpp); or empty
  AlignedVector<double> parameters;
  /// (16, tactile points, kPointNumbers), the same (engine/derivative/tactile_point_numbers.hpp)
  AlignedVector<double> points;

  /// A lane's part of those, of one sensor; empty if there are none.
  [[nodiscard]] std::span<double> points_of(const Model& model, int sensor, int lane);
};

struct AdjointOptions {
  int losses = 1;
  bool parameters = false;  ///< derivatives by the scene's numbers too
  bool points = false;      ///< and by every tactile point's own
};

/// Owns the scratch of one thread. Reverses steps of any batch of its model that a Stepper with the
/// same options took.
class Adjoint {
 public:
  explicit Adjoint(const Model& model, const StepperOptions& options = {},
                   const AdjointOptions& wanted = {});
  ~Adjoint();
  Adjoint(Adjoint&&) noexcept;
  Adjoint& operator=(Adjoint&&) noexcept;

  /// All cotangents to zero: the state after the last step is the newest.
  void clear();
  [[nodiscard]] int losses() const;
  /// Of loss k: what the caller adds to (q, v) is the derivative of the loss by the newest state.
  [[nodiscard]] BlockCotangent& loss(int k);
  [[nodiscard]] const BlockCotangent& loss(int k) const;

  /// Takes the cotangents of the states after steps `step` + 1 and `step` to those after `step` and
  /// `step` - 1, and sets u. `batch` supplies its parameters, its state is not read; `controls`:
  /// (E, nu), those of that step. An environment that failed stands still from then on: its
  /// cotangents pass through steps that it did not take.
  void reverse_step(const Batch& batch, int block, const BlockTape& tape, std::int64_t step,
                    std::span<const double> controls);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
