// SPDX-License-Identifier: Apache-2.0
// Kinematics of eight environments at a time and the shapes that meet a pad, prepared for the
// tactile kernels.
#pragma once

#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/step/batch.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere {

/// Owns the scratch of one thread.
class PadReader {
 public:
  explicit PadReader(const Model& model);

  /// Computes poses and twists of all links in group `group` (0 or 1) of a block.
  void move(const Batch& batch, int block, int group);
  /// Returns a link's pose and twist in lane `lane` of a group; those of the world for link -1.
  [[nodiscard]] kernels::LinkPose<double> link(int link, int group, int lane) const;

  /// Computes pose and motion of every sensed shape in the pad's axes, in the group of the last
  /// move().
  void find_touches(const Batch& batch, int block, int group, int sensor);
  /// Returns the kernel arguments for one environment of a group after find_touches(). Of the
  /// outputs, only the list of tiles, `active`, is set.
  template <class Real>
  kernels::TactileArgs<Real> arguments(int sensor, int group, int lane);
  /// Returns the arguments for one group (double) or both (float).
  template <class Real>
  kernels::TactileBlockArgs<Real> block_arguments(int sensor, int group);

  std::vector<int> active;

 private:
  using Rows = AlignedVector<kernels::LaneRow>;
  static constexpr int kGroups = kernels::kBlock / kernels::kGroup;

  /// Returns the shapes that a sensor senses, with the sizes of one lane.
  const kernels::TouchShape* shapes(int sensor, int group, int lane);

  struct Pad {
    kernels::PadTiles tiles;
    std::vector<kernels::TouchShape> shapes;
  };
  Model model_;
  Rows q_, v_, zero_, rates_;
  AlignedVector<kernels::LinkPose<kernels::LaneRow>> links_;  // (kGroups, n_links)
  std::vector<Pad> pads_;                                     // per sensor
  AlignedVector<kernels::Touch<kernels::LaneRow>> touches_;   // (targets, kGroups)
  std::vector<const kernels::Touch<kernels::LaneRow>*> group_touches_;
  std::vector<kernels::Touch<double>> one_;      // (targets) of one environment
  std::vector<kernels::TouchShape> one_shapes_;  // (targets)
  AlignedVector<kernels::LaneRow> sizes_;  // (targets, kGroups, 3) of shapes whose size varies
};

/// Runs the kernel of a field's precision.
inline int run_tactile(const kernels::TactileArgs<double>& a) {
  return kernels::active_kernels().tactile(a);
}
inline int run_tactile(const kernels::TactileArgs<float>& a) {
  return kernels::active_kernels().tactile_mixed(a);
}
inline void run_tactile(const kernels::TactileBlockArgs<double>& a) {
  kernels::active_kernels().tactile_block(a);
}
inline void run_tactile(const kernels::TactileBlockArgs<float>& a) {
  kernels::active_kernels().tactile_block_mixed(a);
}

}  // namespace tangere
