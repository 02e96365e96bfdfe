// SPDX-License-Identifier: Apache-2.0
// Scratch of one thread for one step of a group of eight lanes, or of a single lane. Only lists of
// candidates outlive the step.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/base/aligned.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/step/block_factors.hpp"
#include "engine/step/broad_phase.hpp"
#include "engine/step/candidate_lists.hpp"
#include "engine/step/lane_bits.hpp"
#include "engine/step/pivoted_factors.hpp"
#include "engine/step/shear_state.hpp"
#include "engine/step/touching_sensor_points.hpp"
#include "kernels/table/kernel_table.hpp"

namespace tangere {

/// Returns the dofs of a component of a scene.
inline std::span<const int> dofs_of_component(const CompiledModel& model, int component) {
  const std::size_t c = std::size_t(component), begin = std::size_t(model.component_begin[c]);
  return std::span(model.component_dofs)
      .subspan(begin, std::size_t(model.component_begin[c + 1]) - begin);
}

/// The largest number of inner stages of a scheme in the table.
inline constexpr int kInnerStages = 1;

/// Shear states of the lanes of a group, and scratch. Empty without shear springs.
template <int L>
struct ShearLanes {
  using Poses = AlignedVector<kernels::LinkPose<kernels::Row<L>>>;
  std::array<ShearState, L> now, after;  ///< where a solve begins, and at its end
  Poses start, end;                      ///< (n_links) poses there
  /// (n_shear_springs) of each contact with shear springs: the touched shape in body 1, and W.
  Poses start_touches, end_touches;
  std::vector<unsigned char> start_known;  ///< (n_shear_springs) 1: start_touches has it
  /// (n_shear_springs) lanes in which points of a contact may touch at the end.
  std::vector<LaneBits> near;
  std::vector<int> touching;              ///< contacts with such lanes
  AlignedVector<kernels::Row<L>> ground;  ///< (points on the ground, 4)
  std::vector<int> grounded;              ///< those of them that touch in some lane
  AlignedVector<double> ground_anchors;   ///< (kAnchorNumbers, largest stride) of one lane
  AlignedVector<double> s;                ///< (4, largest stride)
  std::array<std::size_t, L> next{};      ///< where shear_of_points() was in `now`
  TouchingSensorPoints sensor_points;
};

class LayerContact;

template <int L>
struct BasicWorkspace {
  using LaneRow = kernels::Row<L>;

  /// `inner_stages`: the largest number in the schemes that it will be used for.
  explicit BasicWorkspace(const CompiledModel& model, int inner_stages = kInnerStages);
  static std::size_t bytes(const CompiledModel& model);
  void make_memory(const CompiledModel& model);
  /// Makes these the lists that solves read and search.
  void use(CandidateLists<L>& lists);

  using Rows = AlignedVector<LaneRow>;
  Rows memory;  ///< every row below, in one allocation
  AlignedVector<CacheLine> scratch;
  CandidateLists<L> own_candidates;
  CandidateLists<L>* candidates;  ///< the lists in use: own_candidates, or those of a batch's group
  std::vector<unsigned> near_lanes, outrun;  ///< storage of `near`
  std::vector<unsigned char> coupled;        ///< (1) storage of stage.coupled
  kernels::NearPairs<L> near;
  BroadPhase<L> broad_phase;
  kernels::Stage<L> stage;

  // The group's states: now, one step before, and the result of the present solve.
  LaneRow *q0, *v0, *q_before, *v_before, *q1, *v1;
  LaneRow* faces_after;  ///< (n_pairs, 3) as stage.faces, but where the solve ended
  /// (n_links) poses at the start and end of a solve, for the checks that need them.
  AlignedVector<kernels::LinkPose<LaneRow>> poses_before, poses_after;
  /// Wrenches of contacts, (link pairs + grounded links, 6), of parts whose error is estimated.
  std::array<LaneRow*, 4> wrenches;
  AlignedVector<double> search;           ///< (4, largest search_stride())
  std::vector<std::uint64_t> low_points;  ///< scratch of for_each_low_point()
  LaneRow* zero;                          ///< (nv) zeros
  LaneRow* floors;  ///< (components) stage.floor of each, where there are several
  // Inner stages: x relative to q0, (nv) each, one after another.
  int inner_stages;
  LaneRow *x_inner, *v_inner;
  // Newton: direction, its starting point, vector of the natural test.
  LaneRow *delta, *base, *test;
  LaneRow *x_guess, *x_softened;  ///< first guess of a stage, and with softened contacts
  LaneRow sound;
  PivotedFactors pivoted;  ///< for lanes whose plain LU is useless
  // Of scenes whose A is stored in blocks.
  BlockEntries block_entries;
  Rows blocks;  ///< storage of stage.A
  BlockFactors block_factors;
  ShearLanes<L> shear;
  LaneRow* pair_motions;  ///< (link pairs with layers, kPairMotionNumbers)
  std::shared_ptr<LayerContact> layer_contact;
  std::vector<int> layer_members;  ///< the pairs of its bodies
};
using Workspace = BasicWorkspace<kernels::kGroup>;
using SingleWorkspace = BasicWorkspace<1>;

}  // namespace tangere
