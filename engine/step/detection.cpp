// SPDX-License-Identifier: Apache-2.0
// Runs the search kernel for one lane after another.
#include "engine/step/detection.hpp"

#include <algorithm>

#include "engine/step/shear_update.hpp"

namespace tangere {

template <int L>
void clear_candidates(BasicWorkspace<L>& w) {
  w.in_rows = w.asked = 0;
  std::fill(w.apart.begin(), w.apart.end(), 1);
  for (auto& list : w.lists) {
    list.count = 0;
    for (int& count : list.own_count) count = 0;
  }
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
void choose_faces(const CompiledModel& model, const kernels::KernelTable& table,
                  BasicWorkspace<L>& w) {
  if (model.view.faced)
    table.stage<L>().choose_faces_at(model.view, w.stage, w.q0, w.zero, w.stage.faces);
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
  if (model.link_pairs.empty()) return;
  w.asked |= lanes;
  w.in_rows &= ~lanes;
  w.apart_before = w.apart;
  table.stage<L>().near_pairs(model.view, w.stage, w.near);
  for (std::size_t g = 0; g < model.link_pairs.size(); ++g) {
    if (w.apart[g] != 0) continue;
    // Where no lane had a list, every lane needs one from now on.
    const LaneBits searched = w.apart_before[g] != 0 ? w.asked : lanes;
    w.in_rows &= ~searched;
    kernels::Row<L>* reference = w.references + 12 * g;
    for (int i = 0; i < 12; ++i)
      for (int l = 0; l < L; ++l)
        if (has(searched, l)) reference[i][l] = w.near.link_poses[12 * g + std::size_t(i)][l];
    const kernels::LinkPair& links = model.link_pairs[g];
    for (int i = links.first; i < links.first + links.count; ++i)
      search_pair(model, table, w, std::size_t(model.pair_order[std::size_t(i)]), searched);
  }
}

void lists_to_rows(const CompiledModel& model, const kernels::KernelTable& table, Workspace& w,
                   LaneBits lanes) {
  if ((lanes & ~w.in_rows) == 0) return;
  for (std::size_t g = 0; g < model.link_pairs.size(); ++g) {
    if (w.apart[g] != 0) continue;
    const kernels::LinkPair& links = model.link_pairs[g];
    for (int i = links.first; i < links.first + links.count; ++i)
      table.transpose_list(w.lists[std::size_t(model.pair_order[std::size_t(i)])]);
  }
  w.in_rows = kAllLanes;
}

template void choose_faces(const CompiledModel&, const kernels::KernelTable&, Workspace&);
template void choose_faces(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&);
template void clear_candidates(Workspace&);
template void clear_candidates(SingleWorkspace&);
template void find_candidates(const CompiledModel&, const kernels::KernelTable&, Workspace&,
                              LaneBits);
template void find_candidates(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&,
                              LaneBits);

}  // namespace tangere
