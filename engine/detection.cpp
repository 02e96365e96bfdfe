// SPDX-License-Identifier: Apache-2.0
// One lane after the other through the search kernel.
#include "engine/detection.hpp"

namespace tangere {

using kernels::kGroup;
using kernels::LaneRow;

void clear_candidates(Workspace& w) {
  w.in_rows = 0;
  for (kernels::GroupStage::List& list : w.lists) {
    list.count = 0;
    for (int& count : list.own_count) count = 0;
  }
}

void find_candidates(const CompiledModel& model, const kernels::KernelTable& table, Workspace& w, LaneBits lanes) {
  w.in_rows &= ~lanes;
  for (std::size_t k = 0; k < model.pairs.size(); ++k) {
    kernels::GroupStage::List& list = w.lists[k];
    const LaneRow* row = w.poses + 12 * k;
    for (int l = 0; l < kGroup; ++l) {
      if (!has(lanes, l)) continue;
      double pose[12];
      for (int i = 0; i < 12; ++i) list.reference[i][l] = pose[i] = row[i][l];
      list.own_count[l] =
          table.find_candidates({&model.pairs[k], pose, list.margin, list.own + 3 * list.stride * l, list.stride});
    }
  }
}

void lists_to_rows(const kernels::KernelTable& table, Workspace& w, LaneBits lanes) {
  if ((lanes & ~w.in_rows) == 0) return;
  for (kernels::GroupStage::List& list : w.lists) table.transpose_list(list);
  w.in_rows = kAllLanes;
}

}  // namespace tangere
