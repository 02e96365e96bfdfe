// SPDX-License-Identifier: Apache-2.0
// Explicit integration to rounding, for references: the modified midpoint rule with extrapolation
// (Gragg, Bulirsch and Stoer).
#pragma once

#include <array>
#include <vector>

namespace tangere::testing {

/// Returns y(duration) of ẏ = f(y). A step has eight midpoint runs of 2 … 16 substeps. Their errors
/// are series in h², so the order is 16.
template <class Vector, class F, class S>
Vector extrapolate(const F& f, Vector y, S duration, int steps) {
  constexpr int kRuns = 8;
  const S step = duration / S(steps);
  for (int n = 0; n < steps; ++n) {
    const Vector slope = f(y);
    std::vector<Vector> row;  // T(j, 0) … T(j, j): Neville's table in h²
    for (int j = 0; j < kRuns; ++j) {
      const int count = 2 * (j + 1);
      const S h = step / S(count);
      Vector before = y, now = y + h * slope;
      for (int k = 1; k < count; ++k) {
        Vector next = before + S(2) * h * f(now);
        before = now;
        now = next;
      }
      std::vector<Vector> above = row;
      row = {Vector((before + now + h * f(now)) / S(2))};
      for (int k = 1; k <= j; ++k) {
        const S ratio = S(count) / S(2 * (j + 1 - k));
        row.push_back(row[std::size_t(k - 1)] +
                      (row[std::size_t(k - 1)] - above[std::size_t(k - 1)]) /
                          (ratio * ratio - S(1)));
      }
    }
    y = row.back();
  }
  return y;
}

}  // namespace tangere::testing
