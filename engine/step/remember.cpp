// SPDX-License-Identifier: Apache-2.0
// Hands one environment after another to the kernels of memory.
#include "engine/step/remember.hpp"

#include <algorithm>

#include "kernels/contact/elastic_contact.hpp"

namespace tangere {

using kernels::Frame;
using kernels::kAnchorNumbers;
using kernels::LinkPose;
using kernels::RememberingContact;
using kernels::RememberingPoints;
using kernels::RememberingTouch;
using kernels::Row;
using kernels::Vec3;

namespace {

/// Returns pose and twist of a link in one lane; link < 0: the world.
template <int L>
LinkPose<double> pose_of(const AlignedVector<LinkPose<Row<L>>>& poses, int link, int lane) {
  if (link < 0)
    return {{kernels::diagonal(1.0), kernels::zero3<double>()}, kernels::zero6<double>()};
  LinkPose<double> out;
  static_assert(sizeof(LinkPose<Row<L>>) == L * sizeof(out));
  const auto* const rows = reinterpret_cast<const Row<L>*>(&poses[std::size_t(link)]);
  auto* const numbers = reinterpret_cast<double*>(&out);
  for (std::size_t i = 0; i < sizeof(out) / sizeof(double); ++i) numbers[i] = rows[i][lane];
  return out;
}

template <int L>
double number(const kernels::Parameter& p, const kernels::Stage<L>& stage, int lane) {
  return p.row < 0 ? p.value : kernels::row_of(stage.block, p.row, stage.group)[lane];
}

/// Returns a contact of one lane at the poses of one state.
template <int L>
RememberingTouch touch_of(const BasicWorkspace<L>& w, const RememberingContact& of,
                          const AlignedVector<LinkPose<Row<L>>>& poses, int lane) {
  const kernels::PairContact& c = of.contact;
  const LinkPose<double> one = pose_of<L>(poses, c.link1, lane), two = pose_of<L>(poses, c.link2, lane);
  const Frame<double> second = relative(one.world, two.world);
  RememberingTouch t{};
  t.of = &of;
  const auto size = [&](int i, double constant) {
    return c.size_row < 0 ? constant : number<L>({0, c.size_row + i}, w.stage, lane);
  };
  t.size = {size(0, c.size.x), size(1, c.size.y), size(2, c.size.z)};
  if (c.faced) {
    const Row<L>* side = w.stage.faces + 3 * of.pair;
    t.faces = {side[0][lane], side[1][lane], side[2][lane]};
  }
  t.radius = number<L>({of.radius, of.radius_row}, w.stage, lane);
  t.shape = compose(second, c.frame2);
  t.twist = motion_to_parent(second, two.V) - one.V;
  t.law = transformed(c.parameters,
                      [&](const kernels::Parameter& p) { return number<L>(p, w.stage, lane); });
  return t;
}

/// Writes what is remembered of points to rows 3 to 5 of their anchors. `index`: of each point in
/// its contact, rising; null: all points in order.
void look_up(const ShearMemory& memory, const RememberingContact& of, const int* index,
             const RememberingPoints& points) {
  double* const s = points.anchors + 3 * points.stride;
  auto at = std::lower_bound(memory.begin(), memory.end(), of.first,
                             [](const ShearEntry& e, int point) { return e.point < point; });
  for (int k = 0; k < points.stride; ++k) {
    const int point = of.first + (k >= points.count ? 0 : index == nullptr ? k : index[k]);
    while (k < points.count && at != memory.end() && at->point < point) ++at;
    const bool found = k < points.count && at != memory.end() && at->point == point;
    for (int c = 0; c < 3; ++c) s[c * points.stride + k] = found ? at->s[c] : 0;
  }
}

template <int L>
void recall_points(const kernels::KernelTable& table, const BasicWorkspace<L>& w,
                   const RememberingContact& of, int lane, const int* index,
                   const RememberingPoints& points) {
  look_up(w.remembered.now[std::size_t(lane)], of, index, points);
  table.recall(touch_of(w, of, w.remembered.start, lane), points);
}

/// Returns the listed points of one lane.
template <int L>
RememberingPoints listed(const typename kernels::Stage<L>::List& list, int lane) {
  return {list.own + 3 * list.stride * lane, list.own_anchors + kAnchorNumbers * list.stride * lane,
          nullptr, list.own_count[lane], list.stride};
}

/// Calls f(contact, its anchors of lane 0) for every contact with the ground that remembers.
template <int L, class F>
void for_each_ground(const CompiledModel& m, BasicWorkspace<L>& w, const F& f) {
  double* at = w.remembered.ground_anchors.data();
  for (const kernels::GroundContact& g : m.grounds) {
    if (g.memory < 0) continue;
    const RememberingContact& of = m.memories[std::size_t(g.memory)];
    f(g, of, at);
    at += L * kAnchorNumbers * of.stride;
  }
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
  for_each_ground(m, w, [&](const kernels::GroundContact& g, const RememberingContact& of,
                            double* anchors) {
    Row<L>* const rows = w.stage.ground_anchors + kAnchorNumbers * g.first_anchor;
    for (int l = 0; l < L; ++l) {
      const RememberingPoints points = {of.places, anchors + l * kAnchorNumbers * of.stride,
                                        nullptr, g.n_points, of.stride};
      recall_points(table, w, of, l, nullptr, points);
      for (int k = 0; k < g.n_points; ++k)
        for (int c = 0; c < kAnchorNumbers; ++c)
          rows[kAnchorNumbers * k + c][l] = points.anchors[c * of.stride + k];
    }
  });
}

template <int L>
void recall_list(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                 int k, int lane) {
  const auto& list = w.lists[std::size_t(k)];
  if (list.own_count[lane] == 0) return;
  const RememberingContact& of =
      m.memories[std::size_t(m.pairs[std::size_t(k)].memory)];
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
    for (const RememberingContact& of : m.memories) {
      if (of.pair < 0) continue;
      const auto& list = w.lists[std::size_t(of.pair)];
      advance_points(table, w, of, l, list.own_index + list.stride * l, listed<L>(list, l));
    }
    for_each_ground(m, w, [&](const kernels::GroundContact& g, const RememberingContact& of,
                              double* anchors) {
      advance_points(table, w, of, l, nullptr,
                     {of.places, anchors + l * kAnchorNumbers * of.stride, nullptr, g.n_points,
                      of.stride});
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
