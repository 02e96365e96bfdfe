// SPDX-License-Identifier: Apache-2.0
// The sum over wave vectors runs over one axis after the other.
#include "engine/model/layer_compliance.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

namespace tangere {
namespace {

constexpr int kAliases = 3;         // on each side of a wave number
constexpr int kPads = 3;            // of the periodic box, at least
constexpr double kThicknesses = 6;  // of it

double sinc(double x) { return x == 0 ? 1 : std::sin(x) / x; }

/// One axis of the periodic box.
struct Axis {
  int cells;                  ///< of the box; even
  double pitch;               ///< [m]
  std::vector<double> share;  ///< (cells / 2 + 1, 2 kAliases + 1) S² of a wave number's aliases
  std::vector<double> waves;  ///< the same: wave numbers [1/m]

  /// `n`: cells of the pad; `offsets`: how many of them are needed.
  Axis(int n, int offsets, double h, double thickness)
      : cells(2 * static_cast<int>(std::ceil(
                      0.5 * (std::max(kPads * n, offsets + n) + kThicknesses * thickness / h)))),
        pitch(h) {
    for (int m = 0; m <= cells / 2; ++m)
      for (int a = -kAliases; a <= kAliases; ++a) {
        const double k = 2 * std::numbers::pi * (m + a * cells) / (cells * pitch);
        const double s = sinc(k * pitch / 2);
        waves.push_back(k);
        share.push_back(s * s);
      }
  }
  /// Multiplicity of wave m among 0 … cells - 1, of which ± m are one, times its cosine.
  [[nodiscard]] double cosine(int m, int offset) const {
    const double both = m == 0 || 2 * m == cells ? 1 : 2;
    // The product is reduced, so that the cosine is exact at whole turns.
    const auto turn = static_cast<double>(std::int64_t{m} * offset % cells) / cells;
    return both * std::cos(2 * std::numbers::pi * turn);
  }
};

/// Σ over aliases of Ĉ S² for each pair of wave numbers, (y, x).
std::vector<double> spectrum(const LayerGrid& grid, const Axis& y, const Axis& x) {
  constexpr int kEach = 2 * kAliases + 1;
  std::vector<double> sums;
  for (int m = 0; m <= y.cells / 2; ++m)
    for (int n = 0; n <= x.cells / 2; ++n) {
      double sum = 0;
      for (std::size_t a = 0; a < kEach; ++a)
        for (std::size_t b = 0; b < kEach; ++b) {
          const std::size_t i = std::size_t(m) * kEach + a, j = std::size_t(n) * kEach + b;
          sum += y.share[i] * x.share[j] *
                 layer_compliance(grid.thickness, grid.poisson, std::hypot(y.waves[i], x.waves[j]));
        }
      sums.push_back(sum);
    }
  return sums;
}

/// C by offsets of `rows` × `cols` cells.
std::vector<double> offset_table(const LayerGrid& grid, int rows, int cols) {
  const Axis y(grid.rows, rows, grid.height, grid.thickness),
      x(grid.cols, cols, grid.width, grid.thickness);
  const std::vector<double> sums = spectrum(grid, y, x);
  const int ny = y.cells / 2 + 1, nx = x.cells / 2 + 1;
  std::vector<double> half(std::size_t(ny) * std::size_t(cols)),
      out(std::size_t(rows) * std::size_t(cols));
  for (int c = 0; c < cols; ++c)
    for (int n = 0; n < nx; ++n) {
      const double wave = x.cosine(n, c);
      for (int m = 0; m < ny; ++m)
        half[std::size_t(m * cols + c)] += wave * sums[std::size_t(m * nx + n)];
    }
  for (int r = 0; r < rows; ++r)
    for (int m = 0; m < ny; ++m) {
      const double wave = y.cosine(m, r) / (double(y.cells) * x.cells);
      for (int c = 0; c < cols; ++c)
        out[std::size_t(r * cols + c)] += wave * half[std::size_t(m * cols + c)];
    }
  return out;
}

/// Offsets of cell i from cell j and from its images in the two sides of an axis of n cells.
/// `doubled`: twice the margin in cells; none: no sides.
std::vector<int> offsets(int i, int j, int n, std::optional<int> doubled) {
  if (!doubled) return {std::abs(i - j)};
  return {std::abs(i - j), i + j + 1 + *doubled, 2 * n - 1 + *doubled - i - j};
}

}  // namespace

double layer_compliance(double thickness, double poisson, double wave_number) {
  const double G = 1 / (2 * (1 + poisson)), kappa = 3 - 4 * poisson;
  if (wave_number == 0) return thickness * (1 - 2 * poisson) / (2 * G * (1 - poisson));
  // Numerator and denominator times e^{-2ξ}, which does not overflow.
  const double xi = wave_number * thickness, e2 = std::exp(-2 * xi), e4 = e2 * e2;
  const double numerator = kappa * (1 - e4) - 4 * xi * e2;
  const double denominator = kappa * (1 + e4) + (4 * xi * xi + 1 + kappa * kappa) * e2;
  return (1 - poisson) / (G * wave_number) * numerator / denominator;
}

/// Weights of the two cells around a point along one axis of n cells: their number and the share of
/// the second.
static std::pair<int, double> between(int point, int side, int n) {
  const double at = std::clamp((point + 0.5) / side - 0.5, 0.0, n - 1.0);
  const int first = std::min(static_cast<int>(at), std::max(0, n - 2));
  return {first, at - first};
}

std::vector<CellWeights> cell_weights(const LayerGrid& grid, int side, int rows, int cols) {
  std::vector<CellWeights> out;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j) {
      const auto [r, fr] = between(i, side, grid.rows);
      const auto [c, fc] = between(j, side, grid.cols);
      const int down = grid.rows > 1 ? grid.cols : 0, right = grid.cols > 1 ? 1 : 0,
                first = r * grid.cols + c;
      out.push_back({{first, first + right, first + down, first + down + right},
                     {(1 - fr) * (1 - fc), (1 - fr) * fc, fr * (1 - fc), fr * fc}});
    }
  return out;
}

LayerCompliance compile_layer(const LayerGrid& grid) {
  const auto margin_cells = [&](double pitch) -> std::optional<int> {
    if (!grid.margin) return std::nullopt;
    return static_cast<int>(std::lround(2 * *grid.margin / pitch));
  };
  const std::optional<int> below = margin_cells(grid.height), beside = margin_cells(grid.width);
  const int rows = below ? 2 * grid.rows + *below : grid.rows,
            cols = beside ? 2 * grid.cols + *beside : grid.cols;
  const std::vector<double> table = offset_table(grid, rows, cols);
  LayerCompliance out{table[0],
                      std::vector<double>(std::size_t(grid.cells()) * std::size_t(grid.cells()))};
  const auto at = [&](int r, int c) { return table[std::size_t(r * cols + c)]; };
  for (int i = 0; i < grid.cells(); ++i)
    for (int j = 0; j <= i; ++j) {
      double sum = 0;
      for (const int r : offsets(i / grid.cols, j / grid.cols, grid.rows, below))
        for (const int c : offsets(i % grid.cols, j % grid.cols, grid.cols, beside))
          sum += at(r, c);
      out.table[std::size_t(i) * std::size_t(grid.cells()) + std::size_t(j)] =
          out.table[std::size_t(j) * std::size_t(grid.cells()) + std::size_t(i)] = sum;
    }
  return out;
}

}  // namespace tangere
