// SPDX-License-Identifier: Apache-2.0
// A part of a model as a model of its own: some kinematic trees, for steps in which the others
// sleep, or all of them without the contacts that never push.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Returns the tree of each link. Joints and loops make a tree; the world connects nothing.
std::vector<int> trees_of(const CompiledModel& m);

/// Whether a contact with these coefficients can ever have a force: friction is bounded by μ|N|.
inline bool can_exert_force(const kernels::ContactParameters& p) {
  return p.kn.value != 0 || p.kn.row >= 0 || p.damping.value != 0 || p.damping.row >= 0;
}

/// A part of a model. Rows of the batch's blocks that parameters name are those of the whole model,
/// which must outlive its parts.
struct ModelPart {
  CompiledModel model;  ///< the members that a step reads: links, dofs and contacts of the part
  std::vector<int> q,
      v;  ///< (nq), (nv) coordinates and dofs of the part: their number in the whole
};

/// Returns the sub-model without the trees that are marked in `left_out` and without contacts with
/// them. `tree`: tree of each link. `left_out`: (trees) 1: left out; at least one must be 0. The
/// model must have no shear springs.
std::unique_ptr<ModelPart> part_of(const CompiledModel& whole, std::span<const int> tree,
                                   std::span<const std::uint8_t> left_out);

/// Returns the model without contacts that can never exert a force (can_exert_force()). Null if all
/// can, and for models with shear springs.
std::unique_ptr<ModelPart> without_inert_contacts(const CompiledModel& whole);

}  // namespace tangere
