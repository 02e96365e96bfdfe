// SPDX-License-Identifier: Apache-2.0
// Hands one environment after another to the kernels of memory.
#include "engine/step/remember.hpp"

#include "engine/step/remembering_lane.hpp"

namespace tangere {

using kernels::kAnchorNumbers;
using kernels::RememberingContact;
using kernels::RememberingPoints;
using kernels::Row;

namespace {

template <int L>
void recall_points(const kernels::KernelTable& table, const BasicWorkspace<L>& w,
                   const RememberingContact& of, int lane, const int* index,
                   const RememberingPoints& points) {
  look_up(w.remembered.now[std::size_t(lane)], of, index, points.count, points.stride,
          points.anchors + 3 * points.stride);
  table.recall(touch_of(w, of, w.remembered.start, lane), points);
}

/// Appends what is remembered of the points that touch at the end.
template <int L>
void advance_points(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                    const RememberingContact& of, int lane, const int* index,
                    const RememberingPoints& points) {
  if (points.count == 0) return;
  double* const s = w.remembered.s.data();
  table.advance(touch_of(w, of, w.remembered.end, lane), points, s, nullptr);
  ShearMemory& after = w.remembered.after[std::size_t(lane)];
  const double* const touches = s + 3 * points.stride;
  for (int k = 0; k < points.count; ++k) {
    if (!(touches[k] > 0)) continue;
    after.push_back({of.first + (index == nullptr ? k : index[k]),
                     {s[k], s[points.stride + k], s[2 * points.stride + k]}});
  }
}

}  // namespace

template <int L>
void begin_memory(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w) {
  if (m.memories.empty()) return;
  table.stage<L>().poses_at(m.view, w.stage, w.q0, w.v0, w.zero, w.remembered.start.data());
  Row<L>* rows = w.stage.ground_anchors;
  for_each_ground(m, w, [&](const RememberingContact& of, double* anchors) {
    const int count = of.contact.n_points;
    for (int l = 0; l < L; ++l) {
      const RememberingPoints points = {of.places, anchors + l * kAnchorNumbers * of.stride,
                                        nullptr, count, of.stride};
      recall_points(table, w, of, l, nullptr, points);
      for (int k = 0; k < count; ++k)
        for (int c = 0; c < kAnchorNumbers; ++c)
          rows[kAnchorNumbers * k + c][l] = points.anchors[c * of.stride + k];
    }
    rows += kAnchorNumbers * count;
  });
}

template <int L>
void recall_list(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                 int k, int lane) {
  const auto& list = w.lists[std::size_t(k)];
  if (list.own_count[lane] == 0) return;
  const RememberingContact& of = m.memories[std::size_t(m.pairs[std::size_t(k)].memory)];
  recall_points(table, w, of, lane, list.own_index + list.stride * lane, listed<L>(list, lane));
}

template <int L>
void advance_memory(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                    LaneBits lanes) {
  if (m.memories.empty() || lanes == 0) return;
  table.stage<L>().poses_at(m.view, w.stage, w.q1, w.v1, w.zero, w.remembered.end.data());
  for (int l = 0; l < L; ++l) {
    if (!has(lanes, l)) continue;
    w.remembered.after[std::size_t(l)].clear();
    for_each_contact(
        m, w, l,
        [&](const RememberingContact& of, const int* index, const RememberingPoints& points) {
          advance_points(table, w, of, l, index, points);
        });
    for_each_felt(
        m, table, w, w.remembered.end, l,
        [&](const RememberingContact& of, const int* index, const RememberingPoints& points) {
          advance_points(table, w, of, l, index, points);
        });
  }
}

template void begin_memory(const CompiledModel&, const kernels::KernelTable&, Workspace&);
template void begin_memory(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&);
template void recall_list(const CompiledModel&, const kernels::KernelTable&, Workspace&, int, int);
template void recall_list(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&, int,
                          int);
template void advance_memory(const CompiledModel&, const kernels::KernelTable&, Workspace&,
                             LaneBits);
template void advance_memory(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&,
                             LaneBits);

}  // namespace tangere
