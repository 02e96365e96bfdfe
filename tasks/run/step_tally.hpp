// SPDX-License-Identifier: Apache-2.0
// Counts evaluations of steps and failed environments, for rollouts, episodes, benchmarks and
// gradients.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "engine/step/batch.hpp"
#include "tasks/run/step_counts.hpp"

namespace tangere {

/// Number of environments in a block.
inline int lanes_of(const Batch& batch, int block) {
  return std::min(kernels::kBlock, batch.environments() - block * kernels::kBlock);
}

struct StepTally {
  StepCounts counts;                        ///< of steps tried, failing ones included
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
      counts.count(batch, e);
      if (!failed(batch.status(e))) continue;
      failures.push_back({e, step, batch.status(e)});
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
