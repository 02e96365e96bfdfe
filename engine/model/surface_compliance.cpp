// SPDX-License-Identifier: Apache-2.0
// Sums run over the cells with tractions and add rows of a table, so that they depend on the
// tractions alone.
#include "engine/model/surface_compliance.hpp"

#include <cmath>
#include <cstdlib>

namespace tangere {
namespace {

/// Sign of a traction's component b in an image behind a side across an axis.
double image_sign(int axis, int b) { return b == axis ? 1 : -1; }

/// Sign of C_ab at an offset along an axis, from that at its size.
double offset_sign(int axis, int a, int b, int offset) {
  return (a == axis) != (b == axis) && offset < 0 ? -1 : 1;
}

/// Sum over the images across axis 1 of C_ab, (offsets along axis 0, col of q, col of u).
std::vector<double> folded_table(const LayerGrid& grid, int a, int b, int rows,
                                 std::optional<int> beside) {
  const int offsets = beside ? 2 * grid.cols + *beside : grid.cols;
  const std::vector<double> table = offset_table(grid, a, b, rows, offsets);
  std::vector<double> out;
  for (int r = 0; r < rows; ++r)
    for (int j = 0; j < grid.cols; ++j)
      for (int i = 0; i < grid.cols; ++i) {
        double sum = 0;
        for (const CellImage& c : cell_images(i, j, grid.cols, beside))
          sum += (c.mirrored ? image_sign(1, b) : 1) * offset_sign(1, a, b, c.offset) *
                 table[std::size_t(r * offsets + std::abs(c.offset))];
        out.push_back(sum);
      }
  return out;
}

}  // namespace

/// Offsets along axis 0.
static int offset_rows(const LayerGrid& grid) {
  const std::optional<int> below = doubled_margins(grid)[0];
  return below ? 2 * grid.rows + *below : grid.rows;
}

double SurfaceCompliance::bytes(const LayerGrid& grid) {
  return 9.0 * sizeof(double) * offset_rows(grid) * grid.cols * grid.cols;
}

SurfaceCompliance::SurfaceCompliance(const LayerGrid& grid)
    : rows_(grid.rows), cols_(grid.cols), below_(doubled_margins(grid)[0]) {
  const int rows = offset_rows(grid);
  for (int a = 0; a < 3; ++a)
    for (int b = 0; b < 3; ++b)
      tables_[std::size_t(a)][std::size_t(b)] =
          folded_table(grid, a, b, rows, doubled_margins(grid)[1]);
}

/// Calls f(a, b, cell with traction, its component b with the sign of the term, first cell of a row
/// of displacements, row of the table) for all terms of the sum.
template <class F>
void SurfaceCompliance::for_rows(std::span<const double> traction, const F& f) const {
  const auto cells = std::size_t(rows_) * std::size_t(cols_), width = std::size_t(cols_);
  for (std::size_t cell = 0; cell < cells; ++cell) {
    if (traction[cell] == 0 && traction[cells + cell] == 0 && traction[2 * cells + cell] == 0)
      continue;
    for (int i = 0; i < rows_; ++i)
      for (const CellImage& r : cell_images(i, int(cell) / cols_, rows_, below_))
        for (int a = 0; a < 3; ++a)
          for (int b = 0; b < 3; ++b) {
            const double sign =
                (r.mirrored ? image_sign(0, b) : 1) * offset_sign(0, a, b, r.offset);
            f(std::size_t(a), std::size_t(b), cell, sign, std::size_t(i) * width,
              &tables_[std::size_t(a)][std::size_t(b)]
                      [(std::size_t(std::abs(r.offset)) * width + cell % width) * width]);
          }
  }
}

void SurfaceCompliance::displace(std::span<const double> traction,
                                 std::span<double> displacement) const {
  const auto cells = std::size_t(rows_) * std::size_t(cols_);
  std::fill(displacement.begin(), displacement.end(), 0.0);
  for_rows(traction, [&](std::size_t a, std::size_t b, std::size_t cell, double sign,
                         std::size_t first, const double* row) {
    const double q = sign * traction[b * cells + cell];
    if (q == 0) return;
    double* const u = &displacement[a * cells + first];
    for (int i = 0; i < cols_; ++i) u[i] += q * row[i];
  });
}

void SurfaceCompliance::pull_back(std::span<const double> traction,
                                  std::span<const double> displacement_bar,
                                  std::span<double> traction_bar) const {
  const auto cells = std::size_t(rows_) * std::size_t(cols_);
  std::fill(traction_bar.begin(), traction_bar.end(), 0.0);
  for_rows(traction, [&](std::size_t a, std::size_t b, std::size_t cell, double sign,
                         std::size_t first, const double* row) {
    const double* const bar = &displacement_bar[a * cells + first];
    double sum = 0;
    for (int i = 0; i < cols_; ++i) sum += bar[i] * row[i];
    traction_bar[b * cells + cell] += sign * sum;
  });
}

}  // namespace tangere
