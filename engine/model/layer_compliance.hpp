// SPDX-License-Identifier: Apache-2.0
// How the surface of an elastic layer yields to pressure. The layer of thickness t is bonded to a
// stiff back and cut into rectangular cells (docs/layer.md).
//
// A pressure q e^{i k·x} moves the surface by Ĉ(|k|) q. With ξ = k t, κ = 3 - 4ν, G = E/(2(1 + ν)),
//   Ĉ = (1 - ν)/(G k) (2κ sinh 2ξ - 4ξ)/(2κ cosh 2ξ + 4ξ² + 1 + κ²),
//   Ĉ(0) = t (1 - 2ν)/(2G (1 - ν))
// A pressure that is constant on a cell of h_x × h_y and the mean displacement of a cell have the
// factor S = sinc(k_x h_x/2) sinc(k_y h_y/2) each. On a box of n_x × n_y cells with periodic sides
//   C(d) = Σ_k Ĉ S² e^{i k·d}/(n_x n_y),   k over all wave vectors of the box and their aliases.
#pragma once

#include <array>
#include <optional>
#include <vector>

namespace tangere {

struct LayerGrid {
  int rows = 0, cols = 0;        ///< cells
  double height = 0, width = 0;  ///< of a cell: from row to row, and from column to column [m]
  double thickness = 0;          ///< t [m]
  double poisson = 0;            ///< ν, below ½
  /// Distance of the layer's free sides from the cells [m], rounded to half cells. None: the layer
  /// has no sides.
  std::optional<double> margin{};

  [[nodiscard]] int cells() const { return rows * cols; }
};

/// Ĉ of a layer with E = 1 Pa at the wave number k ≥ 0 [m].
double layer_compliance(double thickness, double poisson, double wave_number);

/// Displacements of cells by pressures on cells of a layer with E = 1 Pa.
struct LayerCompliance {
  double own = 0;             ///< C(0) without sides: of a cell by its own pressure [m]
  std::vector<double> table;  ///< (cells, cells) symmetric [m]
};

/// Four cells around a point and their bilinear weights, which may be 0.
struct CellWeights {
  std::array<int, 4> cell{};
  std::array<double, 4> weight{};
};
/// Returns those of the points of a grid of cells of side × side points, rows × cols of them.
std::vector<CellWeights> cell_weights(const LayerGrid& grid, int side, int rows, int cols);

/// Sides are mirrors: every cell has images in the four sides and at the four corners.
LayerCompliance compile_layer(const LayerGrid& grid);

}  // namespace tangere
