// SPDX-License-Identifier: Apache-2.0
// Counts what steps took and which environments failed in them, in one way for rollouts, episodes,
// benchmarks and gradients.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/step/batch.hpp"
#include "kernels/numbers/block.hpp"

namespace tangere {

/// An environment for which no solution was found. It keeps the state before that step.
struct FailedEnvironment {
  int environment;
  std::int64_t step;  ///< the first that failed; -1: before this run
  StepStatus status;  ///< why
};

/// Number of environments in a block.
inline int lanes_of(const Batch& batch, int block) {
  return std::min(kernels::kBlock, batch.environments() - block * kernels::kBlock);
}

struct StepTally {
  std::int64_t environment_steps = 0;  ///< tried, failing ones included
  std::int64_t newton_iterations = 0;
  std::int64_t split_steps = 0;
  std::int64_t coarse_steps = 0;   ///< with parts that missed the accuracy that was asked for
  std::int64_t passed_steps = 0;   ///< in which a body came through another
  std::int64_t damped_steps = 0;   ///< that would have created energy
  std::int64_t bodies_asleep = 0;  ///< summed over environment_steps
  std::vector<FailedEnvironment> failures;  ///< in the order in which they failed

  /// Counts `environments` environments from number `first` on. Construct it before the first step.
  StepTally(const Batch& batch, int first, int environments)
      : first_(first), live_(static_cast<std::size_t>(environments)) {
    for (int e = first; e < first + environments; ++e) {
      live_[lane(e)] = !failed(batch.status(e));
      if (!live_[lane(e)]) failures.push_back({e, -1, batch.status(e)});
    }
  }

  /// Whether an environment takes a step, or has just taken one that is not counted yet.
  [[nodiscard]] bool steps(const Batch& batch, int environment) const {
    return live_[lane(environment)] && !batch.held(environment);
  }
  [[nodiscard]] bool live(int environment) const { return live_[lane(environment)]; }

  /// Counts step `step` after it was taken.
  void count(const Batch& batch, std::int64_t step) {
    for (int e = first_; e < first_ + static_cast<int>(live_.size()); ++e) {
      if (!steps(batch, e)) continue;
      const StepStatus status = batch.status(e);
      ++environment_steps;
      newton_iterations += batch.iterations(e);
      split_steps += status == StepStatus::split ? 1 : 0;
      coarse_steps += status == StepStatus::coarse ? 1 : 0;
      passed_steps += status == StepStatus::passed ? 1 : 0;
      damped_steps += status == StepStatus::damped ? 1 : 0;
      bodies_asleep += batch.sleep(e).bodies;
      if (!failed(status)) continue;
      failures.push_back({e, step, status});
      live_[lane(e)] = false;
    }
  }

 private:
  [[nodiscard]] std::size_t lane(int environment) const {
    return static_cast<std::size_t>(environment - first_);
  }
  int first_;
  std::vector<bool> live_;
};

}  // namespace tangere
