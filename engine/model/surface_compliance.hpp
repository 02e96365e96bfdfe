// SPDX-License-Identifier: Apache-2.0
// How the whole surface of a layer moves under tractions on its cells, in all three directions
// (engine/model/layer_compliance.hpp has equations and axes).
#pragma once

#include <span>
#include <vector>

#include "engine/model/layer_compliance.hpp"

namespace tangere {

/// Of a layer with E = 1 Pa. Images across axis 1 are in the tables, those across axis 0 in the
/// sums.
class SurfaceCompliance {
 public:
  explicit SurfaceCompliance(const LayerGrid& grid);
  /// Memory that it would take [bytes].
  static double bytes(const LayerGrid& grid);

  /// Computes displacements u = C q, (3, cells) [m], from tractions q, (3, cells) [Pa].
  void displace(std::span<const double> traction, std::span<double> displacement) const;
  /// Computes the cotangent of q, (3, cells), from that of u at cells where q is not 0, and sets it
  /// to 0 elsewhere.
  void pull_back(std::span<const double> traction, std::span<const double> displacement_bar,
                 std::span<double> traction_bar) const;

 private:
  template <class F>
  void for_rows(std::span<const double> traction, const F& f) const;

  int rows_, cols_;
  std::optional<int> below_;  ///< twice the margin along axis 0, in cells
  /// [a][b]: (offsets along axis 0, col of the traction, col of the displacement) [m].
  std::array<std::array<std::vector<double>, 3>, 3> tables_;
};

}  // namespace tangere
