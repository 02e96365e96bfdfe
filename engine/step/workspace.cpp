// SPDX-License-Identifier: Apache-2.0
// One allocation for all rows of a group; sizes follow from the model.
#include "engine/step/workspace.hpp"

#include <algorithm>
#include <utility>

#include "engine/layer/layer_contact.hpp"
#include "kernels/contact/elastic_contact.hpp"
#include "kernels/step/low_points.hpp"

namespace tangere {

using kernels::kGroup;
using kernels::Row;

namespace {

/// Visits all rows: counts them (base = nullptr) or assigns their addresses.
template <int L>
std::size_t lay_out(const CompiledModel& m, BasicWorkspace<L>& w, Row<L>* base) {
  using LaneRow = Row<L>;
  std::size_t used = 0;
  const auto rows = [&](LaneRow*& p, int count) {
    p = base == nullptr ? nullptr : base + used;
    used += std::size_t(count);
  };
  kernels::Stage<L>& s = w.stage;
  rows(s.centre, m.nq);
  for (LaneRow** p : {&s.x, &s.r, &s.s, &s.tau, &s.target, &s.dry_anchor, &s.v, &s.g,
                      &s.force_scale, &s.mass_diagonal, &s.weight, &s.inverse_weight})
    rows(*p, m.nv);
  const bool in_blocks = m.pattern.slot.empty();
  rows(s.A, in_blocks ? 0 : m.pattern.assembled);
  rows(s.LU, in_blocks ? 0 : m.pattern.factor_entries);
  rows(s.work, in_blocks ? m.nv : std::max(m.pattern.factor_entries, 5 * m.nv));
  rows(s.excess, 1);
  rows(s.faces, 3 * static_cast<int>(m.pairs.size()));
  rows(w.faces_after, 3 * static_cast<int>(m.pairs.size()));
  const auto contacts = static_cast<int>(m.link_pairs.size() + m.grounded.size());
  for (LaneRow*& wrenches : w.wrenches) rows(wrenches, 6 * contacts);
  rows(w.zero, m.nv);
  rows(w.floors, m.components());
  for (LaneRow** p : {&w.q0, &w.q_before, &w.q1}) rows(*p, m.nq);
  for (LaneRow** p :
       {&w.v0, &w.v_before, &w.v1, &w.delta, &w.base, &w.test, &w.x_guess, &w.x_softened})
    rows(*p, m.nv);
  for (LaneRow** p : {&w.x_inner, &w.v_inner}) rows(*p, w.inner_stages * m.nv);
  const int link_pairs = static_cast<int>(m.link_pairs.size());
  rows(s.between, link_pairs);
  rows(w.near.link_poses, 12 * link_pairs);
  rows(w.near.shape_poses, 12 * static_cast<int>(m.pairs.size()));
  rows(s.ground_anchors, kernels::kAnchorNumbers * m.ground_anchors);
  rows(s.layer_sums, kernels::kPairSumNumbers * m.layer_link_pairs);
  rows(w.pair_motions, kernels::kPairMotionNumbers * m.layer_link_pairs);
  return used;
}

}  // namespace

/// Allocates the buffers of the shear state.
template <int L>
void BasicWorkspace<L>::make_memory(const CompiledModel& m) {
  for (auto* lanes : {&shear.now, &shear.after})
    for (ShearState& lane : *lanes) lane.reserve(std::size_t(m.taped_points + kGroup));
  if (m.shear_springs.empty()) return;
  std::size_t most_on_ground = 0, most = 0;
  for (const kernels::ShearSpringContact& of : m.shear_springs) {
    const int stride = of.pair >= 0 ? search_stride(of.contact)
                       : of.ground  ? of.stride
                                    : of.contact.n_points + 2 * kGroup;
    most = std::max(most, std::size_t(stride));
    if (of.ground) most_on_ground = std::max(most_on_ground, std::size_t(stride));
  }
  shear.ground.resize(4 * std::size_t(m.ground_anchors));
  shear.grounded.reserve(std::size_t(m.ground_anchors));
  shear.ground_anchors.resize(most_on_ground * kernels::kAnchorNumbers);
  shear.s.resize(4 * most);
  shear.sensor_points = TouchingSensorPoints(m);
  shear.start.resize(m.links.size());
  shear.end.resize(m.links.size());
  shear.start_touches.resize(m.shear_springs.size());
  shear.end_touches.resize(m.shear_springs.size());
  shear.start_known.resize(m.shear_springs.size());
  shear.near.resize(m.shear_springs.size());
  shear.touching.reserve(m.shear_springs.size());
}

template <int L>
void BasicWorkspace<L>::use(CandidateLists<L>& lists) {
  candidates = &lists;
  stage.lists = lists.lists.data();
  stage.apart = lists.apart.data();
}

template <int L>
std::size_t BasicWorkspace<L>::bytes(const CompiledModel& m) {
  BasicWorkspace w(m);
  const std::size_t shear_bytes = 2 * L * std::size_t(m.taped_points) * sizeof(ShearEntry) +
                                  w.shear.ground.size() * sizeof(LaneRow) +
                                  w.shear.ground_anchors.size() * sizeof(double);
  const std::size_t poses =
      w.poses_before.size() + w.shear.start.size() + w.shear.start_touches.size();
  const std::size_t watched =
      2 * poses * sizeof(kernels::LinkPose<LaneRow>) + w.search.size() * sizeof(double);
  // In scenes of many link pairs, few of the lists are ever made.
  const std::size_t listed = m.link_balls.empty() ? CandidateLists<L>::bytes(m) : 0;
  return shear_bytes + watched + listed + w.memory.size() * sizeof(LaneRow) +
         w.scratch.size() * sizeof(CacheLine);
}

template <int L>
BasicWorkspace<L>::BasicWorkspace(const CompiledModel& m, int inner)
    : own_candidates(m),
      near_lanes(m.pairs.size()),
      outrun(m.link_pairs.size()),
      coupled(1, 1),
      near{},
      broad_phase(m),
      stage{},
      inner_stages(inner),
      pivoted(L),
      block_factors(m.view.pattern, L),
      layer_contact(std::make_shared<LayerContact>()) {
  memory.assign(lay_out<L>(m, *this, nullptr), LaneRow{});
  lay_out<L>(m, *this, memory.data());
  make_memory(m);
  poses_before.resize(m.links.size());
  poses_after.resize(m.links.size());
  int most = 0;
  for (const kernels::PairContact& pair : m.pairs) most = std::max(most, search_stride(pair));
  search.resize(4 * std::size_t(most));
  low_points.resize(std::size_t(kernels::low_words(m.view.most_ground_points)));
  std::size_t bytes = 0;  // the largest of all instruction sets, any of which may be chosen later
  for (const kernels::KernelTable* table : kernels::available_kernels())
    bytes = std::max(bytes, table->stage<L>().scratch_bytes(m.view));
  scratch.resize(cache_lines(bytes));
  // Lanes that never lived hold unit quaternions, so that they compute with finite numbers.
  for (const kernels::Link& link : m.links) {
    if (link.kind != kernels::JointKind::spherical) continue;
    for (LaneRow* q : {stage.centre, q0, q_before, q1})
      for (double& w : q[link.q].lane) w = 1;
  }
  near.lanes = near_lanes.data();
  near.outrun = outrun.data();
  use(own_candidates);
  stage.coupled = coupled.data();
  stage.scratch = scratch.data()->bytes;
}

template struct BasicWorkspace<kGroup>;
template struct BasicWorkspace<1>;

}  // namespace tangere
