// SPDX-License-Identifier: Apache-2.0
// Runs the search kernel for one lane after another.
#include "engine/step/detection.hpp"

#include <algorithm>

#include "engine/step/factors.hpp"
#include "engine/step/shear_anchors.hpp"

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
    for (const int count : w.lists[std::size_t(model.pair_order[std::size_t(i)])].own_count)
      if (count > 0)
        return w.block_entries.couple(model.view.pattern, tree(links.link1), tree(links.link2));
}

/// Empties the lists of a pair of links.
template <int L>
static void clear_lists(const CompiledModel& model, BasicWorkspace<L>& w, std::size_t g) {
  const kernels::LinkPair& links = model.link_pairs[g];
  w.apart[g] = 1;
  for (int i = links.first; i < links.first + links.count; ++i) {
    auto& list = w.lists[std::size_t(model.pair_order[std::size_t(i)])];
    list.count = 0;
    for (int& count : list.own_count) count = 0;
  }
}

template <int L>
void clear_candidates(const CompiledModel& model, BasicWorkspace<L>& w) {
  w.in_rows = w.searched = 0;
  for_each_considered(model, w, [&](std::size_t g) { clear_lists(model, w, g); });
}

/// Finds the pairs that `lanes` consider. Returns whether some are new.
template <int L>
static bool consider_pairs(const CompiledModel& model, BasicWorkspace<L>& w, LaneBits lanes) {
  const bool more = w.broad_phase.find(lanes, w.stage);
  for (const int g : w.broad_phase.dropped()) clear_lists(model, w, std::size_t(g));
  for (const int g : w.broad_phase.added()) {
    clear_lists(model, w, std::size_t(g));
    const kernels::LinkPair& links = model.link_pairs[std::size_t(g)];
    for (int i = links.first; i < links.first + links.count; ++i)
      w.make_list(model, std::size_t(model.pair_order[std::size_t(i)]));
  }
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

/// Searches the points of pair k in the lanes where they may be near.
template <int L>
static void search_pair(const CompiledModel& model, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, std::size_t k, LaneBits lanes) {
  auto& list = w.lists[k];
  const kernels::Row<L>* row = w.near.shape_poses + 12 * k;
  for (int l = 0; l < L; ++l) {
    if (!has(lanes, l)) continue;
    list.own_count[l] = 0;
    if (!has(w.near.lanes[k], l)) continue;
    double pose[12];
    for (int i = 0; i < 12; ++i) pose[i] = row[i][l];
    list.own_count[l] = table.find_candidates(
        {&model.pairs[k], size_of<L>(model.pairs[k], w.stage, l), pose, list.margin,
         list.own + 3 * list.stride * l, list.stride, faces_of<L>(w.stage, k, l),
         list.own_index == nullptr ? nullptr : list.own_index + list.stride * l,
         list.own_weights == nullptr ? nullptr : list.own_weights + list.stride * l});
    if (list.own_index != nullptr) set_list_anchors(model, table, w, static_cast<int>(k), l);
  }
}

template <int L>
void find_candidates(const CompiledModel& model, const kernels::KernelTable& table,
                     BasicWorkspace<L>& w, LaneBits lanes) {
  w.searched |= lanes;
  if (in_blocks(model) && (w.searched & ~lanes) == 0) {
    w.block_entries.reset(model.view.pattern);
    store_blocks(w);
  }
  if (model.link_pairs.empty()) return;
  consider_more(model, table, w, lanes);
  w.in_rows &= ~lanes;
  w.apart_before = w.apart;
  table.stage<L>().near_pairs(model.view, w.stage, w.near);
  for_each_considered(model, w, [&](std::size_t g) {
    if (w.apart[g] != 0) return;
    // Where no lane had a list, every lane needs one from now on.
    const LaneBits searched = w.apart_before[g] != 0 ? w.searched : lanes;
    w.in_rows &= ~searched;
    kernels::Row<L>* reference = w.references + 12 * g;
    for (int i = 0; i < 12; ++i)
      for (int l = 0; l < L; ++l)
        if (has(searched, l)) reference[i][l] = w.near.link_poses[12 * g + std::size_t(i)][l];
    const kernels::LinkPair& links = model.link_pairs[g];
    for (int i = links.first; i < links.first + links.count; ++i)
      search_pair(model, table, w, std::size_t(model.pair_order[std::size_t(i)]), searched);
    if (in_blocks(model)) couple_trees(model, w, links);
  });
  if (in_blocks(model)) store_blocks(w);
}

void lists_to_rows(const CompiledModel& model, const kernels::KernelTable& table, Workspace& w,
                   LaneBits lanes) {
  if ((lanes & ~w.in_rows) == 0) return;
  for_each_considered(model, w, [&](std::size_t g) {
    if (w.apart[g] != 0) return;
    const kernels::LinkPair& links = model.link_pairs[g];
    for (int i = links.first; i < links.first + links.count; ++i)
      table.transpose_list(w.lists[std::size_t(model.pair_order[std::size_t(i)])]);
  });
  w.in_rows = kAllLanes;
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
