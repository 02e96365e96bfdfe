// SPDX-License-Identifier: Apache-2.0
// How tactile fields change with the state: ∂T/∂(q, v) times a direction, without the matrix. It
// suits forward derivatives (few inputs, all points of a field). ReadoutPullback is the transpose.
#pragma once

#include <memory>
#include <span>

#include "engine/step/batch.hpp"

namespace tangere {

/// Owns the scratch of one thread. Allocates only when made. Call place(), then for a lane move()
/// and any number of fields.
class FieldTangent {
 public:
  explicit FieldTangent(const Model& model);
  ~FieldTangent();
  FieldTangent(FieldTangent&&) noexcept;
  FieldTangent& operator=(FieldTangent&&) noexcept;

  /// Computes poses and twists of the environments of a block in their present state.
  void place(const Batch& batch, int block);
  /// Sets how lane `lane` of the block changes: (nv) each, q along the dofs of v.
  void move(int lane, std::span<const double> q, std::span<const double> v);
  /// Computes how the field of a sensor in that lane changes. `tiles` as CompactFrame::tiles;
  /// `change`: (tiles, 3, 8, 8) out [N]. Which points touch, slip or are clamped stays fixed.
  void field(int sensor, std::span<const int> tiles, std::span<double> change);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
