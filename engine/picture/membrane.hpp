// SPDX-License-Identifier: Apache-2.0
// Surface of a gel over a body: a membrane over an obstacle. With the depth δ ≥ 0 of the body at
// every point of a grid, and h = 0 around the grid,
//
//   h ≥ δ,   h - ℓ²∇²h ≥ 0,   one of the two with equality
//
// by the five-point Laplacian and projected over-relaxation from h = δ, odd points after even ones:
//   h ← max(δ, h + ω (Σ_axes l²(h_before + h_behind)/s - h)),  s = 1 + 2 Σ_axes l²,  l = ℓ/pitch
//   ω = 2/(1 + √(1 - r²)),  r = 1 - 1/s
// The number of sweeps is fixed, so the bits are.
#pragma once

#include <span>
#include <vector>

namespace tangere {

/// T: float or double. Owns the scratch of one thread. Only the constructor allocates.
template <class T>
class Membrane {
 public:
  /// `reach_x`, `reach_y`: ℓ by the pitch of columns and of rows; 0: the surface is the depth.
  Membrane(int rows, int cols, double reach_x, double reach_y);

  /// Computes h from δ, both (rows, cols) in one unit. h is exactly 0 where δ is 0 everywhere.
  void settle(std::span<const T> depth, std::span<T> height);
  /// Computes the cotangent of δ from that of h, `height_bar`, at a surface that was computed. With
  /// the contact A = {h = δ > 0}:
  ///   (1 - ℓ²∇²) λ = h̄ off A,  λ = 0 on A,  δ̄ = h̄ + Σ l² λ_neighbour on A, 0 elsewhere
  void pull_back(std::span<const T> depth, std::span<const T> height, std::span<const T> height_bar,
                 std::span<T> depth_bar);

 private:
  void load(std::span<const T> grid, std::vector<T>& split) const;
  [[nodiscard]] std::size_t at(int row, int col) const;
  template <class Update>
  void sweep(const Update& update);
  [[nodiscard]] T pulled(int row, int col) const;

  int rows_, cols_, sweeps_;
  std::size_t stride_, half_;  // numbers of a row of one half; of a half
  T x_, y_, omega_;            // l² of both axes over s
  T x_square_, y_square_;
  // Even columns, then odd ones, each with one number around them: (2, rows + 2, stride).
  // open_: 1 off the contact, else 0.
  std::vector<T> value_, bound_, open_;
};

}  // namespace tangere
