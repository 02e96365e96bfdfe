// SPDX-License-Identifier: Apache-2.0
// One lane of a workspace as arguments of kernels/shear: contacts at a state, points, and their
// shear state.
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

/// Returns a contact of one environment. `at`: the touched shape in body 1, and W. `number`(p): the
/// value of a kernels::Parameter there.
template <class Number>
kernels::ShearSpringTouch touch_at(const kernels::ShearSpringContact& of,
                                   const kernels::LinkPose<double>& at, const Number& number) {
  const kernels::PairContact& c = of.contact;
  kernels::ShearSpringTouch t{};
  t.of = &of;
  const auto size = [&](int i, double constant) {
    return c.size_row < 0 ? constant : number(kernels::Parameter{0, c.size_row + i});
  };
  t.size = {size(0, c.size.x), size(1, c.size.y), size(2, c.size.z)};
  t.radius = number(kernels::Parameter{of.radius, of.radius_row});
  t.shape = at.world;
  t.twist = at.V;
  t.law = transformed(c.parameters, number);
  return t;
}

/// The same from the poses of its two links.
template <class Number>
kernels::ShearSpringTouch touch_between(const kernels::ShearSpringContact& of,
                                        const kernels::LinkPose<double>& one,
                                        const kernels::LinkPose<double>& two,
                                        const Number& number) {
  const kernels::Frame<double> second = relative(one.world, two.world);
  return touch_at(of, {compose(second, of.contact.frame2), motion_to_parent(second, two.V) - one.V},
                  number);
}

/// The same for one lane of a workspace. `touches`: (n_shear_springs), StageKernels::touches_at.
template <int L>
kernels::ShearSpringTouch touch_of(const CompiledModel& m, const BasicWorkspace<L>& w,
                                   const kernels::ShearSpringContact& of,
                                   const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& touches,
                                   int lane) {
  kernels::ShearSpringTouch t =
      touch_at(of, pose_of<L>(touches, static_cast<int>(&of - m.shear_springs.data()), lane),
               [&](const kernels::Parameter& p) { return number_of<L>(p, w.stage, lane); });
  if (of.contact.faced) {
    const kernels::Row<L>* side = w.stage.faces + 3 * of.pair;
    t.faces = {side[0][lane], side[1][lane], side[2][lane]};
  }
  return t;
}

/// Range of points with shear springs.
struct PointRange {
  int first, count;
  PointRange(int begin, int number) : first(begin), count(number) {}
  PointRange(const kernels::ShearSpringContact& of)  // NOLINT: a contact's own
      : first(of.first), count(of.contact.n_points) {}
};

/// Writes (3, stride) numbers of points, up to the end of the last vector: those of their entries
/// in a shear state, else zeros. `index`: ascending number of each point in its contact; null: all
/// points in order. `number`(entry, c): component c of an entry. `next`: start of the search in the
/// shear state, any index; set to the end of this contact, so contacts in order are found fastest.
template <class Number>
void shear_of_points(std::span<const ShearEntry> memory, const PointRange& of, const int* index,
                     int count, int stride, const Number& number, double* out, std::size_t& next) {
  const std::size_t end =
      std::size_t((count + kernels::kGroup - 1) / kernels::kGroup) * std::size_t(kernels::kGroup);
  for (int c = 0; c < 3; ++c) std::fill_n(out + c * stride, end, 0.0);
  if (next > memory.size() || (next > 0 && memory[next - 1].point >= of.first)) next = 0;
  while (next < memory.size() && memory[next].point < of.first) ++next;
  for (int k = 0; next < memory.size(); ++next) {
    const int point = memory[next].point - of.first;
    if (point >= of.count) return;
    if (index == nullptr) {
      k = point;
    } else {
      while (k < count && index[k] < point) ++k;
    }
    if (k < count && (index == nullptr || index[k] == point))
      for (int c = 0; c < 3; ++c) out[c * stride + k] = number(next, c);
  }
}
/// Writes the elastic displacements of points.
inline void shear_of_points(std::span<const ShearEntry> memory, const PointRange& of,
                            const int* index, int count, int stride, double* out,
                            std::size_t& next) {
  shear_of_points(
      memory, of, index, count, stride,
      [&](std::size_t entry, int c) { return memory[entry].s[c]; }, out, next);
}

/// Adds (3, stride) numbers of points to those of their entries, three each. Points without an
/// entry are left out.
inline void add_to_entries(std::span<const ShearEntry> memory, const PointRange& of,
                           const int* index, const kernels::ShearSpringPoints& points,
                           const double* numbers, std::span<double> to) {
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
kernels::ShearSpringPoints listed(const typename kernels::Stage<L>::List& list, int lane) {
  return {list.own + 3 * list.stride * lane,
          list.own_anchors + kernels::kAnchorNumbers * list.stride * lane,
          nullptr,
          list.own_count[lane],
          list.stride,
          list.own_weights == nullptr ? nullptr : list.own_weights + list.stride * lane};
}

/// Calls f(contact, numbers of its points or null, points) for every pair of one lane whose anchors
/// are set, by set_list_anchors().
template <int L, class F>
void for_each_pair(const CompiledModel& m, BasicWorkspace<L>& w, int lane, const F& f) {
  for (const kernels::ShearSpringContact& of : m.shear_springs) {
    if (of.pair < 0) continue;
    const auto& list = w.candidates->lists[std::size_t(of.pair)];
    if (list.own_count[lane] > 0) f(of, list.own_index + list.stride * lane, listed<L>(list, lane));
  }
}

/// The same for every pair and every contact with the ground, whose anchors begin_shear() sets.
template <int L, class F>
void for_each_contact(const CompiledModel& m, BasicWorkspace<L>& w, int lane, const F& f) {
  for_each_pair(m, w, lane, f);
  const kernels::Row<L>* rows = w.stage.ground_anchors;
  double* const anchors = w.shear.ground_anchors.data();
  for (const kernels::ShearSpringContact& of : m.shear_springs) {
    if (!of.ground) continue;
    for (int k = 0; k < of.contact.n_points; ++k)
      for (int c = 0; c < kernels::kAnchorNumbers; ++c)
        anchors[c * of.stride + k] = (*rows++)[lane];
    f(of, static_cast<const int*>(nullptr),
      kernels::ShearSpringPoints{of.places, anchors, nullptr, of.contact.n_points, of.stride});
  }
}

/// Calls f as for_each_contact() does for the points of elastic sensors that touch where `end`
/// says. The anchors are those of w.shear.now. Sensors that keep anchors are left out.
template <int L, class F>
void for_each_touching_sensor(const CompiledModel& m, const kernels::KernelTable& table,
                              BasicWorkspace<L>& w,
                              const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& end,
                              int lane, const F& f) {
  TouchingSensorPoints& felt = w.shear.felt;
  for (const kernels::ShearSpringContact& of : m.shear_springs) {
    if (of.sensor < 0 || m.shear_interval(of) > 0) continue;
    const kernels::ShearSpringPoints points =
        felt.find(m.sensors[std::size_t(of.sensor)], table, touch_of(m, w, of, end, lane));
    if (points.count == 0) continue;
    shear_of_points(w.shear.now[std::size_t(lane)], of, felt.index(), points.count, points.stride,
                    points.anchors + 3 * points.stride, w.shear.next[std::size_t(lane)]);
    table.recall(touch_of(m, w, of, w.shear.start_touches, lane), points);
    f(of, felt.index(), points);
  }
}

}  // namespace tangere
