// SPDX-License-Identifier: Apache-2.0
// Even and odd columns are stored apart, so that half a sweep over a row is one loop without steps.
#include "engine/picture/membrane.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tangere {
namespace {

/// A sweep carries a change about as far as over-relaxation lets it: ten for each point of ℓ.
int sweeps_for(double reach) {
  constexpr int kFewest = 40, kMost = 400;
  return std::clamp(static_cast<int>(std::ceil(10 * reach)), kFewest, kMost);
}

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

/// Calls update(h, bound, open, Σ l² h_neighbour/s), which returns the new h, for all points: first
/// those whose row and column have an even sum.
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
      const T* const left = odd != 0 ? other : other - 1;
      const T* const above = own - stride_;
      const T* const below = own + stride_;
      const int count = (cols_ + 1 - odd) / 2;
#pragma GCC ivdep
      for (int k = 0; k < count; ++k)
        own[k] = update(own[k], bound[k], open[k],
                        x_ * (left[k] + left[k + 1]) + y_ * (above[k] + below[k]));
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
  const T omega = omega_;
  for (int n = 0; n < sweeps_; ++n)
    sweep([omega](T h, T bound, T, T mean) { return std::max(bound, h + omega * (mean - h)); });
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
  const T omega = omega_;
  if (scale < T(1))
    for (int n = 0; n < 3 * sweeps_; ++n)
      sweep([omega](T l, T source, T open, T mean) {
        return open * (l + omega * (source + mean - l));
      });
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
