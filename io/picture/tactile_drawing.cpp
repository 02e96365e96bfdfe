// SPDX-License-Identifier: Apache-2.0
// In an image, "down" is the direction in which the row numbers of points increase along the body:
// the sum of the points' positions, each times its row. "Right" follows in the same way from
// columns.
#include "io/picture/tactile_drawing.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {
namespace {

double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

bool has_pixel(const TactilePoint& p) { return p.pixel[0] >= 0 && p.pixel[1] >= 0; }

/// Returns a direction of length 1, or 0 if all points share a row (which = 0) or column (1).
Vector3 direction(const std::vector<TactilePoint>& points, std::size_t which) {
  double mean = 0, count = 0;
  for (const TactilePoint& p : points)
    if (has_pixel(p)) mean += p.pixel[which], count += 1;
  mean /= count;
  Vector3 sum{};
  for (const TactilePoint& p : points)
    for (std::size_t k = 0; k < 3 && has_pixel(p); ++k)
      sum[k] += (p.pixel[which] - mean) * p.position[k];
  const double length = std::sqrt(dot(sum, sum));
  for (double& x : sum) x = length > 0 ? x / length : 0;
  return sum;
}

double extent(const std::vector<TactilePoint>& points, const Vector3& along) {
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const TactilePoint& p : points)
    if (has_pixel(p))
      low = std::min(low, dot(p.position, along)), high = std::max(high, dot(p.position, along));
  return high - low;
}

TactileDrawing image_of(const std::vector<TactilePoint>& points) {
  TactileDrawing d;
  for (const TactilePoint& p : points)
    if (has_pixel(p))
      d.rows = std::max(d.rows, p.pixel[0] + 1), d.cols = std::max(d.cols, p.pixel[1] + 1);
  const Vector3 down = direction(points, 0), right = direction(points, 1);
  d.height = extent(points, down), d.width = extent(points, right);
  for (const TactilePoint& p : points) {
    d.cell.push_back(has_pixel(p) ? p.pixel : std::array{-1, -1});
    d.turn.push_back(
        {dot(p.axis0, down), dot(p.axis1, down), dot(p.axis0, right), dot(p.axis1, right)});
  }
  return d;
}

}  // namespace

std::array<double, 2> TactileDrawing::shear(std::size_t point, double f0, double f1) const {
  if (turn.empty()) return {down * f0, right * f1};
  const std::array<double, 4>& t = turn[point];
  return {t[0] * f0 + t[1] * f1, t[2] * f0 + t[3] * f1};
}

bool drawable(const SensorLayout& s) {
  return s.rectangular() || std::any_of(s.list.begin(), s.list.end(), has_pixel);
}

TactileDrawing drawing_of(const SensorLayout& s) {
  if (!s.rectangular()) return image_of(s.list);
  TactileDrawing d;
  d.rows = s.rows, d.cols = s.cols;
  const std::array<double, 2> pitch = s.pitch();
  d.height = std::abs(pitch[0]) * (s.rows - 1), d.width = std::abs(pitch[1]) * (s.cols - 1);
  d.down = pitch[0] < 0 ? -1 : 1, d.right = pitch[1] < 0 ? -1 : 1;
  for (int k = 0; k < s.points; ++k) d.cell.push_back({k / s.cols, k % s.cols});
  return d;
}

}  // namespace tangere
