// SPDX-License-Identifier: Apache-2.0
// Calls the kernels lane by lane and adds their sums to the cotangents of the links.
#include "engine/derivative/shear_adjoint.hpp"

#include "engine/derivative/link_cotangents.hpp"
#include "engine/step/dry_friction_state.hpp"
#include "engine/step/kept_anchors.hpp"
#include "engine/step/layer_sums.hpp"

namespace tangere {

using kernels::Frame;
using kernels::kGroup;
using kernels::LinkPose;
using kernels::MotionCotangent;
using kernels::Row;
using kernels::ShearSpringContact;
using kernels::ShearSpringPoints;
using kernels::ShearSpringTouch;
using kernels::Vec6;

namespace {

/// Returns the numbers of a sensor's points among those of all; empty for other contacts.
std::span<double> points_of(const CompiledModel& m, const ShearSpringContact& of,
                            std::span<double> all) {
  if (of.sensor < 0 || all.empty()) return {};
  const auto numbers = [](const CompiledSensor& s) {
    return kernels::kPointNumbers * std::size_t(s.points());
  };
  std::size_t first = 0;
  for (int s = 0; s < of.sensor; ++s) first += numbers(m.sensors[std::size_t(s)]);
  return all.subspan(first, numbers(m.sensors[std::size_t(of.sensor)]));
}

/// Pulls cotangents of the motion of body 2 relative to body 1 back to the two links.
template <int L>
void hand_on(const ShearSpringContact& of, const AlignedVector<LinkPose<Row<L>>>& poses,
             const Vec6<double>& displacement, const Vec6<double>& twist, int lane,
             AlignedVector<MotionCotangent<Row<L>>>& links) {
  const int first = of.contact.link1, second = of.contact.link2;
  const LinkPose<double> one = pose_of<L>(poses, first, lane),
                         two = pose_of<L>(poses, second, lane);
  const Frame<double> second_in_first = relative(one.world, two.world);
  const Vec6<double> Z = motion_to_parent(second_in_first, two.V);
  const Vec6<double> pose = displacement + cross_wrench(Z, twist);
  const auto link = [&](int k) { return k < 0 ? nullptr : &links[std::size_t(k)]; };
  hand_on_to_links<L>(second_in_first, pose, twist, lane, link(first), link(second));
}

/// Computes cotangents of the friction of the listed points of a layer's pair, (3, stride) in body
/// 1's axes, from the slip along λ.
template <int L>
void friction_of_layer(const CompiledModel& m, const kernels::KernelTable& table,
                       BasicWorkspace<L>& w, const ShearSpringContact& of, const Vec6<double>& slip,
                       int lane, int stride, double* out) {
  std::fill_n(out, 3 * stride, 0.0);
  const int pad = m.pairs[std::size_t(of.pair)].layer_pad;
  for_each_layer(m, w, [&](const kernels::LinkPair& links, int k) {
    if (k != pad || links.link1 != of.contact.link1 || links.link2 != of.contact.link2) return;
    solve_layer(m, table, w, links, pad, lane);
    w.layer_contact->for_each_point([&](const LayerContact::Point& p) {
      if (w.layer_members[std::size_t(p.body)] != of.pair) return;
      const kernels::Vec3<double> bar = w.layer_contact->friction_bar(p, -slip);
      out[p.candidate] = bar.x, out[stride + p.candidate] = bar.y;
      out[2 * stride + p.candidate] = bar.z;
    });
  });
}

}  // namespace

template <int L>
ShearAdjoint<L>::ShearAdjoint(const CompiledModel& m, int losses) {
  if (m.shear_springs.empty()) return;
  start_.resize(std::size_t(losses));
  for (Cotangents& of : start_) of.resize(m.links.size());
  end_.resize(m.links.size());
  at_.resize(m.links.size());
  slip_.resize(m.links.size());
  at_touches_.resize(m.shear_springs.size());
  slip_touches_.resize(m.shear_springs.size());
  rows_.resize(2 * std::size_t(m.nv) + kernels::kPlaceNumbers * m.links.size());
  std::size_t bytes = 0, stride = 0;
  for (const kernels::KernelTable* table : kernels::available_kernels())
    bytes = std::max(bytes, table->pullback_bytes(m.view));
  scratch_.resize(cache_lines(bytes));
  for (const ShearSpringContact& of : m.shear_springs)
    stride = std::max(stride, std::size_t(of.contact.n_points + 2 * kGroup));
  numbers_.resize((18 + kernels::kPointNumbers) * stride);
}

template <int L>
void ShearAdjoint<L>::begin(const CompiledModel& m) {
  if (m.shear_springs.empty()) return;
  for (Cotangents& of : start_) std::fill(of.begin(), of.end(), MotionCotangent<Row<L>>{});
}

template <int L>
void ShearAdjoint<L>::add_to_state(const CompiledModel& m, const kernels::KernelTable& table,
                                   BasicWorkspace<L>& w, LaneBits lanes, const Row<L>* q,
                                   const Row<L>* v, Cotangents& links, Row<L>* q_bar, Row<L>* v_bar,
                                   Row<L>* parameters) {
  std::fill(rows_.begin(), rows_.end(), Row<L>{});
  Row<L>*const q_sum = rows_.data(), *const v_sum = q_sum + m.nv, *const place_sum = v_sum + m.nv;
  table.stage<L>().pull_back_poses(m.view, w.stage, q, v, w.zero, scratch_.data()->bytes,
                                   links.data(), q_sum, v_sum,
                                   parameters == nullptr ? nullptr : place_sum);
  const auto add = [&](Row<L>* to, const Row<L>* from, int count) {
    for (int i = 0; i < count; ++i)
      for (int l = 0; l < L; ++l)
        if (has(lanes, l)) to[i][l] += from[i][l];
  };
  add(q_bar, q_sum, m.nv);
  add(v_bar, v_sum, m.nv);
  if (parameters != nullptr)
    add(parameters + m.view.rows.places, place_sum, kernels::kPlaceNumbers * m.view.n_links);
}

/// Pulls one contact back. `points`: of a sensor's points, or empty. `own`: scratch.
template <int L>
void ShearAdjoint<L>::pull_back_points(const CompiledModel& m, const kernels::KernelTable& table,
                                       const BasicWorkspace<L>& w, kernels::ShearPullback& pullback,
                                       std::span<double> points, double* own) {
  if (!points.empty()) {
    std::fill_n(own, kernels::kPointNumbers * pullback.points.stride, 0.0);
    pullback.own = own;
  }
  table.pull_back_memory(pullback);
  if (points.empty()) return;
  const CompiledSensor& sensor = m.sensors[std::size_t(pullback.end->of->sensor)];
  w.shear.sensor_points.add_to_points(m, sensor, pullback.points, own, points);
}

/// Pulls back through all contacts: the final shear state, or the forces along a slip.
template <int L>
void ShearAdjoint<L>::pull_back(const CompiledModel& m, const kernels::KernelTable& table,
                                BasicWorkspace<L>& w, LaneBits lanes, bool from_forces,
                                LossRows<L>& loss, int number) {
  for (int l = 0; l < L; ++l) {
    if (!has(lanes, l)) continue;
    const std::size_t lane = std::size_t(l);
    const ShearState &now = w.shear.now[lane], &after = w.shear.after[lane];
    const std::vector<double>& bar = loss.memory[lane];
    std::vector<double>& before = loss.memory_before[lane];
    before.resize(3 * now.size());
    if (!from_forces && bar.empty()) continue;
    const auto one = [&](const ShearSpringContact& of, const int* index,
                         const ShearSpringPoints& points) {
      const std::size_t rows = 3 * std::size_t(points.stride);
      double *const s_start = numbers_.data(), *const s_bar = s_start + rows,
                    *const s_out = s_bar + rows;
      std::size_t next = 0;
      shear_of_points(now, of, index, points.count, points.stride, s_start, next);
      if (!from_forces)
        shear_of_points(
            after, of, index, points.count, points.stride,
            [&](std::size_t entry, int c) { return bar[3 * entry + std::size_t(c)]; }, s_bar, next);
      std::fill(s_out, s_out + rows, 0.0);
      const ShearSpringTouch start = start_touch_of(m, table, w, of, l),
                             end = touch_of(m, w, of, at_touches_, l);
      Vec6<double> slip{};
      if (from_forces) slip = touch_of(m, w, of, slip_touches_, l).twist;
      const bool layered =
          from_forces && of.pair >= 0 && m.pairs[std::size_t(of.pair)].layer_pad >= 0;
      if (layered) friction_of_layer<L>(m, table, w, of, slip, l, points.stride, s_bar);
      kernels::ShearCotangentSums sums{};
      kernels::ShearPullback pullback = {&start,
                                         &end,
                                         points,
                                         s_start,
                                         from_forces ? nullptr : s_bar,
                                         layered ? s_bar : nullptr,
                                         from_forces && !layered ? &slip : nullptr,
                                         s_out,
                                         &sums};
      pull_back_points(m, table, w, pullback, points_of(m, of, loss.points[lane]), s_out + rows);
      if (!from_forces) hand_on<L>(of, at_, sums.end.displacement, sums.end.twist, l, end_);
      hand_on<L>(of, w.shear.start, sums.start, Vec6<double>{}, l, start_[std::size_t(number)]);
      if (loss.parameters != nullptr && !layered)  // layer_parameters.hpp
        for (std::size_t k = 0; k < kCoefficients; ++k)
          loss.parameters[std::size_t(of.number) + k][l] += sums.end.law[k];
      add_to_entries(now, of, index, points, s_out, before);
    };
    for_each_contact(m, w, l, one);
    if (!from_forces) for_each_touching_sensor(m, table, w, at_touches_, l, one);
  }
}

template <int L>
void ShearAdjoint<L>::reverse_end(const CompiledModel& m, const kernels::KernelTable& table,
                                  BasicWorkspace<L>& w, LaneBits lanes, LossRows<L>& loss,
                                  int number) {
  reverse_dry_end(m, w, lanes, loss);
  if (m.shear_springs.empty()) return;
  std::fill(end_.begin(), end_.end(), MotionCotangent<Row<L>>{});
  table.stage<L>().poses_at(m.view, w.stage, w.q1, w.stage.v, w.zero, at_.data());
  table.stage<L>().touches_at(m.view, at_.data(), 0, m.view.n_shear_springs, nullptr,
                              at_touches_.data());
  pull_back(m, table, w, lanes, false, loss, number);
  add_to_state(m, table, w, lanes, w.q1, w.stage.v, end_, loss.q, loss.v, loss.parameters);
}

/// The elastic displacements of joints with dry friction, s' = (q - z)/max(1, |y|).
template <int L>
void ShearAdjoint<L>::reverse_dry_end(const CompiledModel& m, const BasicWorkspace<L>& w,
                                      LaneBits lanes, LossRows<L>& loss) const {
  for (int l = 0; l < L; ++l) {
    const std::vector<double>& bar = loss.memory[std::size_t(l)];
    if (!has(lanes, l) || bar.empty()) continue;
    const ShearState& after = w.shear.after[std::size_t(l)];
    for (const ShearEntry& entry : dry_entries(m, after)) {
      const DryDof& dof = dry_dof_of(m, entry);
      const kernels::DofEffects& e = m.dof_effects[std::size_t(dof.v)];
      const auto [share, hold, rigid] = dry_friction_at_end(m, w, dof, w.stage.v, l);
      const double s_bar = bar[3 * std::size_t(&entry - after.data())],
                   s = w.q1[dof.q][l] - w.stage.dry_anchor[dof.v][l],
                   d_hold = -(1 - rigid) * share * hold * hold * e.friction_rate,
                   place_bar = s_bar * (hold + s * d_hold);
      loss.q[dof.v][l] += place_bar;
      loss.v[dof.v][l] += s_bar * s * d_hold * e.friction_time;
      loss.dry_anchor[dof.v][l] -= place_bar;
    }
  }
}

/// Anchors are z = q₀ - s₀.
template <int L>
void ShearAdjoint<L>::finish_dry(const CompiledModel& m, const BasicWorkspace<L>& w, LaneBits lanes,
                                 LossRows<L>& loss) const {
  for (int l = 0; l < L; ++l) {
    if (!has(lanes, l)) continue;
    for (const DryDof& dof : m.dry_dofs) loss.q_centre[dof.v][l] += loss.dry_anchor[dof.v][l];
    const ShearState& now = w.shear.now[std::size_t(l)];
    for (const ShearEntry& entry : dry_entries(m, now))
      loss.memory_before[std::size_t(l)][3 * std::size_t(&entry - now.data())] -=
          loss.dry_anchor[dry_dof_of(m, entry).v][l];
  }
}

/// Pulls one contact of one lane back.
template <int L>
void ShearAdjoint<L>::pull_back_reading(const CompiledModel& m, const kernels::KernelTable& table,
                                        BasicWorkspace<L>& w, const ShearSpringContact& of,
                                        int lane, const TapedReading& reading, LossRows<L>& loss) {
  TouchingSensorPoints& sensor_points = w.shear.sensor_points;
  const ShearSpringTouch touch = touch_of(m, w, of, at_touches_, lane);
  const ShearSpringPoints points =
      sensor_points.find(m.sensors[std::size_t(of.sensor)], table, touch);
  if (points.count == 0) return;
  set_anchors(table, touch, reading.before, sensor_points.index(), points, sensor_points.scratch());
  const std::size_t rows = 3 * std::size_t(points.stride);
  double *const none = numbers_.data(), *const s_out = none + rows,
                *const anchor_bar = s_out + rows, *const anchor_out = anchor_bar + 2 * rows;
  std::fill_n(none, 6 * rows, 0.0);
  const std::vector<double>& bar = loss.kept[std::size_t(lane)];
  find_anchors(
      reading.after, of, sensor_points.index(), points,
      [&](std::size_t entry, int c) { return bar[3 * entry + std::size_t(c)]; }, anchor_bar);
  kernels::ShearCotangentSums sums{};
  kernels::ShearPullback pullback = {&touch,  &touch,  points, none, nullptr,
                                     nullptr, nullptr, s_out,  &sums};
  pullback.anchor_bar = anchor_bar;
  pullback.kept = sensor_points.scratch() + 6 * points.stride;
  pullback.anchor_out = anchor_out;
  pull_back_points(m, table, w, pullback, points_of(m, of, loss.points[std::size_t(lane)]),
                   anchor_out + 2 * rows);
  sums.end.displacement += sums.start;
  hand_on<L>(of, at_, sums.end.displacement, sums.end.twist, lane, end_);
  if (loss.parameters != nullptr)
    for (std::size_t k = 0; k < kCoefficients; ++k)
      loss.parameters[std::size_t(of.number) + k][lane] += sums.end.law[k];
  add_to_anchors(reading.before, of, sensor_points.index(), points, anchor_out, kept_before_);
}

template <int L>
void ShearAdjoint<L>::reverse_readings(const CompiledModel& m, const kernels::KernelTable& table,
                                       BasicWorkspace<L>& w,
                                       const std::array<TapedReading, L>& readings,
                                       std::vector<LossRows<L>>& losses) {
  LaneBits lanes = 0;
  for (int l = 0; l < L; ++l)
    for (const ShearSpringContact& of : m.shear_springs)
      if (is_due(m, of, readings[std::size_t(l)].steps)) lanes |= 1U << l;
  if (lanes == 0) return;
  table.stage<L>().poses_at(m.view, w.stage, w.q1, w.v1, w.zero, at_.data());
  table.stage<L>().touches_at(m.view, at_.data(), 0, m.view.n_shear_springs, nullptr,
                              at_touches_.data());
  for (LossRows<L>& loss : losses) {
    std::fill(end_.begin(), end_.end(), MotionCotangent<Row<L>>{});
    for (int l = 0; l < L; ++l) {
      const TapedReading& reading = readings[std::size_t(l)];
      std::vector<double>& bar = loss.kept[std::size_t(l)];
      if (!has(lanes, l) || bar.empty()) continue;
      kept_before_.assign(3 * reading.before.size(), 0.0);
      for (const ShearSpringContact& of : m.shear_springs) {
        if (m.shear_interval(of) == 0) break;  // those that keep anchors come first
        if (is_due(m, of, reading.steps)) {
          pull_back_reading(m, table, w, of, l, reading, loss);
          continue;
        }
        const auto from = entries_of(reading.after, m, of), to = entries_of(reading.before, m, of);
        std::copy_n(bar.begin() + 3 * (from.data() - reading.after.data()), 3 * from.size(),
                    kept_before_.begin() + 3 * (to.data() - reading.before.data()));
      }
      bar = kept_before_;
    }
    add_to_state(m, table, w, lanes, w.q1, w.v1, end_, loss.q, loss.v, loss.parameters);
  }
}

template <int L>
void ShearAdjoint<L>::reverse_forces(const CompiledModel& m, const kernels::KernelTable& table,
                                     BasicWorkspace<L>& w, LaneBits lanes, const Row<L>* q,
                                     const Row<L>* lambda, LossRows<L>& loss, int number) {
  if (m.shear_springs.empty()) return;
  table.stage<L>().poses_at(m.view, w.stage, q, w.stage.v, w.zero, at_.data());
  table.stage<L>().poses_at(m.view, w.stage, q, lambda, w.zero, slip_.data());
  table.stage<L>().touches_at(m.view, at_.data(), 0, m.view.n_shear_springs, nullptr,
                              at_touches_.data());
  table.stage<L>().touches_at(m.view, slip_.data(), 0, m.view.n_shear_springs, nullptr,
                              slip_touches_.data());
  pull_back(m, table, w, lanes, true, loss, number);
}

template <int L>
void ShearAdjoint<L>::finish(const CompiledModel& m, const kernels::KernelTable& table,
                             BasicWorkspace<L>& w, LaneBits lanes, LossRows<L>& loss, int number) {
  finish_dry(m, w, lanes, loss);
  if (m.shear_springs.empty()) return;
  add_to_state(m, table, w, lanes, w.q0, w.v0, start_[std::size_t(number)], loss.q_centre,
               loss.v_centre, loss.parameters);
}

template class ShearAdjoint<kGroup>;
template class ShearAdjoint<1>;

}  // namespace tangere
