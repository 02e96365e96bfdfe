// SPDX-License-Identifier: Apache-2.0
// Pressure of a skin by a table of its depth (docs/table.md): every point is a spring of its own,
//   p = E p̂(δ)   where δ > 0, else 0
// with p̂ of engine/model/monotone_cubic.hpp.
#pragma once

#include <span>
#include <vector>

#include "engine/model/compiled_layer.hpp"

namespace tangere {

/// The same functions as GelLayer's.
class TablePressure {
 public:
  /// Computes the pressures for depths δ, (points) [m], times `factor`.
  void solve(const CompiledLayer& layer, std::span<const double> depth, double factor);
  /// p, (points) [Pa].
  [[nodiscard]] std::span<const double> pressure() const { return pressure_; }
  /// Computes the cotangent of the depths from that of the pressures.
  void pull_back(std::span<const double> pressure_bar, std::span<double> depth_bar) const;
  /// Computes how the pressures change with the depths.
  void push_forward(std::span<const double> depth_dot, std::span<double> pressure_dot) const;

 private:
  std::vector<double> pressure_, slope_;  // (points) p and ∂p/∂δ
};

}  // namespace tangere
