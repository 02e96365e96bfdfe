// SPDX-License-Identifier: Apache-2.0
// The kernel ends at four times its width; then it is scaled so that shares sum to 1.
#include "engine/model/lateral_spread.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/scene/frames.hpp"

namespace tangere {
namespace {

constexpr double kReach = 4;      // of a spread, in widths
constexpr int kMostReach = 1024;  // [points]

LateralSpread along(double spread, int points, double pitch, const std::string& where) {
  LateralSpread of;
  if (points < 2) return of;
  const double width = spread / pitch;
  const double reach = std::min(std::floor(kReach * width), double(points - 1));
  if (!(reach <= kMostReach))
    throw InputError(fmt::format("{}spread of {} m reaches {} points; expected {} at most", where,
                                 spread, reach, kMostReach));
  for (double k = 0; k <= reach; ++k)
    of.kernel.push_back(std::exp(-0.5 * (k / width) * (k / width)));
  const int last = static_cast<int>(of.kernel.size()) - 1;
  for (int j = 0; j < points; ++j) {
    double sum = 0;
    for (int i = std::max(0, j - last); i <= std::min(points - 1, j + last); ++i)
      sum += of.kernel[static_cast<std::size_t>(std::abs(i - j))];
    of.scale.push_back(1 / sum);
  }
  return of;
}

}  // namespace

bool has_grid(const TactileDescription& d) {
  return d.points.empty() || d.points.size() == static_cast<std::size_t>(d.array.rows) *
                                                    static_cast<std::size_t>(d.array.cols);
}

std::array<double, 2> pitches(const RectArray& array) {
  const kernels::Vec3<double> diagonal = vec3_of(array.corner1) - vec3_of(array.corner0);
  const auto pitch = [&](const Vector3& axis, int points) {
    return dot(diagonal, vec3_of(axis)) / std::max(points - 1, 1);
  };
  return {pitch(array.axis0, array.rows), pitch(array.axis1, array.cols)};
}

std::array<LateralSpread, 2> lateral_spread(const RectArray& array, double spread,
                                            const std::string& where) {
  const std::array<double, 2> pitch = pitches(array);
  return {along(spread, array.rows, std::abs(pitch[0]), where),
          along(spread, array.cols, std::abs(pitch[1]), where)};
}

}  // namespace tangere
