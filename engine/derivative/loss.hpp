// SPDX-License-Identifier: Apache-2.0
// The loss whose gradient is taken: a sum over the states of a rollout. It may use numbers of the
// state and readings of it.
#pragma once

#include <cstdint>
#include <span>

#include "engine/sense/tactile_frame.hpp"

namespace tangere {

/// One environment after `step` of `steps` steps.
struct LossPoint {
  std::int64_t step, steps;
  int environment;               ///< of the batch
  std::span<const double> q, v;  ///< (nq), (nv)
  std::span<const double> u;     ///< (nu) controls of the step that follows; empty after the last
  std::span<const double> end_effectors;  ///< (n, 3) end effectors [m]; empty unless requested
  /// Fields of every sensor [N]; empty unless requested.
  std::span<const CompactFrame<double>* const> fields;
};

/// Where a loss adds its derivatives: by q along the dofs of v, rotations on the right
/// (docs/gradients.md), by the others number by number. Each span has the shape of the quantity
/// that it holds derivatives by, and is zero to begin with.
struct LossCotangent {
  std::span<double> q, v;  ///< (nv), (nv)
  std::span<double> u, end_effectors;
  std::span<const std::span<double>> fields;  ///< as CompactFrame::values(), for the same tiles
};

/// Called for every environment and step, last step first, from several threads at once.
class RolloutLoss {
 public:
  virtual ~RolloutLoss() = default;
  /// Whether the loss reads tactile fields or end effectors at that step.
  [[nodiscard]] virtual bool reads_fields(std::int64_t /*step*/) const { return false; }
  [[nodiscard]] virtual bool reads_end_effectors(std::int64_t /*step*/) const { return false; }
  /// Returns its share at a state. The loss of a rollout is the sum of these.
  virtual double evaluate(const LossPoint& at, const LossCotangent& out) const = 0;
};

}  // namespace tangere
