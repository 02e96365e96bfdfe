// SPDX-License-Identifier: Apache-2.0
// Sensors whose shear state is updated only at the steps at which they are read (docs/shear.md).
// They store the anchors b and a of each point between reads, so no earlier state is needed. A
// point without anchors starts with s = 0 at its present position.
#pragma once

#include "engine/step/shear_lane.hpp"

namespace tangere {

/// Whether the shear state of a contact is updated after `steps` ≥ 0 steps of an episode.
inline bool is_due(const CompiledModel& m, const kernels::ShearSpringContact& of,
                   std::int64_t steps) {
  const int every = m.shear_interval(of);
  return every > 0 && steps >= 0 && steps % every == 0;
}

/// Returns the shear-state entries of a contact's points.
inline std::span<const ShearEntry> entries_of(std::span<const ShearEntry> memory,
                                              const CompiledModel& m,
                                              const kernels::ShearSpringContact& of) {
  return entries_of(memory, {of.first, m.shear_rows(of)});
}

/// How many entries, the first ones, are of sensors that keep anchors.
inline std::ptrdiff_t kept_entries(const CompiledModel& m, std::span<const ShearEntry> memory) {
  return std::lower_bound(memory.begin(), memory.end(), m.kept_points,
                          [](const ShearEntry& e, int value) { return e.point < value; }) -
         memory.begin();
}

/// Ranges of point numbers under which b and a of a contact's points are stored.
inline PointRange b_range(const kernels::ShearSpringContact& of) { return of; }
inline PointRange a_range(const kernels::ShearSpringContact& of) {
  return {of.first + of.contact.n_points, of.contact.n_points};
}

/// Writes two sets of three numbers of points, (6, stride): those of the entries of b, then of a.
template <class Number>
void find_anchors(std::span<const ShearEntry> memory, const kernels::ShearSpringContact& of,
                  const int* index, const kernels::ShearSpringPoints& points, const Number& number,
                  double* out) {
  std::size_t next = 0;
  shear_of_points(memory, b_range(of), index, points.count, points.stride, number, out, next);
  shear_of_points(memory, a_range(of), index, points.count, points.stride, number,
                  out + 3 * points.stride, next);
}

/// Adds (6, stride) numbers of points to those of their entries of b and a.
inline void add_to_anchors(std::span<const ShearEntry> memory,
                           const kernels::ShearSpringContact& of, const int* index,
                           const kernels::ShearSpringPoints& points, const double* numbers,
                           std::span<double> to) {
  add_to_entries(memory, b_range(of), index, points, numbers, to);
  add_to_entries(memory, a_range(of), index, points, numbers + 3 * points.stride, to);
}

/// Sets the anchors of points: those that are kept, else those of an unsheared spring. `kept`:
/// (kKeptNumbers, stride) scratch; its last row is 1 where an anchor is kept, else 0.
inline void set_anchors(const kernels::KernelTable& table, const kernels::ShearSpringTouch& touch,
                        std::span<const ShearEntry> memory, const int* index,
                        const kernels::ShearSpringPoints& points, double* kept) {
  const int stride = points.stride,
            end = (points.count + kernels::kGroup - 1) / kernels::kGroup * kernels::kGroup;
  for (int c = 3; c < 6; ++c) std::fill_n(points.anchors + c * stride, end, 0.0);
  table.recall(touch, points);
  find_anchors(
      memory, *touch.of, index, points,
      [&](std::size_t entry, int c) { return memory[entry].s[c]; }, kept);
  double* const is_kept = kept + 6 * stride;
  for (int k = 0; k < end; ++k) {
    bool any = false;
    for (int i = 0; i < 6; ++i) any = any || kept[i * stride + k] != 0;
    is_kept[k] = any ? 1 : 0;
    if (!any) continue;
    for (int i = 0; i < 6; ++i) points.anchors[i * stride + k] = kept[i * stride + k];
    points.anchors[6 * stride + k] = 0;
  }
}

/// Appends the anchors after a step that ends at `touch`, from those before it.
inline void advance_anchors(const CompiledModel& m, const kernels::KernelTable& table,
                            const kernels::ShearSpringTouch& touch,
                            std::span<const ShearEntry> before, TouchingSensorPoints& sensor_points,
                            ShearState& after) {
  const kernels::ShearSpringContact& of = *touch.of;
  const kernels::ShearSpringPoints points =
      sensor_points.find(m.sensors[std::size_t(of.sensor)], table, touch);
  if (points.count == 0) return;
  const int stride = points.stride;
  set_anchors(table, touch, before, sensor_points.index(), points, sensor_points.scratch());
  double* const s = sensor_points.scratch();
  table.advance(touch, points, s, nullptr);
  for (int c = 0; c < 3; ++c)
    std::copy_n(s + c * stride, points.count, points.anchors + (3 + c) * stride);
  table.recall(touch, points);
  for (int part = 0; part < 2; ++part)
    for (int k = 0; k < points.count; ++k) {
      if (!(s[3 * stride + k] > 0)) continue;
      const double* anchor = points.anchors + 3 * part * stride + k;
      after.push_back({of.first + part * of.contact.n_points + sensor_points.index()[k],
                       {anchor[0], anchor[stride], anchor[2 * stride]}});
    }
}

}  // namespace tangere
