// SPDX-License-Identifier: Apache-2.0
// Calls the kernels of kernels/shear, one environment after the other.
#include "engine/step/shear_update.hpp"

#include <algorithm>

#include "engine/step/kept_anchors.hpp"

namespace tangere {

using kernels::Row;
using kernels::ShearSpringContact;
using kernels::ShearSpringPoints;

namespace {

/// Appends the shear-state entries of the points that touch at the end.
template <int L>
void advance_points(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                    const ShearSpringContact& of, int lane, const int* index,
                    const ShearSpringPoints& points) {
  double* const s = w.shear.s.data();
  table.advance(touch_of(m, w, of, w.shear.end_touches, lane), points, s, nullptr);
  ShearState& after = w.shear.after[std::size_t(lane)];
  const double* const touches = s + 3 * points.stride;
  for (int k = 0; k < points.count; ++k) {
    if (!(touches[k] > 0)) continue;
    after.push_back({of.first + index[k], {s[k], s[points.stride + k], s[2 * points.stride + k]}});
  }
}

/// Number of the first ground point with a shear spring; there are CompiledModel::ground_anchors.
int first_on_ground(const CompiledModel& m) {
  const auto first = std::find_if(m.shear_springs.begin(), m.shear_springs.end(),
                                  [](const ShearSpringContact& of) { return of.ground; });
  return first == m.shear_springs.end() ? 0 : first->first;
}

/// Computes poses at (q, v), and from them how every contact touches.
template <int L>
void find_touches(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                  const Row<L>* q, const Row<L>* v, typename ShearLanes<L>::Poses& poses,
                  typename ShearLanes<L>::Poses& touches) {
  table.stage<L>().poses_at(m.view, w.stage, q, v, w.zero, poses.data());
  table.stage<L>().touches_at(m.view, poses.data(), touches.data());
}

/// Fills rows (points on the ground, 3) with their elastic displacements. Returns false, and leaves
/// the rows unchanged, if no lane has an entry for any of them.
template <int L>
bool put_ground(const CompiledModel& m, int first, const std::array<ShearState, L>& now,
                Row<L>* rows) {
  bool any = false;
  for (int l = 0; l < L; ++l)
    for (const ShearEntry& e : now[std::size_t(l)]) {
      const int point = e.point - first;
      if (point < 0 || point >= m.ground_anchors) continue;
      if (!any) std::fill_n(rows, 3 * m.ground_anchors, Row<L>{});
      any = true;
      for (int c = 0; c < 3; ++c) rows[3 * point + c][l] = e.s[c];
    }
  return any;
}

/// Lists the points on the ground that touch in some lane. `kept`: as of advance_ground().
template <int L>
void find_grounded(const AlignedVector<Row<L>>& kept, std::vector<int>& out) {
  out.clear();
  for (std::size_t k = 0; 4 * k < kept.size(); ++k) {
    double touches = 0;
    for (int l = 0; l < L; ++l) touches += kept[4 * k + 3][l];
    if (touches > 0) out.push_back(static_cast<int>(k));
  }
}

}  // namespace

template <int L>
void begin_shear(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w) {
  if (m.shear_springs.empty()) return;
  ShearLanes<L>& lanes = w.shear;
  find_touches(m, table, w, w.q0, w.v0, lanes.start, lanes.start_touches);
  if (m.ground_anchors == 0) return;
  Row<L>* const s = lanes.ground.data();
  const bool any = put_ground<L>(m, first_on_ground(m), lanes.now, s);
  table.stage<L>().recall_ground(m.view, w.stage, lanes.start_touches.data(), any ? s : nullptr);
}

template <int L>
void set_list_anchors(const CompiledModel& m, const kernels::KernelTable& table,
                      BasicWorkspace<L>& w, int k, int lane) {
  const auto& list = w.candidates->lists[std::size_t(k)];
  if (list.own_count[lane] == 0) return;
  const ShearSpringContact& of = m.shear_springs[std::size_t(m.pairs[std::size_t(k)].memory)];
  const ShearSpringPoints points = listed<L>(list, lane);
  shear_of_points(w.shear.now[std::size_t(lane)], of, list.own_index + list.stride * lane,
                  points.count, points.stride, points.anchors + 3 * points.stride,
                  w.shear.next[std::size_t(lane)]);
  table.recall(touch_of(m, w, of, w.shear.start_touches, lane), points);
}

template <int L>
void update_shear_state(const CompiledModel& m, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, LaneBits lanes) {
  if (m.shear_springs.empty() || lanes == 0) return;
  ShearLanes<L>& of_lanes = w.shear;
  find_touches(m, table, w, w.q1, w.v1, of_lanes.end, of_lanes.end_touches);
  if (m.ground_anchors > 0) {
    table.stage<L>().advance_ground(m.view, w.stage, of_lanes.end_touches.data(),
                                    of_lanes.ground.data());
    find_grounded<L>(of_lanes.ground, of_lanes.grounded);
  }
  const int first = first_on_ground(m);
  for (int l = 0; l < L; ++l) {
    if (!has(lanes, l)) continue;
    ShearState& after = of_lanes.after[std::size_t(l)];
    after.clear();
    const auto advance = [&](const ShearSpringContact& of, const int* index,
                             const ShearSpringPoints& points) {
      advance_points(m, table, w, of, l, index, points);
    };
    for_each_pair(m, w, l, advance);
    for (const int k : of_lanes.grounded) {
      const Row<L>* kept = &of_lanes.ground[4 * std::size_t(k)];
      if (kept[3][l] > 0) after.push_back({first + k, {kept[0][l], kept[1][l], kept[2][l]}});
    }
    for_each_touching_sensor(m, table, w, of_lanes.end_touches, l, advance);
  }
}

template <int L>
void update_sensor_shear_state(const CompiledModel& m, const kernels::KernelTable& table,
                               BasicWorkspace<L>& w, std::span<const ReadingLane> lanes) {
  ShearLanes<L>& of_lanes = w.shear;
  bool found = false;
  for (int l = 0; l < L; ++l) {
    const ReadingLane& lane = lanes[std::size_t(l)];
    const auto due = [&](const ShearSpringContact& of) { return is_due(m, of, lane.steps); };
    if (std::none_of(m.shear_springs.begin(), m.shear_springs.end(), due)) continue;
    if (!found) find_touches(m, table, w, w.q0, w.v0, of_lanes.end, of_lanes.end_touches);
    found = true;
    ShearState &now = *lane.shear, &after = of_lanes.after[std::size_t(l)];
    after.clear();
    for (const ShearSpringContact& of : m.shear_springs) {
      if (m.shear_interval(of) == 0) break;  // those that keep anchors come first
      if (due(of)) {
        advance_anchors(m, table, touch_of(m, w, of, of_lanes.end_touches, l), now, of_lanes.felt,
                        after);
      } else {
        const auto kept = entries_of(now, m, of);
        after.insert(after.end(), kept.begin(), kept.end());
      }
    }
    after.insert(after.end(), now.begin() + kept_entries(m, now), now.end());
    now = after;
  }
}

template void begin_shear(const CompiledModel&, const kernels::KernelTable&, Workspace&);
template void begin_shear(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&);
template void set_list_anchors(const CompiledModel&, const kernels::KernelTable&, Workspace&, int,
                               int);
template void set_list_anchors(const CompiledModel&, const kernels::KernelTable&, SingleWorkspace&,
                               int, int);
template void update_shear_state(const CompiledModel&, const kernels::KernelTable&, Workspace&,
                                 LaneBits);
template void update_shear_state(const CompiledModel&, const kernels::KernelTable&,
                                 SingleWorkspace&, LaneBits);
template void update_sensor_shear_state(const CompiledModel&, const kernels::KernelTable&,
                                        Workspace&, std::span<const ReadingLane>);
template void update_sensor_shear_state(const CompiledModel&, const kernels::KernelTable&,
                                        SingleWorkspace&, std::span<const ReadingLane>);

}  // namespace tangere
