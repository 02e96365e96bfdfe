// SPDX-License-Identifier: Apache-2.0
// Copies earlier states of one environment into the lanes of a block, so that a sensor with lag
// reads 16 of them at once.
#pragma once

#include "engine/model/compiled_model.hpp"
#include "engine/step/batch.hpp"

namespace tangere {

/// Owns the scratch of one thread. Allocates only when made.
class PastStates {
 public:
  explicit PastStates(const Model& model);

  /// Writes the states of an environment as it was `lag`, `lag` + 1 … steps ago to the first
  /// `count` lanes, with the environment's own numbers. count ≤ kernels::kBlock.
  void recall(const Batch& batch, int environment, int lag, int count);
  /// One block; its environments are the lanes.
  [[nodiscard]] const Batch& lanes() const { return lanes_; }

 private:
  Model model_;
  Batch lanes_;
};

}  // namespace tangere
