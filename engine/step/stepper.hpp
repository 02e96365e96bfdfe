// SPDX-License-Identifier: Apache-2.0
// One implicit step of a batch: first guess, contact detection, Newton's method in lanes, new
// states. Lanes without a solution are solved again alone, in shorter parts.
#pragma once

#include <memory>
#include <span>

#include "engine/step/batch.hpp"
#include "engine/step/stepper_options.hpp"

namespace tangere {

class BlockTape;

/// Returns the scheme of a Stepper with these options. Throws like its constructor.
Integrator integrator_in_force(const Model& model, const StepperOptions& options);

/// Steps any batch of its model, and owns the scratch of one thread. Results do not depend on which
/// Stepper of a model and its options takes a step.
class Stepper {
 public:
  /// Throws InputError for a number of `options` that is out of its range, for an accuracy that the
  /// scheme cannot keep, and for sleep where the scene has ks or the steps are differentiable.
  explicit Stepper(const Model& model, const StepperOptions& options = {});
  ~Stepper();
  Stepper(Stepper&&) noexcept;
  Stepper& operator=(Stepper&&) noexcept;

  [[nodiscard]] double timestep() const;        ///< the one in force [s]
  [[nodiscard]] Integrator integrator() const;  ///< the one in force
  [[nodiscard]] double tolerance() const;       ///< of the scaled residual, dimensionless
  [[nodiscard]] double accuracy() const;        ///< relative, of the parts of a step; 0: one part
  [[nodiscard]] double sleep() const;           ///< share of its size, per body; 0: no body sleeps

  /// Advances every environment that is neither failed nor held by one step of timestep(). Where no
  /// solution is found, the environment keeps its state and gets a negative StepStatus; this is no
  /// exception. `controls`: (E, nu), in [-1, 1] for force motors and in units of q for position
  /// motors, clipped to the motors' range. Throws InputError for a batch of another Model and for
  /// controls of another length.
  void step(Batch& batch, std::span<const double> controls);

  /// The same for one block of 16. `controls`: (E, nu) of the whole batch. The resulting states are
  /// added to `tape`, if there is one. Also throws InputError for a block that does not exist, and
  /// if there is a tape and bodies may sleep.
  void step_block(Batch& batch, int block, std::span<const double> controls,
                  BlockTape* tape = nullptr);

  /// Size of the scratch of a stepper of this model [bytes].
  static std::size_t workspace_bytes(const Model& model);
  /// Estimated memory of the contact candidates that steps leave in a batch, of each of its
  /// environments [bytes].
  static std::size_t candidate_bytes(const Model& model);

 private:
  void check(const Batch& batch, std::span<const double> controls) const;

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
