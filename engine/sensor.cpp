// SPDX-License-Identifier: Apache-2.0
// A rectangular array of tactile points, cut into 8×8 tiles and moved into its link's axes.
#include <algorithm>
#include <cmath>

#include "engine/compiled_model.hpp"
#include "kernels/distance.hpp"
#include "kernels/kernel_table.hpp"

namespace tangere {

using kernels::Vec3;

namespace {

constexpr double kFarAway = 1e6;  // padding points [m]: beyond any shape, finite, so nothing overflows

Vec3<double> vec(const Vector3& a) { return {a[0], a[1], a[2]}; }

/// +1 when axis0 × axis1 points out of the body: then pressure, a force into the body, reads positive.
int find_pressure_sign(const TactileDescription& d, const CompiledBody& body, const Vec3<double>& normal) {
  if (d.pressure_sign) return *d.pressure_sign;
  const RectArray& a = d.array;
  const Vec3<double> middle = 0.5 * (vec(a.corner0) + vec(a.corner1));
  double unused;
  const Vec3<double> outward =
      body.shape == PrimitiveShape::sphere
          ? kernels::SphereDistance<double>{body.size.x}.evaluate(middle, unused).n
          : kernels::CuboidDistance<double>{body.size}.evaluate(middle, unused).n;
  return dot(normal, outward) >= 0 ? 1 : -1;
}

}  // namespace

CompiledSensor compile_sensor(const TactileDescription& d, const CompiledBody& body, SensorInfo& info) {
  CompiledSensor s;
  const RectArray& a = d.array;
  const Vec3<double> p0 = vec(a.corner0), axis0 = vec(a.axis0), axis1 = vec(a.axis1);
  const Vec3<double> diagonal = vec(a.corner1) - p0;
  const double step0 = a.rows > 1 ? dot(diagonal, axis0) / (a.rows - 1) : 0;
  const double step1 = a.cols > 1 ? dot(diagonal, axis1) / (a.cols - 1) : 0;
  const Vec3<double> normal = cross(axis0, axis1);
  if (!(std::abs(dot(normal, normal) - 1) < 1e-6))
    throw InputError(d.source.prefix() + "tactile sensor '" + d.name + "': axis0 and axis1 must be perpendicular");

  s.link = body.link;
  s.frame = body.frame;
  constexpr int kSide = 8;
  for (int i0 = 0; i0 < a.rows; i0 += kSide)
    for (int j0 = 0; j0 < a.cols; j0 += kSide) {
      const std::size_t base = s.points.size();
      s.points.resize(base + 3 * kernels::kTactileTile, kFarAway);
      double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
      for (int k = 0; k < kernels::kTactileTile; ++k) {
        const int i = i0 + k / kSide, j = j0 + k % kSide;
        const bool inside = i < a.rows && j < a.cols;
        s.index.push_back(inside ? i * a.cols + j : -1);
        if (!inside) continue;
        const Vec3<double> at = s.frame.R * (p0 + (i * step0) * axis0 + (j * step1) * axis1) + s.frame.p;
        const double xyz[3] = {at.x, at.y, at.z};
        for (int c = 0; c < 3; ++c) {
          s.points[base + std::size_t(c * kernels::kTactileTile + k)] = xyz[c];
          low[c] = std::min(low[c], xyz[c]);
          high[c] = std::max(high[c], xyz[c]);
        }
      }
      double square = 0;
      for (int c = 0; c < 3; ++c) square += 0.25 * (high[c] - low[c]) * (high[c] - low[c]);
      s.bounds.insert(s.bounds.end(), {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]),
                                       std::sqrt(square) * (1 + 1e-12) + 1e-300});
      ++s.n_tiles;
    }
  const Vec3<double> rows[3] = {s.frame.R * axis0, s.frame.R * axis1, -(s.frame.R * normal)};
  for (int r = 0; r < 3; ++r) s.axes[3 * r] = rows[r].x, s.axes[3 * r + 1] = rows[r].y, s.axes[3 * r + 2] = rows[r].z;
  s.law = d.law;

  info.name = d.name;
  info.body = d.body;
  info.rows = a.rows;
  info.cols = a.cols;
  info.points = a.rows * a.cols;
  info.every = d.every;
  info.pressure_sign = find_pressure_sign(d, body, normal);
  return s;
}

}  // namespace tangere
