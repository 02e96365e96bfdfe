// SPDX-License-Identifier: Apache-2.0
// A reading is a step without a step: anchors follow from the state that is read, and the law is
// taken at that state.
#include "engine/sense/elastic_field.hpp"

#include "engine/step/kept_anchors.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::kGroup;
using kernels::ShearSpringContact;
using kernels::ShearSpringPoints;
using kernels::ShearSpringTouch;
using kernels::Vec3;

ElasticField::ElasticField(const Model& model) : model_(model), sensor_points_(compiled(model)) {
  std::size_t most = 0;
  for (const CompiledSensor& s : compiled(model).sensors)
    if (s.elastic) most = std::max(most, std::size_t(s.points() + 2 * kGroup));
  s_start_.resize(3 * most);
  s_.resize(4 * most);
  force_.resize(3 * most);
  own_.resize(kernels::kPointNumbers * most);
  if (compiled(model).kept_points > 0) anchors_.resize(6 * most);
  if (most > 0) shares_.reserve(compiled(model).bodies.size());
}

/// Calls f(contact, touch, points) with anchors set for every body that the sensor touches.
template <class F>
void ElasticField::for_each_touched(const PadReader& reader, const Batch& batch, int environment,
                                    int sensor, const F& f) {
  const CompiledModel& m = compiled(model_);
  const kernels::KernelTable& table = kernels::active_kernels();
  const int block = environment / kBlock, group = environment % kBlock / kGroup,
            lane = environment % kGroup;
  const ShearState& memory = batch.shear_state(environment);
  std::size_t next = 0;
  for (const ShearSpringContact& of : m.shear_springs) {
    if (of.sensor != sensor) continue;
    const ShearSpringTouch touch = touch_between(
        of, reader.link(of.contact.link1, group, lane), reader.link(of.contact.link2, group, lane),
        [&](const kernels::Parameter& p) {
          return p.row < 0 ? p.value : kernels::row_of(batch.block(block), p.row, group)[lane];
        });
    const ShearSpringPoints points =
        sensor_points_.find(m.sensors[std::size_t(sensor)], table, touch);
    if (points.count == 0) continue;
    if (m.shear_interval(of) > 0) {
      set_anchors(table, touch, memory, sensor_points_.index(), points, sensor_points_.scratch());
    } else {
      shear_of_points(memory, of, sensor_points_.index(), points.count, points.stride,
                      s_start_.data(), next);
      std::copy_n(s_start_.data(), 3 * points.stride, points.anchors + 3 * points.stride);
      table.recall(touch, points);
    }
    f(of, touch, points);
  }
}

void ElasticField::read(const PadReader& reader, const Batch& batch, int environment, int sensor,
                        std::span<double> field) {
  const CompiledSensor& s = compiled(model_).sensors[std::size_t(sensor)];
  std::fill(field.begin(), field.end(), 0.0);
  for_each_touched(reader, batch, environment, sensor,
                   [&](const ShearSpringContact&, const ShearSpringTouch& touch,
                       const ShearSpringPoints& points) {
                     kernels::active_kernels().advance(touch, points, s_.data(), force_.data());
                     for (int k = 0; k < points.count; ++k) {
                       const auto point = std::size_t(sensor_points_.index()[k]);
                       const double* const axes = &s.point_axes[9 * point];
                       double* const to = &field[3 * std::size_t(s.in_field[point])];
                       for (int c = 0; c < 3; ++c)
                         for (int i = 0; i < 3; ++i)
                           to[c] += axes[3 * c + i] * force_[std::size_t(i * points.stride + k)];
                     }
                   });
}

std::span<const ElasticField::Share> ElasticField::pull_back(
    const PadReader& reader, const Batch& batch, int environment, int sensor,
    std::span<const double> cotangent, std::span<double> memory, std::span<double> points_bar) {
  const CompiledSensor& s = compiled(model_).sensors[std::size_t(sensor)];
  shares_.clear();
  for_each_touched(reader, batch, environment, sensor,
                   [&](const ShearSpringContact& of, const ShearSpringTouch& touch,
                       const ShearSpringPoints& points) {
                     std::fill(force_.begin(), force_.end(), 0.0);
                     std::fill(s_.begin(), s_.end(), 0.0);
                     for (int k = 0; k < points.count; ++k) {
                       const auto point = std::size_t(sensor_points_.index()[k]);
                       const double* const axes = &s.point_axes[9 * point];
                       const double* const from = &cotangent[3 * std::size_t(s.in_field[point])];
                       for (int c = 0; c < 3; ++c)
                         for (int i = 0; i < 3; ++i)
                           force_[std::size_t(i * points.stride + k)] += axes[3 * c + i] * from[c];
                     }
                     kernels::ShearCotangentSums sums{};
                     kernels::ShearPullback pullback = {&touch,          &touch,    points,
                                                        s_start_.data(), nullptr,   force_.data(),
                                                        nullptr,         s_.data(), &sums};
                     const bool keeps = compiled(model_).shear_interval(of) > 0;
                     if (keeps) {
                       std::fill(s_start_.begin(), s_start_.end(), 0.0);
                       std::fill(anchors_.begin(), anchors_.end(), 0.0);
                       pullback.kept = sensor_points_.scratch() + 6 * points.stride;
                       pullback.anchor_out = anchors_.data();
                     }
                     if (!points_bar.empty()) {
                       std::fill(own_.begin(), own_.end(), 0.0);
                       pullback.own = own_.data();
                     }
                     kernels::active_kernels().pull_back_memory(pullback);
                     if (!points_bar.empty())
                       sensor_points_.add_to_points(compiled(model_), s, points, own_.data(),
                                                    points_bar);
                     sums.end.displacement += sums.start;
                     shares_.push_back({&of, sums.end});
                     if (keeps) {
                       add_to_anchors(batch.shear_state(environment), of, sensor_points_.index(),
                                      points, anchors_.data(), memory);
                     } else {
                       add_to_entries(batch.shear_state(environment), of, sensor_points_.index(),
                                      points, s_.data(), memory);
                     }
                   });
  return shares_;
}

}  // namespace tangere
