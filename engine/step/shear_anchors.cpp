// SPDX-License-Identifier: Apache-2.0
// Calls the kernels that compute anchors, for all lanes on the ground, else lane by lane.
#include "engine/step/shear_anchors.hpp"

#include <algorithm>

#include "engine/step/detection.hpp"
#include "engine/step/dry_friction_state.hpp"
#include "engine/step/shear_lane.hpp"

namespace tangere {

using kernels::Row;
using kernels::ShearSpringContact;

/// Fills rows (points on the ground, 3) with their elastic displacements. Returns false, and leaves
/// the rows unchanged, if no lane has an entry for any of them.
template <int L>
static bool put_ground(const CompiledModel& m, int first, const std::array<ShearState, L>& now,
                       Row<L>* rows) {
  bool any = false;
  for (int l = 0; l < L; ++l)
    for (const ShearEntry& e : entries_of(now[std::size_t(l)], {first, m.ground_anchors})) {
      if (!any) std::fill_n(rows, 3 * m.ground_anchors, Row<L>{});
      any = true;
      for (int c = 0; c < 3; ++c) rows[3 * (e.point - first) + c][l] = e.s[c];
    }
  return any;
}

template <int L>
void begin_shear(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w) {
  set_dry_anchors(m, w);
  if (m.shear_springs.empty()) return;
  w.candidates->drop_anchors();
  ShearLanes<L>& lanes = w.shear;
  table.stage<L>().poses_at(m.view, w.stage, w.q0, w.v0, w.zero, lanes.start.data());
  std::fill(lanes.start_known.begin(), lanes.start_known.end(), 0);
  if (m.ground_anchors == 0) return;
  const auto [begin, end] = ground_contacts(m);
  table.stage<L>().touches_at(m.view, lanes.start.data(), begin, end, nullptr,
                              lanes.start_touches.data());
  std::fill(lanes.start_known.begin() + begin, lanes.start_known.begin() + end, 1);
  Row<L>* const s = lanes.ground.data();
  const bool any = put_ground<L>(m, m.shear_springs[std::size_t(begin)].first, lanes.now, s);
  table.stage<L>().recall_ground(m.view, w.stage, lanes.start_touches.data(), any ? s : nullptr);
}

/// Computes the anchors of the points that one lane has listed for a pair.
template <int L>
static void anchor_list(const CompiledModel& m, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, const ShearSpringContact& of, int lane) {
  const auto& list = w.candidates->lists[std::size_t(of.pair)];
  const kernels::ShearEntries left = table.recall_entries(
      start_touch_of(m, table, w, of, lane), listed<L>(list, lane),
      list.own_index + list.stride * lane, entries_from(w.shear, of.first, lane));
  set_entries(w.shear, lane, left);
}

template <int L>
void set_list_anchors(const CompiledModel& m, const kernels::KernelTable& table,
                      BasicWorkspace<L>& w, LaneBits lanes) {
  CandidateLists<L>& c = *w.candidates;
  lanes &= ~c.all_anchored;
  if (m.shear_springs.empty() || lanes == 0) return;
  for_each_considered(m, w, [&](std::size_t g) {
    if (c.apart[g] != 0) return;
    const kernels::LinkPair& links = m.link_pairs[g];
    for (int i = links.first; i < links.first + links.count; ++i) {
      const auto k = std::size_t(m.pair_order[std::size_t(i)]);
      if (m.pairs[k].memory < 0) continue;
      const ShearSpringContact& of = m.shear_springs[std::size_t(m.pairs[k].memory)];
      const LaneBits set = lanes & ~c.anchored[k];
      for (int l = 0; l < L; ++l)
        if (has(set, l) && c.lists[k].own_count[l] > 0) anchor_list(m, table, w, of, l);
      c.anchored[k] |= set;
      c.anchors_in_rows[k] &= ~set;
    }
  });
  c.all_anchored |= lanes;
  c.all_in_rows &= ~lanes;
}

template void begin_shear(const CompiledModel&, const kernels::KernelTable&, Workspace&);
template void begin_shear(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&);
template void set_list_anchors(const CompiledModel&, const kernels::KernelTable&, Workspace&,
                               LaneBits);
template void set_list_anchors(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&,
                               LaneBits);

}  // namespace tangere
