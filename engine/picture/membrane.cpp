// SPDX-License-Identifier: Apache-2.0
// Even and odd columns are stored apart, so that half a sweep over a row is one loop without steps.
#include "engine/picture/membrane.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/picture/clones.hpp"

namespace tangere {
namespace {

/// A sweep carries a change about as far as over-relaxation lets it: ten for each point of ℓ.
int sweeps_for(double reach) {
  constexpr int kFewest = 40, kMost = 400;
  return std::clamp(static_cast<int>(std::ceil(10 * reach)), kFewest, kMost);
}

/// Sweeps after which errors of a linear solve, which fall as n (ω - 1)^n, are those of rounding.
template <class T>
int spread_sweeps(double omega) {
  if (!(omega > 1)) return 1;
  const double least = std::log(std::numeric_limits<T>::epsilon()), rate = std::log(omega - 1);
  int n = 1;
  while (std::log(n) + n * rate > least) ++n;
  return n;
}

/// Points of one colour of a row, and what is beside them.
template <class T>
struct HalfRow {
  T* own;
  const T *bound, *open, *left, *above, *below;
  int count;
  T x, y, omega;
};

/// An obstacle holds the membrane from below.
template <class T>
[[gnu::always_inline]] inline void settle_points(const HalfRow<T>& r) {
  T* const own = r.own;
  const T *const bound = r.bound, *const left = r.left, *const above = r.above,
                 *const below = r.below;
  const T x = r.x, y = r.y, omega = r.omega;
#pragma GCC ivdep
  for (int k = 0; k < r.count; ++k) {
    const T mean = x * (left[k] + left[k + 1]) + y * (above[k] + below[k]);
    own[k] = std::max(bound[k], own[k] + omega * (mean - own[k]));
  }
}

/// Sources in `bound`; what is not open stays 0.
template <class T>
[[gnu::always_inline]] inline void spread_points(const HalfRow<T>& r) {
  T* const own = r.own;
  const T *const source = r.bound, *const open = r.open, *const left = r.left,
                 *const above = r.above, *const below = r.below;
  const T x = r.x, y = r.y, omega = r.omega;
#pragma GCC ivdep
  for (int k = 0; k < r.count; ++k) {
    const T mean = x * (left[k] + left[k + 1]) + y * (above[k] + below[k]);
    own[k] = open[k] * (own[k] + omega * (source[k] + mean - own[k]));
  }
}

TANGERE_CLONES void settle_row(const HalfRow<float>& row) { settle_points(row); }
TANGERE_CLONES void settle_row(const HalfRow<double>& row) { settle_points(row); }
TANGERE_CLONES void spread_row(const HalfRow<float>& row) { spread_points(row); }
TANGERE_CLONES void spread_row(const HalfRow<double>& row) { spread_points(row); }

}  // namespace

template <class T>
Membrane<T>::Membrane(int rows, int cols, double reach_x, double reach_y)
    : rows_(rows),
      cols_(cols),
      sweeps_(sweeps_for(std::max(reach_x, reach_y))),
      stride_(static_cast<std::size_t>((cols + 1) / 2) + 2),
      half_(stride_ * static_cast<std::size_t>(rows + 2)),
      value_(2 * half_, T(0)),
      bound_(2 * half_, T(0)),
      open_(2 * half_, T(0)) {
  const double x = reach_x * reach_x, y = reach_y * reach_y, s = 1 + 2 * (x + y), r = 1 - 1 / s;
  x_ = static_cast<T>(x / s), y_ = static_cast<T>(y / s);
  x_square_ = static_cast<T>(x), y_square_ = static_cast<T>(y);
  omega_ = static_cast<T>(2 / (1 + std::sqrt(1 - r * r)));
}

template <class T>
std::size_t Membrane<T>::at(int row, int col) const {
  return static_cast<std::size_t>(col % 2) * half_ + static_cast<std::size_t>(row + 1) * stride_ +
         static_cast<std::size_t>(col / 2) + 1;
}

template <class T>
void Membrane<T>::load(std::span<const T> grid, std::vector<T>& split) const {
  for (int i = 0; i < rows_; ++i)
    for (int j = 0; j < cols_; ++j) split[at(i, j)] = grid[static_cast<std::size_t>(i * cols_ + j)];
}

/// Calls update(row) for all points: first those whose row and column have an even sum.
template <class T>
template <class Update>
void Membrane<T>::sweep(const Update& update) {
  for (int colour = 0; colour < 2; ++colour)
    for (int i = 0; i < rows_; ++i) {
      const int odd = (i + colour) % 2;  // columns of this colour in the row
      const std::size_t row = static_cast<std::size_t>(i + 1) * stride_ + 1;
      T* const own = value_.data() + static_cast<std::size_t>(odd) * half_ + row;
      const T* const bound = bound_.data() + static_cast<std::size_t>(odd) * half_ + row;
      const T* const open = open_.data() + static_cast<std::size_t>(odd) * half_ + row;
      const T* const other = value_.data() + static_cast<std::size_t>(1 - odd) * half_ + row;
      update(HalfRow<T>{own, bound, open, odd != 0 ? other : other - 1, own - stride_,
                        own + stride_, (cols_ + 1 - odd) / 2, x_, y_, omega_});
    }
}

template <class T>
void Membrane<T>::settle(std::span<const T> depth, std::span<T> height) {
  if (x_square_ == T(0) && y_square_ == T(0)) {
    std::copy(depth.begin(), depth.end(), height.begin());
    return;
  }
  load(depth, bound_);
  value_ = bound_;
  for (int n = 0; n < sweeps_; ++n) sweep([](const HalfRow<T>& row) { settle_row(row); });
  for (int i = 0; i < rows_; ++i)
    for (int j = 0; j < cols_; ++j)
      height[static_cast<std::size_t>(i * cols_ + j)] = value_[at(i, j)];
}

template <class T>
void Membrane<T>::pull_back(std::span<const T> depth, std::span<const T> height,
                            std::span<const T> height_bar, std::span<T> depth_bar) {
  const auto touches = [&](std::size_t k) { return depth[k] > T(0) && height[k] == depth[k]; };
  const T scale = T(1) / (T(1) + T(2) * (x_square_ + y_square_));
  for (int i = 0; i < rows_; ++i)
    for (int j = 0; j < cols_; ++j) {
      const auto k = static_cast<std::size_t>(i * cols_ + j);
      open_[at(i, j)] = touches(k) ? T(0) : T(1);
      bound_[at(i, j)] = scale * height_bar[k];
    }
  std::fill(value_.begin(), value_.end(), T(0));
  if (scale < T(1))
    for (int n = spread_sweeps<T>(omega_); n > 0; --n)
      sweep([](const HalfRow<T>& row) { spread_row(row); });
  for (int i = 0; i < rows_; ++i)
    for (int j = 0; j < cols_; ++j) {
      const auto k = static_cast<std::size_t>(i * cols_ + j);
      depth_bar[k] = touches(k) ? height_bar[k] + pulled(i, j) : T(0);
    }
  std::fill(bound_.begin(), bound_.end(), T(0));
}

/// Returns Σ l² λ_neighbour of a point.
template <class T>
T Membrane<T>::pulled(int row, int col) const {
  const std::size_t own = at(row, col), other = at(row, col + 1);  // its right neighbour
  const std::size_t before = col % 2 != 0 ? own - half_ : other - 1;
  return x_square_ * (value_[before] + value_[other]) +
         y_square_ * (value_[own - stride_] + value_[own + stride_]);
}

template class Membrane<float>;
template class Membrane<double>;

}  // namespace tangere
