// SPDX-License-Identifier: Apache-2.0
// One implicit step of a batch: predict, detect, Newton in lanes, commit. Lanes that fail are split
// and solved alone.
#pragma once

#include <memory>
#include <span>

#include "engine/step/batch.hpp"
#include "engine/step/stepper_options.hpp"

namespace tangere {

class BlockTape;

/// Returns the scheme that a stepper of these options takes. Throws like its constructor.
Integrator integrator_in_force(const Model& model, const StepperOptions& options);

/// Owns the scratch of one thread. Steps any batch of its model. Results do not depend on which
/// Stepper ran.
class Stepper {
 public:
  explicit Stepper(const Model& model, const StepperOptions& options = {});
  ~Stepper();
  Stepper(Stepper&&) noexcept;
  Stepper& operator=(Stepper&&) noexcept;

  [[nodiscard]] double timestep() const;        ///< the one in force [s]
  [[nodiscard]] Integrator integrator() const;  ///< the one in force
  [[nodiscard]] double tolerance() const;
  [[nodiscard]] double accuracy() const;  ///< 0: every step is one part
  [[nodiscard]] double sleep() const;     ///< 0: no body sleeps

  /// Advances every environment that has not failed by one step. `controls`: (E, nu), clipped to
  /// the motors' range. Throws InputError for a batch of another Model and for controls of another
  /// length.
  void step(Batch& batch, std::span<const double> controls);

  /// The same for one block of 16. `controls`: (E, nu) of the whole batch. The resulting states are
  /// added to `tape`. Also throws InputError for a block that does not exist, and if there is a
  /// tape and bodies may sleep.
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
