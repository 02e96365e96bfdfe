// SPDX-License-Identifier: Apache-2.0
// One lane of a workspace as the kernels of memory take it: its contacts at a state, its points,
// and what it remembers of them.
#pragma once

#include <algorithm>
#include <span>

#include "engine/step/workspace.hpp"
#include "kernels/contact/elastic_contact.hpp"

namespace tangere {

/// Returns pose and twist of a link in one lane; link < 0: the world.
template <int L>
kernels::LinkPose<double> pose_of(const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& poses,
                                  int link, int lane) {
  if (link < 0)
    return {{kernels::diagonal(1.0), kernels::zero3<double>()}, kernels::zero6<double>()};
  kernels::LinkPose<double> out;
  static_assert(sizeof(kernels::LinkPose<kernels::Row<L>>) == L * sizeof(out));
  const auto* const rows = reinterpret_cast<const kernels::Row<L>*>(&poses[std::size_t(link)]);
  auto* const numbers = reinterpret_cast<double*>(&out);
  for (std::size_t i = 0; i < sizeof(out) / sizeof(double); ++i) numbers[i] = rows[i][lane];
  return out;
}

template <int L>
double number_of(const kernels::Parameter& p, const kernels::Stage<L>& stage, int lane) {
  return p.row < 0 ? p.value : kernels::row_of(stage.block, p.row, stage.group)[lane];
}

/// Returns a contact of one environment at the poses of one state. `number`(p): the value of a
/// kernels::Parameter there.
template <class Number>
kernels::RememberingTouch touch_between(const kernels::RememberingContact& of,
                                        const kernels::LinkPose<double>& one,
                                        const kernels::LinkPose<double>& two,
                                        const Number& number) {
  const kernels::PairContact& c = of.contact;
  const kernels::Frame<double> second = relative(one.world, two.world);
  kernels::RememberingTouch t{};
  t.of = &of;
  const auto size = [&](int i, double constant) {
    return c.size_row < 0 ? constant : number(kernels::Parameter{0, c.size_row + i});
  };
  t.size = {size(0, c.size.x), size(1, c.size.y), size(2, c.size.z)};
  t.radius = number(kernels::Parameter{of.radius, of.radius_row});
  t.shape = compose(second, c.frame2);
  t.twist = motion_to_parent(second, two.V) - one.V;
  t.law = transformed(c.parameters, number);
  return t;
}

/// The same for one lane of a workspace.
template <int L>
kernels::RememberingTouch touch_of(const BasicWorkspace<L>& w,
                                   const kernels::RememberingContact& of,
                                   const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& poses,
                                   int lane) {
  kernels::RememberingTouch t = touch_between(
      of, pose_of<L>(poses, of.contact.link1, lane), pose_of<L>(poses, of.contact.link2, lane),
      [&](const kernels::Parameter& p) { return number_of<L>(p, w.stage, lane); });
  if (of.contact.faced) {
    const kernels::Row<L>* side = w.stage.faces + 3 * of.pair;
    t.faces = {side[0][lane], side[1][lane], side[2][lane]};
  }
  return t;
}

/// Writes (3, stride) numbers of points, up to the end of the last vector: those of the entries that
/// they have in a memory, else zeros. `index`: number of each point in its contact, rising; null:
/// all points in order. `number`(entry, c): component c of an entry.
template <class Number>
void look_up(std::span<const ShearEntry> memory, const kernels::RememberingContact& of,
             const int* index, int count, int stride, const Number& number, double* out) {
  std::size_t at =
      std::size_t(std::lower_bound(memory.begin(), memory.end(), of.first,
                                   [](const ShearEntry& e, int point) { return e.point < point; }) -
                  memory.begin());
  const int end = (count + kernels::kGroup - 1) / kernels::kGroup * kernels::kGroup;
  for (int k = 0; k < end; ++k) {
    const int point = of.first + (k >= count ? 0 : index == nullptr ? k : index[k]);
    while (k < count && at < memory.size() && memory[at].point < point) ++at;
    const bool found = k < count && at < memory.size() && memory[at].point == point;
    for (int c = 0; c < 3; ++c) out[c * stride + k] = found ? number(at, c) : 0;
  }
}
/// Writes what is remembered of points.
inline void look_up(std::span<const ShearEntry> memory, const kernels::RememberingContact& of,
                    const int* index, int count, int stride, double* out) {
  look_up(
      memory, of, index, count, stride,
      [&](std::size_t entry, int c) { return memory[entry].s[c]; }, out);
}

/// Adds (3, stride) numbers of points to those of their entries, three each. Points without an
/// entry are left out.
inline void add_to_entries(std::span<const ShearEntry> memory,
                           const kernels::RememberingContact& of, const int* index,
                           const kernels::RememberingPoints& points, const double* numbers,
                           std::span<double> to) {
  std::size_t at = 0;
  for (int k = 0; k < points.count; ++k) {
    const int point = of.first + (index == nullptr ? k : index[k]);
    while (at < memory.size() && memory[at].point < point) ++at;
    if (at == memory.size()) return;
    if (memory[at].point != point) continue;
    for (int c = 0; c < 3; ++c) to[3 * at + std::size_t(c)] += numbers[c * points.stride + k];
  }
}

/// Returns the listed points of one lane.
template <int L>
kernels::RememberingPoints listed(const typename kernels::Stage<L>::List& list, int lane) {
  return {list.own + 3 * list.stride * lane,
          list.own_anchors + kernels::kAnchorNumbers * list.stride * lane, nullptr,
          list.own_count[lane], list.stride};
}

/// Calls f(contact, its anchors of lane 0) for every contact with the ground that remembers.
template <int L, class F>
void for_each_ground(const CompiledModel& m, BasicWorkspace<L>& w, const F& f) {
  double* at = w.remembered.ground_anchors.data();
  for (const kernels::RememberingContact& of : m.memories) {
    if (!of.ground) continue;
    f(of, at);
    at += L * kernels::kAnchorNumbers * of.stride;
  }
}

/// Calls f(contact, numbers of its points or null, points) for every contact of one lane whose
/// anchors are set: by recall_list() and begin_memory().
template <int L, class F>
void for_each_contact(const CompiledModel& m, BasicWorkspace<L>& w, int lane, const F& f) {
  for (const kernels::RememberingContact& of : m.memories) {
    if (of.pair < 0) continue;
    const auto& list = w.lists[std::size_t(of.pair)];
    if (list.own_count[lane] > 0) f(of, list.own_index + list.stride * lane, listed<L>(list, lane));
  }
  for_each_ground(m, w, [&](const kernels::RememberingContact& of, double* anchors) {
    f(of, static_cast<const int*>(nullptr),
      kernels::RememberingPoints{of.places, anchors + lane * kernels::kAnchorNumbers * of.stride,
                                 nullptr, of.contact.n_points, of.stride});
  });
}

/// Calls f as for_each_contact() does for the points of elastic sensors that touch at the poses
/// `end`. The anchors are those of w.remembered.now.
template <int L, class F>
void for_each_felt(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                   const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& end, int lane,
                   const F& f) {
  FeltPoints& felt = w.remembered.felt;
  for (const kernels::RememberingContact& of : m.memories) {
    if (of.sensor < 0) continue;
    const kernels::RememberingPoints points =
        felt.find(m.sensors[std::size_t(of.sensor)], table, touch_of(w, of, end, lane));
    if (points.count == 0) continue;
    look_up(w.remembered.now[std::size_t(lane)], of, felt.index(), points.count, points.stride,
            points.anchors + 3 * points.stride);
    table.recall(touch_of(w, of, w.remembered.start, lane), points);
    f(of, felt.index(), points);
  }
}

}  // namespace tangere
