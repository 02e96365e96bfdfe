// SPDX-License-Identifier: Apache-2.0
// Which contact points touch and which joint limits act in a state: the decisions of a step that a
// small change of its inputs may turn round.
#pragma once

#include <vector>

#include "engine/sense/pad_reader.hpp"

namespace tangere {

/// Of one environment.
struct ContactState {
  std::vector<int> touching;  ///< (contacts of the model) points whose depth is positive
  /// (nv) -1 below its lower limit, 1 above its upper limit, else 0; 0 for ball joints.
  std::vector<int> beyond;
  friend bool operator==(const ContactState&, const ContactState&) = default;
};

/// Owns the scratch of one thread.
class ContactStateReader {
 public:
  explicit ContactStateReader(const Model& model) : model_(model), reader_(model) {}

  /// Reads the environments of a block, in their order.
  [[nodiscard]] std::vector<ContactState> read(const Batch& batch, int block);

 private:
  Model model_;
  PadReader reader_;
};

/// Of the points of one contact.
struct PointDepths {
  double deepest = 0;  ///< [m]; 0: none touches
  int touching = 0;
};
/// Returns those of a pair in one lane of a group that `reader` moved last. `block`: the numbers of
/// its block (rows, 16).
PointDepths pair_depths(const kernels::PairContact& pair, const PadReader& reader, int group,
                        int lane, const double* block);
/// The same for the points of a link above the ground of `view`.
PointDepths ground_depths(const kernels::GroundContact& ground, const kernels::ModelView& view,
                          const PadReader& reader, int group, int lane);

}  // namespace tangere
