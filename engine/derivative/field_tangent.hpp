// SPDX-License-Identifier: Apache-2.0
// How tactile fields change with the state: ∂T/∂(q, v) times a direction, without the matrix. For
// what is derived forward (a few inputs, all points of a field); ReadoutPullback is the transpose.
#pragma once

#include <memory>
#include <span>

#include "engine/step/batch.hpp"

namespace tangere {

/// Owns the scratch of one thread; allocates only when made. place(), then for a lane move() and
/// any number of fields.
class FieldTangent {
 public:
  explicit FieldTangent(const Model& model);
  ~FieldTangent();
  FieldTangent(FieldTangent&&) noexcept;
  FieldTangent& operator=(FieldTangent&&) noexcept;

  /// Poses and twists of the environments of a block in their present state.
  void place(const Batch& batch, int block);
  /// How lane `lane` of the block changes: (nv) each, q along the dofs of v.
  void move(int lane, std::span<const double> q, std::span<const double> v);
  /// How the field of a sensor in that lane changes with it: of `tiles` (CompactFrame::tiles),
  /// (tiles, 3, 8, 8) out [N]. Where a point touches, slips or is clamped stays as it is.
  void field(int sensor, std::span<const int> tiles, std::span<double> change);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tangere
