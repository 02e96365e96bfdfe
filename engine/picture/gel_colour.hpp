// SPDX-License-Identifier: Apache-2.0
// Colours of a gel by the slopes p, q of its surface (engine/scene/gel.hpp has the equation):
//   n = (-p, -q, 1) N,  N = 1/√(1 + p² + q²)
// and their pullback: with G = Σ_c C̄_c ∂C_c/∂n,
//   p̄ = -N (G_x - (G·n) n_x),  q̄ = -N (G_y - (G·n) n_y)
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "engine/scene/gel.hpp"

namespace tangere {

/// φ of a normal (engine/scene/gel.hpp).
constexpr std::array<double, kShades> shades(double x, double y, double z) {
  return {x, y, z - 1, x * x, x * y, y * y, x * z, y * z};
}

/// Places of pixels: from the picture's middle, over its smaller side.
double picture_place(int pixel, int pixels, int smaller);

/// T: float or double. Several threads may use it at once.
template <class T>
class GelColour {
 public:
  /// The background is averaged over the area of each pixel where the picture has another size.
  GelColour(const Gel& gel, int height, int width);

  /// Returns the background of a row, (3, width): R of all pixels, then G, then B.
  [[nodiscard]] std::span<const T> background(int row) const;
  /// Computes the colours of a row, (3, width), not clamped, from its slopes, and `up`, N of its
  /// normals, (width) each.
  void shade(int row, std::span<const T> p, std::span<const T> q, std::span<T> planes,
             std::span<T> up) const;
  /// Computes the cotangents of the slopes of a row from those of its colours, (3, width). `up`: as
  /// shade() gave it.
  void pull_back(int row, std::span<const T> p, std::span<const T> q, std::span<const T> up,
                 std::span<const T> planes_bar, std::span<T> p_bar, std::span<T> q_bar) const;

 private:
  struct Row {  ///< a + d y, and b, of all channels and φ
    std::array<std::array<T, kShades>, kColours> level, tilt;
  };
  [[nodiscard]] Row row_of(int row) const;

  int height_, width_;
  std::array<std::array<std::array<T, kShadePlaces>, kShades>, kColours> lamps_{};
  std::vector<T> x_, y_;       // places of columns and rows
  std::vector<T> background_;  // (height, 3, width)
};

}  // namespace tangere
