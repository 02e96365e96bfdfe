// SPDX-License-Identifier: Apache-2.0
// One lane of a workspace as arguments of kernels/shear: contacts at a state, points, and their
// shear state.
#pragma once

#include <algorithm>
#include <span>
#include <utility>

#include "engine/step/workspace.hpp"
#include "kernels/contact/elastic_contact.hpp"

namespace tangere {

/// Copies the numbers of one lane of rows.
template <class Rows, class Numbers>
void read_lane(const Rows& rows, int lane, Numbers& to) {
  constexpr int kLanes = sizeof(Rows) / sizeof(Numbers);
  const auto* const from = reinterpret_cast<const kernels::Row<kLanes>*>(&rows);
  auto* const numbers = reinterpret_cast<double*>(&to);
  for (std::size_t i = 0; i < sizeof(to) / sizeof(double); ++i) numbers[i] = from[i][lane];
}

/// Returns pose and twist of a link in one lane; link < 0: the world.
template <int L>
kernels::LinkPose<double> pose_of(const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& poses,
                                  int link, int lane) {
  if (link < 0)
    return {{kernels::diagonal(1.0), kernels::zero3<double>()}, kernels::zero6<double>()};
  kernels::LinkPose<double> out;
  read_lane(poses[std::size_t(link)], lane, out);
  return out;
}

template <int L>
double number_of(const kernels::Parameter& p, const kernels::Stage<L>& stage, int lane) {
  return p.row < 0 ? p.value : kernels::row_of(stage.block, p.row, stage.group)[lane];
}

/// Sets the numbers of a contact of one environment, all but its pose, twist and faces.
/// `number`(p): the value of a kernels::Parameter there.
template <class Number>
void set_numbers(const kernels::ShearSpringContact& of, const Number& number,
                 kernels::ShearSpringTouch& t) {
  const kernels::PairContact& c = of.contact;
  t.of = &of;
  const auto size = [&](int i, double constant) {
    return c.size_row < 0 ? constant : number(kernels::Parameter{0, c.size_row + i});
  };
  t.size = {size(0, c.size.x), size(1, c.size.y), size(2, c.size.z)};
  t.radius = number(kernels::Parameter{of.radius, of.radius_row});
  t.law = transformed(c.parameters, number);
}

/// Returns a contact from the poses of its two links.
template <class Number>
kernels::ShearSpringTouch touch_between(const kernels::ShearSpringContact& of,
                                        const kernels::LinkPose<double>& one,
                                        const kernels::LinkPose<double>& two,
                                        const Number& number) {
  const kernels::Frame<double> second = relative(one.world, two.world);
  kernels::ShearSpringTouch t{};
  set_numbers(of, number, t);
  t.shape = compose(second, of.contact.frame2);
  t.twist = motion_to_parent(second, two.V) - one.V;
  return t;
}

/// Returns a contact in one lane of a workspace. `touches`: (n_shear_springs),
/// StageKernels::touches_at.
template <int L>
kernels::ShearSpringTouch touch_of(const CompiledModel& m, const BasicWorkspace<L>& w,
                                   const kernels::ShearSpringContact& of,
                                   const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& touches,
                                   int lane) {
  kernels::ShearSpringTouch t;
  set_numbers(
      of, [&](const kernels::Parameter& p) { return number_of<L>(p, w.stage, lane); }, t);
  const auto& at = touches[std::size_t(&of - m.shear_springs.data())];
  read_lane(at.world, lane, t.shape);
  read_lane(at.V, lane, t.twist);
  t.faces = {};
  if (of.contact.faced) {
    const kernels::Row<L>* side = w.stage.faces + 3 * of.pair;
    t.faces = {side[0][lane], side[1][lane], side[2][lane]};
  }
  return t;
}

/// The same where a solve begins. The poses of touched shapes are computed when first needed.
template <int L>
kernels::ShearSpringTouch start_touch_of(const CompiledModel& m, const kernels::KernelTable& table,
                                         BasicWorkspace<L>& w,
                                         const kernels::ShearSpringContact& of, int lane) {
  ShearLanes<L>& lanes = w.shear;
  const auto k = static_cast<int>(&of - m.shear_springs.data());
  if (!std::exchange(lanes.start_known[std::size_t(k)], 1))
    table.stage<L>().touches_at(m.view, lanes.start.data(), k, k + 1, nullptr,
                                lanes.start_touches.data());
  return touch_of(m, w, of, lanes.start_touches, lane);
}

/// Range of points with shear springs.
struct PointRange {
  int first, count;
  PointRange(int begin, int number) : first(begin), count(number) {}
  PointRange(const kernels::ShearSpringContact& of)  // NOLINT: a contact's own
      : first(of.first), count(of.contact.n_points) {}
};

/// Returns the entries of a range of points.
inline std::span<const ShearEntry> entries_of(std::span<const ShearEntry> memory,
                                              const PointRange& points) {
  const auto from = [&](int point) {
    return std::lower_bound(memory.begin(), memory.end(), point,
                            [](const ShearEntry& e, int value) { return e.point < value; });
  };
  return {from(points.first), from(points.first + points.count)};
}

/// Moves `next`, any index, to the first entry of points from `first` on. Contacts in order are
/// found fastest.
inline void find_entries(std::span<const ShearEntry> memory, int first, std::size_t& next) {
  if (next > memory.size() || (next > 0 && memory[next - 1].point >= first)) next = 0;
  while (next < memory.size() && memory[next].point < first) ++next;
}

/// Returns the entries, where a solve begins, of points from `first` on.
template <int L>
kernels::ShearEntries entries_from(ShearLanes<L>& lanes, int first, int lane) {
  const ShearState& now = lanes.now[std::size_t(lane)];
  std::size_t& next = lanes.next[std::size_t(lane)];
  find_entries(now, first, next);
  return {now.data() + next, now.data() + now.size()};
}
/// Lets the next search begin at the entries that are left.
template <int L>
void set_entries(ShearLanes<L>& lanes, int lane, const kernels::ShearEntries& left) {
  lanes.next[std::size_t(lane)] = std::size_t(left.at - lanes.now[std::size_t(lane)].data());
}

/// Writes (3, stride) numbers of points, up to the end of the last vector: those of their entries
/// in a shear state, else zeros. `index`: ascending number of each point in its contact; null: all
/// points in order. `number`(entry, c): component c of an entry. `next`: start of the search in the
/// shear state, any index; set to the end of this contact.
template <class Number>
void shear_of_points(std::span<const ShearEntry> memory, const PointRange& of, const int* index,
                     int count, int stride, const Number& number, double* out, std::size_t& next) {
  const std::size_t end =
      std::size_t((count + kernels::kGroup - 1) / kernels::kGroup) * std::size_t(kernels::kGroup);
  for (int c = 0; c < 3; ++c) std::fill_n(out + c * stride, end, 0.0);
  find_entries(memory, of.first, next);
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

/// Returns the first contact on the ground and the one past the last; they are adjacent.
inline std::pair<int, int> ground_contacts(const CompiledModel& m) {
  const auto on_ground = [](const kernels::ShearSpringContact& of) { return of.ground; };
  const auto begin = std::ranges::find_if(m.shear_springs, on_ground),
             end = std::find_if_not(begin, m.shear_springs.end(), on_ground);
  return {static_cast<int>(begin - m.shear_springs.begin()),
          static_cast<int>(end - m.shear_springs.begin())};
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
  TouchingSensorPoints& sensor_points = w.shear.sensor_points;
  for (const kernels::ShearSpringContact& of : m.shear_springs) {
    if (of.sensor < 0 || m.shear_interval(of) > 0) continue;
    const kernels::ShearSpringPoints points =
        sensor_points.find(m.sensors[std::size_t(of.sensor)], table, touch_of(m, w, of, end, lane));
    if (points.count == 0) continue;
    shear_of_points(w.shear.now[std::size_t(lane)], of, sensor_points.index(), points.count,
                    points.stride, points.anchors + 3 * points.stride,
                    w.shear.next[std::size_t(lane)]);
    table.recall(start_touch_of(m, table, w, of, lane), points);
    f(of, sensor_points.index(), points);
  }
}

}  // namespace tangere
