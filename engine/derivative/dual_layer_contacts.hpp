// SPDX-License-Identifier: Apache-2.0
// Contacts of layers of one environment in dual numbers (engine/layer/layer_contact.hpp).
#pragma once

#include <span>
#include <vector>

#include "engine/layer/layer_contact.hpp"
#include "kernels/step/stage.hpp"

namespace tangere {

/// Points of every pair that touch.
struct DualCandidates {
  using D = kernels::Dual<double>;
  std::span<const std::vector<D>> places;     ///< (n, 3) body 1's axes
  std::span<const std::vector<int>> numbers;  ///< (n) in PairContact::points
  std::span<const std::vector<D>> anchors;    ///< (n, kAnchorNumbers), or empty
};

class DualLayerContacts {
 public:
  using D = kernels::Dual<double>;
  explicit DualLayerContacts(const CompiledModel& model);

  /// Computes the wrenches. `view`: with parameters in rows of `block`. `contacts`: motions of the
  /// link pairs.
  /// `frozen`: the material does not change.
  void compute(const kernels::ModelView& view, std::span<const kernels::ContactScratch<D>> contacts,
               const DualCandidates& candidates, const double* block, bool frozen);
  /// Sets how the material of a pad's layer changes along the tangents. Stays zero until then.
  void set_material(std::size_t pad, const LayerMaterial& dot) { materials_[pad] = dot; }
  /// As StageArgs::layer_sums, wrenches alone.
  [[nodiscard]] const kernels::PairSums<D>* sums() const { return sums_.data(); }

 private:
  LayerCandidates values_in_rows(const DualCandidates& candidates, std::size_t pair);
  void add_bodies(const kernels::ModelView& view, const kernels::LinkPair& links,
                  const kernels::ContactScratch<D>& motion, int pad,
                  const DualCandidates& candidates, const double* block);

  const std::vector<LayerPad>& pads_;
  std::vector<kernels::PairSums<D>> sums_;
  std::vector<LayerMaterial> materials_;  // (pads) tangents
  LayerContact contact_;
  std::vector<int> members_;                   // pairs of its bodies
  std::vector<kernels::LayerBody<D>> bodies_;  // parallel
  AlignedVector<double> rows_;                 // values of candidates: places, then anchors
};

}  // namespace tangere
