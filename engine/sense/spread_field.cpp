// SPDX-License-Identifier: Apache-2.0
// The matrix is a product of two, one for each axis of the grid.
#include "engine/sense/spread_field.hpp"

#include <algorithm>
#include <cstdlib>

namespace tangere {
namespace {

/// Multiplies what belongs to each place along an axis, `stride` numbers apart, by its scale.
/// `lines`: how often the axis repeats.
void scale_along(const LateralSpread& of, int stride, int lines, double* x) {
  for (int line = 0; line < lines; ++line)
    for (const double scale : of.scale)
      for (int k = 0; k < stride; ++k) *x++ *= scale;
}

void spread_along(const LateralSpread& of, int points, int stride, int lines, bool back,
                  std::span<double> field, std::span<double> scratch) {
  if (of.kernel.empty()) return;
  if (!back) scale_along(of, stride, lines, field.data());
  std::copy(field.begin(), field.end(), scratch.begin());
  std::fill(field.begin(), field.end(), 0.0);
  const int reach = static_cast<int>(of.kernel.size()) - 1;
  for (int line = 0; line < lines; ++line) {
    double* const to = field.data() + line * points * stride;
    const double* const from = scratch.data() + line * points * stride;
    for (int way = -reach; way <= reach; ++way) {
      const double share = of.kernel[std::size_t(std::abs(way))];
      const int first = stride * std::max(0, -way), end = stride * std::min(points, points - way),
                shift = stride * way;
      for (int k = first; k < end; ++k) to[k] += share * from[k + shift];
    }
  }
  if (back) scale_along(of, stride, lines, field.data());
}

}  // namespace

void spread_field(const std::array<LateralSpread, 2>& spread, int rows, int cols, int components,
                  bool back, std::span<double> field, std::span<double> scratch) {
  spread_along(spread[0], rows, components * cols, 1, back, field, scratch);
  spread_along(spread[1], cols, components, rows, back, field, scratch);
}

}  // namespace tangere
