// SPDX-License-Identifier: Apache-2.0
// One ball around a sensor is tested first, then its tiles and points, as for contacts.
#include "engine/step/touching_sensor_points.hpp"

#include <algorithm>

#include "kernels/contact/distance.hpp"
#include "kernels/contact/elastic_contact.hpp"

namespace tangere {

using kernels::kAnchorNumbers;
using kernels::kGroup;
using kernels::Vec3;

TouchingSensorPoints::TouchingSensorPoints(const CompiledModel& m) {
  std::size_t most = 0;
  for (const CompiledSensor& s : m.sensors)
    if (s.elastic) most = std::max(most, std::size_t(s.points()));
  if (most == 0) return;
  const std::size_t stride = (most + kGroup - 1) / kGroup * kGroup + kGroup;
  places_.resize(3 * stride);
  anchors_.resize(kAnchorNumbers * stride);
  factors_.resize(kPointCoefficients * stride);
  index_.resize(stride);
  scratch_.resize(kKeptNumbers * stride);
}

kernels::ShearSpringPoints TouchingSensorPoints::find(const CompiledSensor& sensor,
                                                      const kernels::KernelTable& table,
                                                      const kernels::ShearSpringTouch& touch) {
  const kernels::PairContact& c = touch.of->contact;
  const Vec3<double> middle = transposed_times(touch.shape.R, c.middle - touch.shape.p);
  const bool near = kernels::with_distance<double>(
      c.shape, touch.size,
      [&](const auto& shape) -> bool { return nearer_than(shape, middle, c.extent); }, c.grid);
  if (near) return find_near(sensor, table, touch);
  return {places_.data(), anchors_.data(), nullptr, 0, static_cast<int>(index_.size())};
}

kernels::ShearSpringPoints TouchingSensorPoints::find_near(const CompiledSensor& sensor,
                                                           const kernels::KernelTable& table,
                                                           const kernels::ShearSpringTouch& touch) {
  const kernels::PairContact& c = touch.of->contact;
  const int stride = static_cast<int>(index_.size());
  kernels::ShearSpringPoints points = {places_.data(), anchors_.data(), nullptr, 0, stride};
  double pose[12];
  for (int i = 0; i < 9; ++i) pose[i] = touch.shape.R.m[i / 3][i % 3];
  pose[9] = touch.shape.p.x, pose[10] = touch.shape.p.y, pose[11] = touch.shape.p.z;
  points.count = table.find_candidates({&c, touch.size, pose, kernels::kTouchMargin, places_.data(),
                                        stride, touch.faces, index_.data()});
  if (sensor.point_factors.empty()) return points;
  points.factors = factors_.data();
  const int end = (points.count + kGroup - 1) / kGroup * kGroup;
  for (int k = 0; k < end; ++k)
    for (int i = 0; i < kPointCoefficients; ++i)
      factors_[std::size_t(i * stride + k)] =
          k < points.count
              ? sensor.point_factors[std::size_t(kPointCoefficients * index_[std::size_t(k)] + i)]
              : 1;
  return points;
}

void TouchingSensorPoints::add_to_points(const CompiledModel& m, const CompiledSensor& sensor,
                                         const kernels::ShearSpringPoints& listed,
                                         const double* own, std::span<double> points) const {
  const kernels::Mat3<double>& R = m.bodies[std::size_t(sensor.body)].frame.R;
  for (int k = 0; k < listed.count; ++k) {
    const auto number = [&](int i) { return own[i * listed.stride + k]; };
    const Vec3<double> place = transposed_times(R, Vec3<double>{number(0), number(1), number(2)});
    const auto point = std::size_t(sensor.in_field[std::size_t(index_[std::size_t(k)])]);
    double* const to = &points[kernels::kPointNumbers * point];
    to[0] += place.x, to[1] += place.y, to[2] += place.z;
    for (int i = 3; i < kernels::kPointNumbers; ++i) to[i] += number(i);
  }
}

}  // namespace tangere
