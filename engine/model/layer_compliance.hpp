// SPDX-License-Identifier: Apache-2.0
// How the surface of an elastic layer moves under tractions. The layer of thickness t is bonded to
// a stiff back and cut into rectangular cells (docs/layer.md). Axis 0 leads from row to row, axis 1
// from column to column, axis 2 out of the layer.
//
// A traction q e^{i k·x} moves the surface by Ĉ(k) q. With ξ = |k| t, κ = 3 - 4ν,
// G = E/(2(1 + ν)), D = 2κ cosh 2ξ + 4ξ² + 1 + κ² and e = k/|k|
//   normal:   Ĉ_22 = N = (1 - ν)/(G k) (2κ sinh 2ξ - 4ξ)/D
//   lateral:  Ĉ_ab = e_a e_b L + (δ_ab - e_a e_b) T,  L = (1 - ν)/(G k) (2κ sinh 2ξ + 4ξ)/D,
//             T = tanh ξ/(G k)
//   coupled:  Ĉ_a2 = i e_a c = -Ĉ_2a,  c = (2ξ² - κ (1 - 2ν)(cosh 2ξ - 1))/(G k D)
// and at k = 0: N = t (1 - 2ν)/(2G (1 - ν)), L = T = t/G, c = 0.
//
// A traction that is constant on a cell of h_0 × h_1 and the mean displacement of a cell have the
// factor S = sinc(k_0 h_0/2) sinc(k_1 h_1/2) each. On a box of n_0 × n_1 cells with periodic sides
//   C_ab(d) = Σ_k Ĉ_ab S² e^{i k·d}/(n_0 n_1),   k over all wave vectors of the box and their
// aliases.
//
// At a free side of the layer the stress across it vanishes. Cells have images behind the sides,
// mirrored and with the opposite sign: behind a side across axis 0, (q_0, q_1, q_2) becomes
// (q_0, -q_1, -q_2). So the normal stress across the side vanishes, whose effect reaches farthest
// in an incompressible gel. The side's shear stresses do not vanish, and it keeps its height.
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

/// Compliances of a layer with E = 1 Pa at one wave number [m].
struct WaveCompliance {
  double normal, along, across, coupling;  ///< N, L, T, c
};
/// `wave_number`: ≥ 0 [1/m].
WaveCompliance layer_compliance(double thickness, double poisson, double wave_number);

/// C_ab for E = 1 Pa at the offsets of 0 … rows - 1 by 0 … cols - 1 cells, row-major [m]. With one
/// of a and b along an axis, C_ab is odd along it, else even.
std::vector<double> offset_table(const LayerGrid& grid, int a, int b, int rows, int cols);

/// A cell or its image along one axis.
struct CellImage {
  int offset;     ///< of the displaced cell from it [cells]
  bool mirrored;  ///< behind a side
};
/// A cell and its images, if it has any.
struct CellImages {
  std::array<CellImage, 3> list{};
  int count = 1;

  [[nodiscard]] const CellImage* begin() const { return list.data(); }
  [[nodiscard]] const CellImage* end() const { return list.data() + count; }
};
/// Returns cell j of n and its images, as seen from cell i. `doubled`: twice the margin in cells;
/// none: no sides.
CellImages cell_images(int i, int j, int n, std::optional<int> doubled);

/// Twice the margins along both axes, in cells; none: no sides.
std::array<std::optional<int>, 2> doubled_margins(const LayerGrid& grid);

/// Normal displacements of cells by pressures on cells of a layer with E = 1 Pa.
struct LayerCompliance {
  double own = 0;             ///< C(0) without sides: of a cell by its own pressure [m]
  std::vector<double> table;  ///< (cells, cells) symmetric [m]
};
LayerCompliance compile_layer(const LayerGrid& grid);

/// Derivatives of compile_layer() where the cells and the sides stay: [1] and [m].
struct LayerSlopes {
  LayerCompliance thickness, poisson;
};
LayerSlopes compile_layer_slopes(const LayerGrid& grid);

/// Four cells around a point and their bilinear weights, which may be 0.
struct CellWeights {
  std::array<int, 4> cell{};
  std::array<double, 4> weight{};
};
/// Returns those of the points of a grid of cells of side × side points, rows × cols of them.
std::vector<CellWeights> cell_weights(const LayerGrid& grid, int side, int rows, int cols);

}  // namespace tangere
