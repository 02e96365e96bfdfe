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
  /// Multiplicity of wave m among 0 … cells - 1, of which ± m are one, times its cosine or sine.
  [[nodiscard]] double wave(int m, int offset, bool odd) const {
    const double both = m == 0 || 2 * m == cells ? 1 : 2;
    // The product is reduced, so that the wave is exact at whole turns.
    const auto turn = static_cast<double>(std::int64_t{m} * offset % cells) / cells;
    const double phase = 2 * std::numbers::pi * turn;
    return both * (odd ? std::sin(phase) : std::cos(phase));
  }
};

/// Ĉ_ab at a wave vector, without the factor i of coupled components.
double component(const WaveCompliance& c, int a, int b, double k0, double k1) {
  if (a == 2 && b == 2) return c.normal;
  const double size = std::hypot(k0, k1);
  if (size == 0) return a == b ? c.along : 0;
  const double e[2] = {k0 / size, k1 / size};
  if (b == 2) return e[a] * c.coupling;
  if (a == 2) return -e[b] * c.coupling;
  return e[a] * e[b] * (c.along - c.across) + (a == b ? c.across : 0);
}

/// Σ over aliases of Ĉ_ab S² for each pair of wave numbers, (axis 0, axis 1).
std::vector<double> spectrum(const LayerGrid& grid, int a, int b, const Axis& y, const Axis& x) {
  constexpr int kEach = 2 * kAliases + 1;
  std::vector<double> sums;
  for (int m = 0; m <= y.cells / 2; ++m)
    for (int n = 0; n <= x.cells / 2; ++n) {
      double sum = 0;
      for (std::size_t s = 0; s < kEach; ++s)
        for (std::size_t t = 0; t < kEach; ++t) {
          const std::size_t i = std::size_t(m) * kEach + s, j = std::size_t(n) * kEach + t;
          const WaveCompliance at =
              layer_compliance(grid.thickness, grid.poisson, std::hypot(y.waves[i], x.waves[j]));
          sum += y.share[i] * x.share[j] * component(at, a, b, y.waves[i], x.waves[j]);
        }
      sums.push_back(sum);
    }
  return sums;
}

}  // namespace

WaveCompliance layer_compliance(double thickness, double poisson, double wave_number) {
  const double G = 1 / (2 * (1 + poisson)), kappa = 3 - 4 * poisson;
  if (wave_number == 0)
    return {thickness * (1 - 2 * poisson) / (2 * G * (1 - poisson)), thickness / G, thickness / G,
            0};
  // Numerators and D times e^{-2ξ}, which does not overflow.
  const double xi = wave_number * thickness, e2 = std::exp(-2 * xi), e4 = e2 * e2;
  const double D = kappa * (1 + e4) + (4 * xi * xi + 1 + kappa * kappa) * e2;
  const double sides = kappa * (1 - e4), bend = 4 * xi * e2, scale = 1 / (G * wave_number);
  const double c = 2 * xi * xi * e2 - kappa * (1 - 2 * poisson) * (0.5 * (1 + e4) - e2);
  return {(1 - poisson) * scale * (sides - bend) / D, (1 - poisson) * scale * (sides + bend) / D,
          scale * std::tanh(xi), scale * c / D};
}

// An axis along which C_ab is odd has sines. Two odd axes give i² = -1, and so do one odd axis and
// the factor i of a coupled component.
std::vector<double> offset_table(const LayerGrid& grid, int a, int b, int rows, int cols) {
  const bool odd0 = (a == 0) != (b == 0), odd1 = (a == 1) != (b == 1);
  const double sign = odd0 || odd1 ? -1 : 1;
  const Axis y(grid.rows, rows, grid.height, grid.thickness),
      x(grid.cols, cols, grid.width, grid.thickness);
  const std::vector<double> sums = spectrum(grid, a, b, y, x);
  const int ny = y.cells / 2 + 1, nx = x.cells / 2 + 1;
  std::vector<double> half(std::size_t(ny) * std::size_t(cols)),
      out(std::size_t(rows) * std::size_t(cols));
  for (int c = 0; c < cols; ++c)
    for (int n = 0; n < nx; ++n) {
      const double wave = x.wave(n, c, odd1);
      for (int m = 0; m < ny; ++m)
        half[std::size_t(m * cols + c)] += wave * sums[std::size_t(m * nx + n)];
    }
  for (int r = 0; r < rows; ++r)
    for (int m = 0; m < ny; ++m) {
      const double wave = sign * y.wave(m, r, odd0) / (double(y.cells) * x.cells);
      for (int c = 0; c < cols; ++c)
        out[std::size_t(r * cols + c)] += wave * half[std::size_t(m * cols + c)];
    }
  return out;
}

CellImages cell_images(int i, int j, int n, std::optional<int> doubled) {
  if (!doubled) return {{{{i - j, false}}}, 1};
  const int both = i + j + 1;
  return {{{{i - j, false}, {both + *doubled, true}, {both - 2 * n - *doubled, true}}}, 3};
}

std::array<std::optional<int>, 2> doubled_margins(const LayerGrid& grid) {
  if (!grid.margin) return {};
  const auto cells = [&](double pitch) {
    return static_cast<int>(std::lround(2 * *grid.margin / pitch));
  };
  return {cells(grid.height), cells(grid.width)};
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
  const auto [below, beside] = doubled_margins(grid);
  const int rows = below ? 2 * grid.rows + *below : grid.rows,
            cols = beside ? 2 * grid.cols + *beside : grid.cols;
  const std::vector<double> table = offset_table(grid, 2, 2, rows, cols);
  LayerCompliance out{table[0],
                      std::vector<double>(std::size_t(grid.cells()) * std::size_t(grid.cells()))};
  for (int i = 0; i < grid.cells(); ++i)
    for (int j = 0; j <= i; ++j) {
      double sum = 0;
      for (const CellImage& r : cell_images(i / grid.cols, j / grid.cols, grid.rows, below))
        for (const CellImage& c : cell_images(i % grid.cols, j % grid.cols, grid.cols, beside)) {
          const double at = table[std::size_t(std::abs(r.offset) * cols + std::abs(c.offset))];
          sum += r.mirrored == c.mirrored ? at : -at;
        }
      out.table[std::size_t(i) * std::size_t(grid.cells()) + std::size_t(j)] =
          out.table[std::size_t(j) * std::size_t(grid.cells()) + std::size_t(i)] = sum;
    }
  return out;
}

}  // namespace tangere
