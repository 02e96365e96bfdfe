// SPDX-License-Identifier: Apache-2.0
// Which episodes of a task are differentiated, and what comes of it.
#pragma once

#include <cstdint>
#include <vector>

#include "tasks/gradients/gradient_options.hpp"

namespace tangere {

struct TaskGradientOptions {
  std::int64_t episodes = 0, first_episode = 0;
  std::uint64_t seed = 0;
  std::int64_t actions = 0;  ///< of an episode, at most; 0: the task's horizon
  int threads = 1;
  StepperOptions stepper;
  Precision precision =
      Precision::mixed;  ///< of the tactile fields in moments; derivatives are in double
  bool parameters =
      false;  ///< also by the scene's numbers (engine/derivative/number_gradients.hpp)
  /// Limit for the states on a thread's tapes [bytes]. Longer episodes are run again from
  /// checkpoints, with the same bits.
  double tape_bytes = 1e9;
};

/// Results for every episode, A = actions. The reset (settling, an opening) and all random draws
/// count as given.
struct TaskGradients : GradientCounts {
  std::vector<double> value;         ///< (E) sum of rewards until the end
  std::vector<std::int64_t> length;  ///< (E) actions until the end
  std::vector<double> action;        ///< (E, A, action) as chosen; zeros after the end
  std::vector<double> by_action;     ///< (E, A, action); 0 for a component beyond its bounds
  std::vector<double> by_q,
      by_v;  ///< (E, nv) by the state at the first action, positions along the dofs of v
  std::vector<double> by_parameter;  ///< (E, NumberGradients::count()) or empty
};

}  // namespace tangere
