// SPDX-License-Identifier: Apache-2.0
// Runs the search kernel for one lane after another.
#include "engine/step/detection.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/model/group_contacts.hpp"
#include "engine/step/factors.hpp"

namespace tangere {

/// Makes room for the blocks of A.
template <int L>
static void store_blocks(BasicWorkspace<L>& w) {
  const std::size_t entries = std::size_t(w.block_entries.entries());
  if (w.blocks.size() < entries) w.blocks.resize(entries + entries / 2);
  w.stage.A = w.blocks.data();
  w.stage.block_first = w.block_entries.first();
  w.stage.block_entries = static_cast<int>(entries);
}

/// Couples the trees of links between which some lane has candidates.
template <int L>
static void couple_trees(const CompiledModel& model, BasicWorkspace<L>& w,
                         const kernels::LinkPair& links) {
  if (links.link1 < 0 || links.link2 < 0) return;
  const auto tree = [&](int link) {
    return model.view.pattern.tree[model.links[std::size_t(link)].v];
  };
  for (int i = links.first; i < links.first + links.count; ++i)
    for (const int count :
         w.candidates->lists[std::size_t(model.pair_order[std::size_t(i)])].own_count)
      if (count > 0)
        return w.block_entries.couple(model.view.pattern, tree(links.link1), tree(links.link2));
}

/// Empties the lists of a pair of links.
template <int L>
static void clear_lists(const CompiledModel& model, BasicWorkspace<L>& w, std::size_t g) {
  const kernels::LinkPair& links = model.link_pairs[g];
  w.candidates->apart[g] = 1;
  for (int i = links.first; i < links.first + links.count; ++i) {
    const auto k = std::size_t(model.pair_order[std::size_t(i)]);
    auto& list = w.candidates->lists[k];
    list.count = 0;
    for (int& count : list.own_count) count = 0;
    w.candidates->in_rows[k] = 0;
  }
}

bool keeps_lists(const CompiledModel& model) {
  return model.link_balls.empty() && !in_blocks(model);
}

template <int L>
void clear_candidates(const CompiledModel& model, BasicWorkspace<L>& w) {
  w.candidates->all_in_rows = w.candidates->searched = 0;
  for_each_considered(model, w, [&](std::size_t g) { clear_lists(model, w, g); });
}

/// Finds the pairs that `lanes` consider. Returns whether some are new.
template <int L>
static bool consider_pairs(const CompiledModel& model, BasicWorkspace<L>& w, LaneBits lanes) {
  const bool more = w.broad_phase.find(lanes, w.stage);
  for (const int g : w.broad_phase.dropped()) clear_lists(model, w, std::size_t(g));
  for (const int g : w.broad_phase.added()) clear_lists(model, w, std::size_t(g));
  return more;
}

/// Returns the size of a pair's shape in one lane.
template <int L>
kernels::Vec3<double> size_of(const kernels::PairContact& pair, const kernels::Stage<L>& stage,
                              int lane) {
  if (pair.size_row < 0) return pair.size;
  const auto one = [&](int i) {
    return kernels::row_of(stage.block, pair.size_row + i, stage.group)[lane];
  };
  return {one(0), one(1), one(2)};
}

/// Returns the faces of pair k that count in one lane.
template <int L>
kernels::Vec3<double> faces_of(const kernels::Stage<L>& stage, std::size_t k, int lane) {
  const kernels::Row<L>* side = stage.faces + 3 * k;
  return {side[0][lane], side[1][lane], side[2][lane]};
}

/// Returns the lanes in which three rows differ from others.
template <int L>
static LaneBits different(const kernels::Row<L>* a, const kernels::Row<L>* b) {
  LaneBits lanes = 0;
  for (int i = 0; i < 3; ++i)
    for (int l = 0; l < L; ++l) lanes |= LaneBits(a[i][l] != b[i][l]) << l;
  return lanes;
}

/// Calls f(now, then) for the three sizes, and for the three faces, of every pair in which they
/// vary: in the stage and where the lists were made.
template <int L, class F>
static void for_each_varying(const CompiledModel& model, BasicWorkspace<L>& w, const F& f) {
  CandidateLists<L>& c = *w.candidates;
  for (std::size_t k = 0; k < model.pairs.size() && !c.sizes.empty(); ++k) {
    if (model.pairs[k].size_row < 0) continue;
    kernels::Row<L> size[3];
    for (int i = 0; i < 3; ++i)
      std::copy_n(kernels::row_of(w.stage.block, model.pairs[k].size_row + i, w.stage.group), L,
                  size[i].lane);
    f(size, c.sizes.data() + 3 * k);
  }
  for (std::size_t k = 0; k < model.pairs.size() && !c.faces.empty(); ++k)
    if (model.pairs[k].faced) f(w.stage.faces + 3 * k, c.faces.data() + 3 * k);
}

template <int L>
void start_solve(const CompiledModel& model, const kernels::KernelTable& table,
                 BasicWorkspace<L>& w, LaneBits lanes) {
  if (model.view.link_balls != nullptr) {
    w.broad_phase.start(w.stage);
    table.stage<L>().place_balls(model.view, w.stage, w.q0, w.zero, w.stage.ball_starts);
    consider_pairs(model, w, lanes);
  }
  if (model.view.faced)
    table.stage<L>().choose_faces_at(model.view, w.stage, w.q0, w.zero, w.stage.faces);
  if (!keeps_lists(model)) return;
  LaneBits changed = 0;
  for_each_varying(model, w, [&](const kernels::Row<L>* now, const kernels::Row<L>* then) {
    changed |= different<L>(now, then);
  });
  w.candidates->clear(changed);
}

/// Considers the link pairs that come within reach because balls of `lanes` moved beyond their
/// slack.
template <int L>
static void consider_more(const CompiledModel& model, const kernels::KernelTable& table,
                          BasicWorkspace<L>& w, LaneBits lanes) {
  if (model.view.link_balls == nullptr || !w.broad_phase.widen(lanes)) return;
  if (!consider_pairs(model, w, lanes)) return;
  if (model.view.faced)
    table.stage<L>().choose_faces_at(model.view, w.stage, w.q0, w.zero, w.stage.faces);
  table.stage<L>().kinematics(model.view, w.stage);
}

/// A list is valid while a lane moves up to its margin, and rounding must not make it shorter.
constexpr double kWider = 1 + 1e-6;

/// Searches the points of pair k in one lane, at a pose of the shape. The list grows until it has
/// room.
template <int L>
static void search_lane(const CompiledModel& model, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, std::size_t k, int lane, const double* pose) {
  const kernels::PairContact& pair = model.pairs[k];
  auto& list = w.candidates->lists[k];
  const double margin = kWider * list.margin + bulge_of(model, pair);
  if (list.stride == 0) w.candidates->reserve(model, k, 1);
  for (;;) {
    const auto own = [&](auto* numbers, int per_point) {
      return numbers == nullptr ? nullptr : numbers + per_point * list.stride * lane;
    };
    const int count = table.find_candidates(
        {&pair, size_of<L>(pair, w.stage, lane), pose, margin, own(list.own, 3), list.stride,
         faces_of<L>(w.stage, k, lane), own(list.own_index, 1), own(list.own_weights, 1)});
    if (count <= list.stride - kernels::kGroup) {
      list.own_count[lane] = count;
      break;
    }
    w.candidates->reserve(model, k, count);
  }
}

/// Searches the points of pair k in the lanes where they may be near.
template <int L>
static void search_pair(const CompiledModel& model, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, std::size_t k, LaneBits lanes) {
  const kernels::Row<L>* row = w.near.shape_poses + 12 * k;
  auto& list = w.candidates->lists[k];
  w.candidates->anchored[k] &= ~lanes;
  for (int l = 0; l < L; ++l) {
    if (!has(lanes, l)) continue;
    if (list.own_count[l] != 0 || has(w.near.lanes[k], l)) w.candidates->in_rows[k] &= ~(1U << l);
    list.own_count[l] = 0;
    if (!has(w.near.lanes[k], l)) continue;
    double pose[12];
    for (int i = 0; i < 12; ++i) pose[i] = row[i][l];
    search_lane(model, table, w, k, l, pose);
  }
}

/// Sets the pose of link pair g at which the lists of `lanes` are made. A lane whose pose is not
/// finite has no lists.
template <int L>
static void set_reference(BasicWorkspace<L>& w, std::size_t g, LaneBits lanes) {
  const kernels::Row<L>* const pose = w.near.link_poses + 12 * g;
  kernels::Row<L>* const reference = w.candidates->references.data() + 12 * g;
  for (int i = 0; i < 12; ++i) put_lanes<L>(pose[i].lane, lanes, reference[i].lane);
  for (int l = 0; l < L; ++l) {
    double sum = 0;
    for (int i = 0; i < 12; ++i) sum += pose[i][l];
    if (has(lanes, l) && !std::isfinite(sum)) w.candidates->searched &= ~(1U << l);
  }
}

template <int L>
void find_candidates(const CompiledModel& model, const kernels::KernelTable& table,
                     BasicWorkspace<L>& w, LaneBits lanes) {
  CandidateLists<L>& c = *w.candidates;
  const LaneBits fresh = keeps_lists(model) ? lanes & ~c.searched : lanes;
  c.searched |= lanes;
  if (in_blocks(model) && (c.searched & ~lanes) == 0) {
    w.block_entries.reset(model.view.pattern);
    store_blocks(w);
  }
  if (model.link_pairs.empty()) return;
  consider_more(model, table, w, lanes);
  c.all_in_rows &= ~lanes;
  c.apart_before = c.apart;
  for_each_varying(model, w, [&](const kernels::Row<L>* now, kernels::Row<L>* then) {
    for (int i = 0; i < 3; ++i) put_lanes<L>(now[i].lane, lanes, then[i].lane);
  });
  table.stage<L>().near_pairs(model.view, w.stage, w.near);
  for_each_considered(model, w, [&](std::size_t g) {
    if (c.apart[g] != 0) return;
    // Where no lane had a list, every lane needs one from now on.
    const LaneBits searched =
        c.apart_before[g] != 0 ? c.searched : fresh | (lanes & w.near.outrun[g]);
    if (searched == 0) return;
    c.all_in_rows &= ~searched;
    c.all_anchored &= ~searched;
    set_reference(w, g, searched);
    const kernels::LinkPair& links = model.link_pairs[g];
    for (int i = links.first; i < links.first + links.count; ++i)
      search_pair(model, table, w, std::size_t(model.pair_order[std::size_t(i)]), searched);
    if (in_blocks(model)) couple_trees(model, w, links);
  });
  if (in_blocks(model)) store_blocks(w);
}

void lists_to_rows(const CompiledModel& model, const kernels::KernelTable& table, Workspace& w,
                   LaneBits lanes) {
  CandidateLists<kernels::kGroup>& c = *w.candidates;
  if ((lanes & ~c.all_in_rows) == 0) return;
  for_each_considered(model, w, [&](std::size_t g) {
    if (c.apart[g] != 0) return;
    const kernels::LinkPair& links = model.link_pairs[g];
    for (int i = links.first; i < links.first + links.count; ++i) {
      const auto k = std::size_t(model.pair_order[std::size_t(i)]);
      const LaneBits made = kAllLanes & ~std::exchange(c.in_rows[k], kAllLanes);
      if (made != 0) table.transpose_list(c.lists[k], made);
      if (model.pairs[k].memory < 0 || c.lists[k].count == 0) continue;
      if (std::exchange(c.anchors_in_rows[k], kAllLanes) != kAllLanes || made != 0)
        table.transpose_anchors(c.lists[k]);
    }
  });
  c.all_in_rows = kAllLanes;
}

template void start_solve(const CompiledModel&, const kernels::KernelTable&, Workspace&, LaneBits);
template void start_solve(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&,
                          LaneBits);
template void clear_candidates(const CompiledModel&, Workspace&);
template void clear_candidates(const CompiledModel&, SingleWorkspace&);
template void find_candidates(const CompiledModel&, const kernels::KernelTable&, Workspace&,
                              LaneBits);
template void find_candidates(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&,
                              LaneBits);

}  // namespace tangere
