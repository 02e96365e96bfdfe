// SPDX-License-Identifier: Apache-2.0
// Interpolation of a table that never falls by cubics that never fall (Fritsch and Carlson 1980,
// with the slopes of Fritsch and Butland 1984): C1, and linear beyond the last number.
#pragma once

#include <vector>

namespace tangere {

class MonotoneCubic {
 public:
  MonotoneCubic() = default;
  /// `x` ascends, `y` does not fall; both have n ≥ 2 numbers.
  MonotoneCubic(std::vector<double> x, std::vector<double> y);

  struct Point {
    double value, slope;
  };
  /// Returns y and dy/dx at x ≥ x[0].
  [[nodiscard]] Point at(double x) const;

 private:
  std::vector<double> x_, y_, slope_;
};

}  // namespace tangere
