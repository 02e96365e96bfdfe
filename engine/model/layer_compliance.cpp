// SPDX-License-Identifier: Apache-2.0
// The sum over wave vectors runs over one axis after the other.
#include "engine/model/layer_compliance.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <utility>

#include "kernels/numbers/dual.hpp"

namespace tangere {

using D = kernels::Dual<double>;

namespace {

constexpr int kAliases = 3;         // on each side of a wave number
constexpr int kPads = 3;            // of the periodic box, at least
constexpr double kThicknesses = 6;  // of it
constexpr double kLessCells =
    1e-3;  // a thickness of whole cells may be rounded, or change a little

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
                      0.5 * (std::max(kPads * n, offsets + n) + kThicknesses * thickness / h) -
                      kLessCells))),
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

double exp_of(double x) { return std::exp(x); }
D exp_of(const D& x) {
  const double e = std::exp(x.value);
  return {e, e * x.epsilon};
}
double tanh_of(double x) { return std::tanh(x); }
D tanh_of(const D& x) {
  const double t = std::tanh(x.value);
  return {t, (1 - t * t) * x.epsilon};
}

/// N, L, T, c of a thickness and a Poisson's ratio, which may be dual numbers.
template <class N>
struct Compliances {
  N normal, along, across, coupling;
};
template <class N>
Compliances<N> compliances(const N& t, const N& nu, double wave_number) {
  const N one(1.0), G = one / (N(2.0) * (one + nu)), kappa = N(3.0) - N(4.0) * nu;
  if (wave_number == 0)
    return {t * (one - N(2.0) * nu) / (N(2.0) * G * (one - nu)), t / G, t / G, N(0.0)};
  // Numerators and D times e^{-2ξ}, which does not overflow.
  const N xi = N(wave_number) * t, e2 = exp_of(N(-2.0) * xi), e4 = e2 * e2;
  const N d = kappa * (one + e4) + (N(4.0) * xi * xi + one + kappa * kappa) * e2;
  const N sides = kappa * (one - e4), bend = N(4.0) * xi * e2, scale = one / (G * N(wave_number));
  const N c = N(2.0) * xi * xi * e2 - kappa * (one - N(2.0) * nu) * (N(0.5) * (one + e4) - e2);
  return {(one - nu) * scale * (sides - bend) / d, (one - nu) * scale * (sides + bend) / d,
          scale * tanh_of(xi), scale * c / d};
}

/// Ĉ_ab at a wave vector, without the factor i of coupled components.
template <class N>
N component(const Compliances<N>& c, int a, int b, double k0, double k1) {
  if (a == 2 && b == 2) return c.normal;
  const double size = std::hypot(k0, k1);
  if (size == 0) return a == b ? c.along : N(0.0);
  const double e[2] = {k0 / size, k1 / size};
  if (b == 2) return N(e[a]) * c.coupling;
  if (a == 2) return N(-e[b]) * c.coupling;
  return N(e[a] * e[b]) * (c.along - c.across) + (a == b ? c.across : N(0.0));
}

/// Σ over aliases of Ĉ_ab S² for each pair of wave numbers, (axis 0, axis 1).
template <class N>
std::vector<N> spectrum(const N& t, const N& nu, int a, int b, const Axis& y, const Axis& x) {
  constexpr int kEach = 2 * kAliases + 1;
  std::vector<N> sums;
  for (int m = 0; m <= y.cells / 2; ++m)
    for (int n = 0; n <= x.cells / 2; ++n) {
      N sum(0.0);
      for (std::size_t s = 0; s < kEach; ++s)
        for (std::size_t r = 0; r < kEach; ++r) {
          const std::size_t i = std::size_t(m) * kEach + s, j = std::size_t(n) * kEach + r;
          const Compliances<N> at = compliances(t, nu, std::hypot(y.waves[i], x.waves[j]));
          sum += N(y.share[i] * x.share[j]) * component(at, a, b, y.waves[i], x.waves[j]);
        }
      sums.push_back(sum);
    }
  return sums;
}

/// C_ab at the offsets of 0 … rows - 1 by 0 … cols - 1 cells, row-major. An axis along which C_ab
/// is odd has sines. Two odd axes give i² = -1, and so do one odd axis and the factor i of a
/// coupled component.
template <class N>
std::vector<N> offsets_of(const LayerGrid& grid, const N& t, const N& nu, int a, int b, int rows,
                          int cols) {
  const bool odd0 = (a == 0) != (b == 0), odd1 = (a == 1) != (b == 1);
  const double sign = odd0 || odd1 ? -1 : 1;
  const Axis y(grid.rows, rows, grid.height, grid.thickness),
      x(grid.cols, cols, grid.width, grid.thickness);
  const std::vector<N> sums = spectrum(t, nu, a, b, y, x);
  const int ny = y.cells / 2 + 1, nx = x.cells / 2 + 1;
  std::vector<N> half(std::size_t(ny) * std::size_t(cols), N(0.0)),
      out(std::size_t(rows) * std::size_t(cols), N(0.0));
  for (int c = 0; c < cols; ++c)
    for (int n = 0; n < nx; ++n) {
      const N wave(x.wave(n, c, odd1));
      for (int m = 0; m < ny; ++m)
        half[std::size_t(m * cols + c)] += wave * sums[std::size_t(m * nx + n)];
    }
  for (int r = 0; r < rows; ++r)
    for (int m = 0; m < ny; ++m) {
      const N wave(sign * y.wave(m, r, odd0) / (double(y.cells) * x.cells));
      for (int c = 0; c < cols; ++c)
        out[std::size_t(r * cols + c)] += wave * half[std::size_t(m * cols + c)];
    }
  return out;
}

/// Puts the numbers of offsets together for all pairs of cells.
LayerCompliance from_offsets(const LayerGrid& grid, const std::vector<double>& table, int cols) {
  const auto [below, beside] = doubled_margins(grid);
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

/// Offsets that the cells of a grid and their images have, along the rows and along the columns.
std::array<int, 2> offset_counts(const LayerGrid& grid) {
  const auto [below, beside] = doubled_margins(grid);
  return {below ? 2 * grid.rows + *below : grid.rows, beside ? 2 * grid.cols + *beside : grid.cols};
}

/// Derivative of compile_layer() along the tangents of the thickness and of Poisson's ratio.
LayerCompliance slope_along(const LayerGrid& grid, const D& thickness, const D& poisson) {
  const auto [rows, cols] = offset_counts(grid);
  std::vector<double> changes;
  for (const D& x : offsets_of(grid, thickness, poisson, 2, 2, rows, cols))
    changes.push_back(x.epsilon);
  return from_offsets(grid, changes, cols);
}

}  // namespace

WaveCompliance layer_compliance(double thickness, double poisson, double wave_number) {
  const Compliances<double> c = compliances(thickness, poisson, wave_number);
  return {c.normal, c.along, c.across, c.coupling};
}

std::vector<double> offset_table(const LayerGrid& grid, int a, int b, int rows, int cols) {
  return offsets_of(grid, grid.thickness, grid.poisson, a, b, rows, cols);
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
  const auto [rows, cols] = offset_counts(grid);
  return from_offsets(grid, offset_table(grid, 2, 2, rows, cols), cols);
}

LayerSlopes compile_layer_slopes(const LayerGrid& grid) {
  return {slope_along(grid, {grid.thickness, 1}, {grid.poisson, 0}),
          slope_along(grid, {grid.thickness, 0}, {grid.poisson, 1})};
}

}  // namespace tangere
