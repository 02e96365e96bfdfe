// SPDX-License-Identifier: Apache-2.0
// Calls the kernels of kernels/shear: for pairs in several lanes and for the ground all lanes at
// once, else one environment after the other.
#include "engine/step/shear_update.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "engine/step/detection.hpp"
#include "engine/step/dry_friction_state.hpp"
#include "engine/step/kept_anchors.hpp"

namespace tangere {

using kernels::Row;
using kernels::ShearSpringContact;
using kernels::ShearSpringPoints;

namespace {

/// Writes the entries of one lane at the end of a step, one contact after the other. What the
/// vector held before is room for them.
class EntryWriter {
 public:
  EntryWriter() = default;
  explicit EntryWriter(ShearState& to) : to_(&to) {}
  /// Returns room for `count` entries and a vector of them.
  ShearEntry* room(int count) {
    const std::size_t needed = used_ + std::size_t(count + kernels::kGroup);
    if (to_->size() < needed) to_->resize(needed);
    return to_->data() + used_;
  }
  void set_end(const ShearEntry* end) { used_ = std::size_t(end - to_->data()); }
  void finish() { to_->resize(used_); }

 private:
  ShearState* to_ = nullptr;
  std::size_t used_ = 0;
};

/// Writes the entries of a pair's points.
template <int L>
void advance_pair(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                  const ShearSpringContact& of, int lane, EntryWriter& out) {
  const auto& list = w.candidates->lists[std::size_t(of.pair)];
  const ShearSpringPoints points = listed<L>(list, lane);
  const kernels::ShearSpringTouch end = touch_of(m, w, of, w.shear.end_touches, lane);
  kernels::ShearUpdate update = {
      nullptr, &end, points, list.own_index + list.stride * lane, {}, out.room(points.count)};
  table.advance_entries(update);
  out.set_end(update.after);
}

/// With fewer lanes, it takes less time to go through their own lists than through the rows.
constexpr int kFewLanes = 3;

/// Writes the entries of all pairs.
template <int L>
void advance_pairs(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                   std::array<EntryWriter, L>& out) {
  for (const int k : w.shear.touching) {
    const ShearSpringContact& of = m.shear_springs[std::size_t(k)];
    const LaneBits near = w.shear.near[std::size_t(k)];
    if (of.pair < 0) continue;
    if constexpr (L > 1) {
      if (std::popcount(near) >= kFewLanes) {
        kernels::ShearListUpdate update = {
            &of, &w.shear.end_touches[std::size_t(k)], &w.stage, near, {}};
        const auto& list = w.candidates->lists[std::size_t(of.pair)];
        for (int l = 0; l < L; ++l)
          if (has(near, l)) update.after[l] = out[std::size_t(l)].room(list.own_count[l]);
        table.advance_list(update);
        for (int l = 0; l < L; ++l)
          if (has(near, l)) out[std::size_t(l)].set_end(update.after[l]);
        continue;
      }
    }
    for (int l = 0; l < L; ++l)
      if (has(near, l)) advance_pair(m, table, w, of, l, out[std::size_t(l)]);
  }
}

/// Writes the entries of a sensor's points that touch a body.
template <int L>
void advance_sensor(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                    const ShearSpringContact& of, int lane, EntryWriter& out) {
  TouchingSensorPoints& sensor_points = w.shear.sensor_points;
  const kernels::ShearSpringTouch end = touch_of(m, w, of, w.shear.end_touches, lane);
  const ShearSpringPoints points =
      sensor_points.find_near(m.sensors[std::size_t(of.sensor)], table, end);
  if (points.count == 0) return;
  const kernels::ShearSpringTouch start = start_touch_of(m, table, w, of, lane);
  kernels::ShearUpdate update = {&start,
                                 &end,
                                 points,
                                 sensor_points.index(),
                                 entries_from(w.shear, of.first, lane),
                                 out.room(points.count)};
  table.advance_entries(update);
  set_entries(w.shear, lane, update.before);
  out.set_end(update.after);
}

/// Writes the entries of points on the ground. `first`: number of the first of them.
template <int L>
void advance_grounded(const ShearLanes<L>& lanes, int first, int lane, EntryWriter& out) {
  ShearEntry* to = out.room(static_cast<int>(lanes.grounded.size()));
  for (const int k : lanes.grounded) {
    const Row<L>* kept = &lanes.ground[4 * std::size_t(k)];
    if (kept[3][lane] > 0) *to++ = {first + k, {kept[0][lane], kept[1][lane], kept[2][lane]}};
  }
  out.set_end(to);
}

/// Lists the contacts that may touch at the end, from the lanes in which each is considered
/// (ShearLanes::near). Computes how they touch at (q, v).
template <int L>
void find_touches(const CompiledModel& m, const kernels::KernelTable& table, BasicWorkspace<L>& w,
                  const Row<L>* q, const Row<L>* v) {
  ShearLanes<L>& lanes = w.shear;
  const kernels::StageKernels<L>& kernel = table.stage<L>();
  const int n = m.view.n_shear_springs;
  kernel.poses_at(m.view, w.stage, q, v, w.zero, lanes.end.data());
  kernel.clear_far_contacts(m.view, w.stage, lanes.end.data(), lanes.near.data());
  kernel.touches_at(m.view, lanes.end.data(), 0, n, lanes.near.data(), lanes.end_touches.data());
  lanes.touching.clear();
  for (int k = 0; k < n; ++k)
    if (lanes.near[std::size_t(k)] != 0) lanes.touching.push_back(k);
}

/// Considers pairs with candidates, the ground, and sensors that are updated at every step.
template <int L>
void consider(const CompiledModel& m, BasicWorkspace<L>& w, LaneBits lanes) {
  std::vector<LaneBits>& near = w.shear.near;
  for (std::size_t k = 0; k < near.size(); ++k) {
    const ShearSpringContact& of = m.shear_springs[k];
    near[k] = of.pair < 0 && m.shear_interval(of) == 0 ? lanes : kNoLane;
  }
  for_each_considered(m, w, [&](std::size_t g) {
    if (w.candidates->apart[g] != 0) return;
    const kernels::LinkPair& links = m.link_pairs[g];
    for (int i = links.first; i < links.first + links.count; ++i) {
      const int pair = m.pair_order[std::size_t(i)], k = m.pairs[std::size_t(pair)].memory;
      if (k < 0) continue;
      for (int l = 0; l < L; ++l)
        if (w.candidates->lists[std::size_t(pair)].own_count[l] > 0)
          near[std::size_t(k)] |= lanes & (1U << l);
    }
  });
}

/// Lists the points on the ground that touch in some lane, from what advance_ground() wrote.
template <int L>
void find_grounded(const CompiledModel& m, ShearLanes<L>& lanes) {
  for (const int k : lanes.touching) {
    const ShearSpringContact& of = m.shear_springs[std::size_t(k)];
    if (!of.ground) continue;
    const int first = m.grounds[std::size_t(of.grounded)].first_anchor;
    for (int point = first; point < first + of.contact.n_points; ++point) {
      double touches = 0;
      for (int l = 0; l < L; ++l) touches += lanes.ground[4 * std::size_t(point) + 3][l];
      if (touches > 0) lanes.grounded.push_back(point);
    }
  }
}

}  // namespace

/// Writes the entries of all points that touch.
template <int L>
static void update_touches(const CompiledModel& m, const kernels::KernelTable& table,
                           BasicWorkspace<L>& w, LaneBits lanes) {
  ShearLanes<L>& shear = w.shear;
  if constexpr (L > 1)
    if (std::popcount(lanes) >= kFewLanes) lists_to_rows(m, table, w, lanes);
  consider(m, w, lanes);
  find_touches(m, table, w, w.q1, w.v1);
  int first_on_ground = 0;
  shear.grounded.clear();
  if (m.ground_anchors > 0) {
    first_on_ground = m.shear_springs[std::size_t(ground_contacts(m).first)].first;
    table.stage<L>().advance_ground(m.view, w.stage, shear.end_touches.data(), shear.near.data(),
                                    shear.ground.data());
    find_grounded(m, shear);
  }
  std::array<EntryWriter, L> out;
  for (int l = 0; l < L; ++l) out[std::size_t(l)] = EntryWriter(shear.after[std::size_t(l)]);
  advance_pairs<L>(m, table, w, out);
  for (int l = 0; l < L; ++l) {
    if (!has(lanes, l)) continue;
    EntryWriter& to = out[std::size_t(l)];
    advance_grounded(shear, first_on_ground, l, to);
    for (const int k : shear.touching) {
      const ShearSpringContact& of = m.shear_springs[std::size_t(k)];
      if (of.sensor >= 0 && has(shear.near[std::size_t(k)], l))
        advance_sensor(m, table, w, of, l, to);
    }
    to.finish();
  }
}

template <int L>
void update_shear_state(const CompiledModel& m, const kernels::KernelTable& table,
                        BasicWorkspace<L>& w, LaneBits lanes) {
  if (!m.has_shear_state() || lanes == 0) return;
  if (m.shear_springs.empty()) {
    for (ShearState& after : w.shear.after) after.clear();
  } else {
    update_touches(m, table, w, lanes);
  }
  append_dry_friction(m, w, lanes);
}

template <int L>
void update_sensor_shear_state(const CompiledModel& m, const kernels::KernelTable& table,
                               BasicWorkspace<L>& w, std::span<const ReadingLane> lanes) {
  ShearLanes<L>& shear = w.shear;
  const auto due = [&](const ShearSpringContact& of) {
    LaneBits bits = 0;
    for (int l = 0; l < L; ++l)
      if (is_due(m, of, lanes[std::size_t(l)].steps)) bits |= 1U << l;
    return bits;
  };
  LaneBits any = 0;
  for (std::size_t k = 0; k < shear.near.size(); ++k)
    any |= shear.near[k] = due(m.shear_springs[k]);
  if (any == 0) return;
  find_touches(m, table, w, w.q0, w.v0);
  for (int l = 0; l < L; ++l) {
    if (!has(any, l)) continue;
    const ReadingLane& lane = lanes[std::size_t(l)];
    ShearState &now = *lane.shear, &after = shear.after[std::size_t(l)];
    after.clear();
    for (const ShearSpringContact& of : m.shear_springs) {
      if (m.shear_interval(of) == 0) break;  // those that keep anchors come first
      if (!is_due(m, of, lane.steps)) {
        const auto kept = entries_of(now, m, of);
        after.insert(after.end(), kept.begin(), kept.end());
      } else if (has(shear.near[std::size_t(&of - m.shear_springs.data())], l)) {
        advance_anchors(m, table, touch_of(m, w, of, shear.end_touches, l), now,
                        shear.sensor_points, after);
      }
    }
    after.insert(after.end(), now.begin() + kept_entries(m, now), now.end());
    now = after;
  }
}

template void update_shear_state(const CompiledModel&, const kernels::KernelTable&, Workspace&,
                                 LaneBits);
template void update_shear_state(const CompiledModel&, const kernels::KernelTable&,
                                 SingleWorkspace&, LaneBits);
template void update_sensor_shear_state(const CompiledModel&, const kernels::KernelTable&,
                                        Workspace&, std::span<const ReadingLane>);
template void update_sensor_shear_state(const CompiledModel&, const kernels::KernelTable&,
                                        SingleWorkspace&, std::span<const ReadingLane>);

}  // namespace tangere
