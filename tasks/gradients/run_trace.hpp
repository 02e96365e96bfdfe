// SPDX-License-Identifier: Apache-2.0
// Active sets of the steps of a rollout: touching points, active limits, status of each step. A
// rollout is differentiable where neighbouring rollouts have the same active sets.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "engine/sense/contact_state.hpp"
#include "engine/sense/readout.hpp"

namespace tangere {

/// Of up to 16 environments, which are one block of a batch.
class RunTrace {
 public:
  explicit RunTrace(const Model& model);

  /// Adds the present states of the batch's first block, which is of the model or of one that
  /// differs in numbers.
  void add(const Batch& batch);
  /// Returns one sentence for each contact, limit, sensor and status in which an environment of
  /// this trace first differs from one of another; none if they agree.
  [[nodiscard]] std::vector<std::string> differences(int environment, const RunTrace& other,
                                                     int environment_of_other) const;

 private:
  struct Decisions {
    ContactState contact;
    std::vector<int> loaded_points;  // (sensors) points with a force
    StepStatus status = StepStatus::converged;
  };
  void compare(std::size_t state, const Decisions& a, const Decisions& b,
               std::vector<bool>& reported, std::vector<std::string>& to) const;

  Model model_;                                 // for names
  std::vector<std::vector<Decisions>> states_;  // (states, environments)
};

/// Returns one sentence for each flaw of the model's sensors without a derivative: quantisation and
/// saturation.
std::vector<std::string> sensors_without_derivative(const Model& model);

}  // namespace tangere
