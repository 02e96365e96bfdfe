// SPDX-License-Identifier: Apache-2.0
// One allocation for all rows of a group; sizes follow from the model.
#include "engine/step/workspace.hpp"

#include <algorithm>
#include <utility>

#include "kernels/contact/elastic_contact.hpp"

namespace tangere {

using kernels::kGroup;
using kernels::Row;

namespace {

/// Visits the rows of a list.
template <class List, class Rows>
void list_rows(const kernels::PairContact& pair, List& list, const Rows& rows) {
  rows(list.points, 3 * list.stride);
  if (pair.memory >= 0) rows(list.anchors, kernels::kAnchorNumbers * list.stride);
  if (pair.weights != nullptr) rows(list.weights, list.stride);
}

/// Returns the size of a list's own points and areas.
template <class List>
std::size_t own_numbers(const kernels::PairContact& pair, const List& list) {
  return std::size_t((pair.weights == nullptr ? 3 : 4) * list.stride);
}
template <int L, class List>
void set_own(const kernels::PairContact& pair, double* own, List& list) {
  list.own = own;
  list.own_weights = pair.weights == nullptr ? nullptr : own + L * 3 * list.stride;
}

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
  for (LaneRow** p : {&s.x, &s.r, &s.s, &s.tau, &s.target, &s.v, &s.g, &s.force_scale,
                      &s.mass_diagonal, &s.weight, &s.inverse_weight})
    rows(*p, m.nv);
  const bool in_blocks = m.pattern.slot.empty();
  rows(s.A, in_blocks ? 0 : m.pattern.entries);
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
  rows(w.references, 12 * link_pairs);
  rows(w.near.link_poses, 12 * link_pairs);
  rows(w.near.shape_poses, 12 * static_cast<int>(m.pairs.size()));
  for (std::size_t k = 0; k < w.lists.size(); ++k) {
    typename kernels::Stage<L>::List& list = w.lists[k];
    list.stride = (m.pairs[k].n_points + kGroup - 1) / kGroup * kGroup + kGroup;
    list.points = list.anchors = list.weights = nullptr;
    if (m.view.link_balls == nullptr) list_rows(m.pairs[k], list, rows);
  }
  rows(s.ground_anchors, kernels::kAnchorNumbers * m.ground_anchors);
  return used;
}

}  // namespace

/// Allocates the buffers of the shear state.
template <int L>
void BasicWorkspace<L>::make_memory(const CompiledModel& m) {
  for (auto& list : lists) list.own_index = nullptr, list.own_anchors = nullptr;
  if (m.shear_springs.empty()) return;
  std::size_t listed = 0, most_on_ground = 0, most = 0;
  for (const kernels::ShearSpringContact& of : m.shear_springs) {
    const int stride = of.pair >= 0 ? lists[std::size_t(of.pair)].stride
                       : of.ground  ? of.stride
                                    : of.contact.n_points + 2 * kGroup;
    most = std::max(most, std::size_t(stride));
    if (of.pair >= 0) listed += std::size_t(L * stride);
    if (of.ground) most_on_ground = std::max(most_on_ground, std::size_t(stride));
  }
  own_index.resize(listed);
  own_anchors.resize(listed * kernels::kAnchorNumbers);
  std::size_t at = 0;
  for (const kernels::ShearSpringContact& of : m.shear_springs) {
    if (of.pair < 0) continue;
    auto& list = lists[std::size_t(of.pair)];
    list.own_index = own_index.data() + at;
    list.own_anchors = own_anchors.data() + kernels::kAnchorNumbers * at;
    at += std::size_t(L * list.stride);
  }
  shear.ground.resize(4 * std::size_t(m.ground_anchors));
  shear.grounded.reserve(std::size_t(m.ground_anchors));
  shear.ground_anchors.resize(most_on_ground * kernels::kAnchorNumbers);
  shear.s.resize(4 * most);
  shear.felt = TouchingSensorPoints(m);
  shear.start.resize(m.links.size());
  shear.end.resize(m.links.size());
  shear.start_touches.resize(m.shear_springs.size());
  shear.end_touches.resize(m.shear_springs.size());
  shear.start_known.resize(m.shear_springs.size());
  shear_bytes.near.resize(m.shear_springs.size());
  shear_bytes.touching.reserve(m.shear_springs.size());
  for (auto* lanes : {&shear.now, &shear.after})
    for (ShearState& lane : *lanes) lane.reserve(std::size_t(m.taped_points + kGroup));
}

