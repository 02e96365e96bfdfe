// SPDX-License-Identifier: Apache-2.0
// What a TaskTape records, and derivatives that its callers hand in.
#pragma once

#include <cstdint>
#include <span>

#include "engine/base/precision.hpp"
#include "engine/step/stepper.hpp"

namespace tangere {

struct TaskTapeOptions {
  std::uint64_t seed = 0;
  std::int64_t first_episode = 0;  ///< of environment 0
  std::int64_t actions = 0;        ///< of an episode, at most; 0: the task's horizon
  int threads = 1;
  /// Steps are solved to kGradientTolerance where neither these nor the scene name a tolerance.
  StepperOptions stepper;
  Precision precision = Precision::mixed;  ///< of tactile fields; derivatives are in double
  bool parameters =
      false;  ///< also by the scene's numbers (engine/derivative/number_gradients.hpp)
  /// Limit for the tapes of all environments together [bytes]. Longer episodes are run again from
  /// checkpoints, with the same bits.
  double tape_bytes = 1e9;
};

/// Derivatives of a loss by the states after an action; empty spans mean zeros.
struct StateCotangents {
  std::span<const double> q, v;  ///< (E, nv), q along the dofs of v
};

}  // namespace tangere
