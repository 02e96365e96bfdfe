// SPDX-License-Identifier: Apache-2.0
// What a gradient is taken of: a sum over the states of a rollout, of numbers and of what is read
// from them.
#pragma once

#include <cstdint>
#include <span>

#include "engine/sense/tactile_frame.hpp"

namespace tangere {

/// One environment after `step` of `steps` steps.
struct LossPoint {
  std::int64_t step, steps;
  int environment;                        ///< of the batch
  std::span<const double> q, v;           ///< (nq), (nv)
  std::span<const double> u;              ///< (nu) of the step that follows; empty after the last
  std::span<const double> end_effectors;  ///< (n, 3) end effectors [m]; empty unless asked for
  std::span<const CompactFrame<double>* const>
      fields;  ///< of every sensor [N]; empty unless asked for
};

/// Where a loss adds its derivatives: by q along the dofs of v, rotations on the right
/// (docs/gradients.md), by the others number by number. Spans are as long as what they are
/// derivatives by, zeros to begin with.
struct LossCotangent {
  std::span<double> q, v;  ///< (nv), (nv)
  std::span<double> u, end_effectors;
  std::span<const std::span<double>> fields;  ///< as CompactFrame::values(), of the same tiles
};

/// Called for every environment and step, last step first, from several threads at once.
class RolloutLoss {
 public:
  virtual ~RolloutLoss() = default;
  /// Whether it looks at tactile fields or end effectors there.
  [[nodiscard]] virtual bool reads_fields(std::int64_t /*step*/) const { return false; }
  [[nodiscard]] virtual bool reads_end_effectors(std::int64_t /*step*/) const { return false; }
  /// Its share at a state. The loss of a rollout is the sum.
  virtual double evaluate(const LossPoint& at, const LossCotangent& out) const = 0;
};

}  // namespace tangere