template <int L>
void BasicWorkspace<L>::make_list(const CompiledModel& m, std::size_t pair) {
  auto& list = lists[pair];
  if (list.own != nullptr) return;
  std::size_t used = 0;
  const auto count = [&](LaneRow*&, int n) { used += std::size_t(n); };
  list_rows(m.pairs[pair], list, count);
  LaneRow* at = later_rows.emplace_back(used).data();
  list_rows(m.pairs[pair], list, [&](LaneRow*& p, int n) { p = std::exchange(at, at + n); });
  AlignedVector<double>& own = later_points.emplace_back(L * own_numbers(m.pairs[pair], list));
  set_own<L>(m.pairs[pair], own.data(), list);
}

template <int L>
std::size_t BasicWorkspace<L>::bytes(const CompiledModel& m) {
  BasicWorkspace w(m);
  const std::size_t shear_bytes =
      2 * L * std::size_t(m.taped_points) * sizeof(ShearEntry) + w.own_index.size() * sizeof(int) +
      w.own_anchors.size() * sizeof(double) + w.shear.ground.size() * sizeof(LaneRow) +
      w.shear.ground_anchors.size() * sizeof(double);
  const std::size_t poses =
      w.poses_before.size() + w.shear.start.size() + w.shear.start_touches.size();
  const std::size_t watched =
      2 * poses * sizeof(kernels::LinkPose<LaneRow>) + w.search.size() * sizeof(double);
  return shear_bytes + watched + w.memory.size() * sizeof(LaneRow) +
         w.own_points.size() * sizeof(double) + w.scratch.size();
}

template <int L>
BasicWorkspace<L>::BasicWorkspace(const CompiledModel& m, int inner)
    : lists(m.pairs.size()),
      near_lanes(m.pairs.size()),
      apart(m.link_pairs.size(), m.link_balls.empty() ? 0 : 1),
      apart_before(apart),
      coupled(1, 1),
      near{},
      broad_phase(m),
      stage{},
      inner_stages(inner),
      pivoted(L),
      block_factors(m.view.pattern, L) {
  memory.assign(lay_out<L>(m, *this, nullptr), LaneRow{});
  lay_out<L>(m, *this, memory.data());
  if (m.link_balls.empty()) {
    std::size_t own = 0;
    for (std::size_t k = 0; k < lists.size(); ++k) own += L * own_numbers(m.pairs[k], lists[k]);
    own_points.resize(own);
    own = 0;
    for (std::size_t k = 0; k < lists.size(); ++k) {
      set_own<L>(m.pairs[k], own_points.data() + own, lists[k]);
      own += L * own_numbers(m.pairs[k], lists[k]);
    }
  }
  make_memory(m);
  poses_before.resize(m.links.size());
  poses_after.resize(m.links.size());
  int most = 0;
  for (const auto& list : lists) most = std::max(most, list.stride);
  search.resize(4 * std::size_t(most));
  std::size_t bytes = 0;  // the largest of all instruction sets, any of which may be chosen later
  for (const kernels::KernelTable* table : kernels::available_kernels())
    bytes = std::max(bytes, table->stage<L>().scratch_bytes(m.view));
  scratch.resize(bytes);
  // Lanes that never lived hold unit quaternions, so that they compute with finite numbers.
  for (const kernels::Link& link : m.links) {
    if (link.kind != kernels::JointKind::spherical) continue;
    for (LaneRow* q : {stage.centre, q0, q_before, q1})
      for (double& w : q[link.q].lane) w = 1;
  }
  near.lanes = near_lanes.data();
  for (std::size_t g = 0; g < m.link_pairs.size(); ++g) {
    const kernels::LinkPair& links = m.link_pairs[g];
    for (int i = 0; i < links.count; ++i) {
      auto& list = lists[std::size_t(m.pair_order[std::size_t(links.first + i)])];
      list.margin = links.margin;
      list.reference = references + 12 * g;
    }
  }
  stage.lists = lists.data();
  stage.apart = apart.data();
  stage.coupled = coupled.data();
  stage.scratch = scratch.data();
}

template struct BasicWorkspace<kGroup>;
template struct BasicWorkspace<1>;

}  // namespace tangere
