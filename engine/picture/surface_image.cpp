// SPDX-License-Identifier: Apache-2.0
// Grid rows are read at all columns first, so a row of pixels is a sum of four of them.
#include "engine/picture/surface_image.hpp"

#include <algorithm>
#include <cmath>

#include "engine/picture/clones.hpp"

namespace tangere {
namespace {

/// A Gaussian of variance b² - pitch²/3 from its middle outwards, of sum 1 over both sides.
template <class T>
std::vector<T> half_kernel(double blur, double pitch) {
  constexpr double kWidths = 4;
  const double variance = blur * blur / (pitch * pitch) - 1.0 / 3;
  if (!(variance > 0)) return {T(1)};
  std::vector<double> weights;
  double sum = 0;
  for (int k = 0; k <= std::ceil(kWidths * std::sqrt(variance)); ++k) {
    weights.push_back(std::exp(-k * k / (2 * variance)));
    sum += (k == 0 ? 1 : 2) * weights.back();
  }
  std::vector<T> kernel;
  for (const double w : weights) kernel.push_back(static_cast<T>(w / sum));
  return kernel;
}

/// Blurs along one axis: `count` numbers `step` apart.
template <class T>
void blur_line(const std::vector<T>& kernel, Outside outside, const T* from, T* to, int count,
               std::ptrdiff_t step) {
  const int reach = static_cast<int>(kernel.size()) - 1;
  const bool nearest = outside == Outside::nearest;
  const T first = nearest ? from[0] : T(0), last = nearest ? from[(count - 1) * step] : T(0);
  for (int i = 0; i < count; ++i) {
    T sum = kernel[0] * from[i * step];
    for (int k = 1; k <= reach; ++k) {
      const T before = i >= k ? from[(i - k) * step] : first,
              behind = i + k < count ? from[(i + k) * step] : last;
      sum += kernel[static_cast<std::size_t>(k)] * (before + behind);
    }
    to[i * step] = sum;
  }
}

/// The transpose. With zeros outside it is blur_line() itself.
template <class T>
void pull_back_line(const std::vector<T>& kernel, Outside outside, const T* from, T* to, int count,
                    std::ptrdiff_t step) {
  if (outside == Outside::zero) return blur_line(kernel, outside, from, to, count, step);
  const int reach = static_cast<int>(kernel.size()) - 1;
  for (int i = 0; i < count; ++i) to[i * step] = kernel[0] * from[i * step];
  for (int i = 0; i < count; ++i)
    for (int k = 1; k <= reach; ++k) {
      const T share = kernel[static_cast<std::size_t>(k)] * from[i * step];
      to[std::max(i - k, 0) * step] += share;
      to[std::min(i + k, count - 1) * step] += share;
    }
}

template <class T>
[[gnu::always_inline]] inline void sum_rows(const std::array<const T*, 4>& from,
                                            const std::array<T, 4>& weight, T* to,
                                            std::size_t count) {
  const T *const a = from[0], *const b = from[1], *const c = from[2], *const d = from[3];
  const T s = weight[0], t = weight[1], u = weight[2], v = weight[3];
#pragma GCC ivdep
  for (std::size_t i = 0; i < count; ++i) to[i] = (s * a[i] + t * b[i]) + (u * c[i] + v * d[i]);
}
/// to = Σ weight_k from_k over four rows.
TANGERE_CLONES void sum_of_four(const std::array<const float*, 4>& from,
                                const std::array<float, 4>& weight, float* to, std::size_t count) {
  sum_rows(from, weight, to, count);
}
TANGERE_CLONES void sum_of_four(const std::array<const double*, 4>& from,
                                const std::array<double, 4>& weight, double* to,
                                std::size_t count) {
  sum_rows(from, weight, to, count);
}

/// to += weight from.
TANGERE_CLONES void add_scaled(float weight, const float* from, float* to, std::size_t count) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < count; ++i) to[i] += weight * from[i];
}
TANGERE_CLONES void add_scaled(double weight, const double* from, double* to, std::size_t count) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < count; ++i) to[i] += weight * from[i];
}

}  // namespace

template <class T>
SurfaceImage<T>::SurfaceImage(const PictureGrid& grid, double blur, Outside outside)
    : grid_(grid),
      outside_(outside),
      kernel_x_(half_kernel<T>(blur, grid.pitch_x)),
      kernel_y_(half_kernel<T>(blur, grid.pitch_y)),
      columns_(pixel_weights<T>(grid.width, grid.size_x, grid.cols, grid.pitch_x, outside)),
      lines_(pixel_weights<T>(grid.height, grid.size_y, grid.rows, grid.pitch_y, outside)),
      blurred_(static_cast<std::size_t>(grid.points())),
      passed_(blurred_.size()),
      across_(static_cast<std::size_t>(grid.rows) * static_cast<std::size_t>(grid.width)),
      slope_(across_.size()),
      flat_(static_cast<std::size_t>(grid.rows)) {}

template <class T>
std::span<T> SurfaceImage<T>::line(std::vector<T>& rows, int row) const {
  const auto width = static_cast<std::size_t>(grid_.width);
  return std::span(rows).subspan(static_cast<std::size_t>(row) * width, width);
}
template <class T>
std::span<const T> SurfaceImage<T>::line(const std::vector<T>& rows, int row) const {
  const auto width = static_cast<std::size_t>(grid_.width);
  return std::span(rows).subspan(static_cast<std::size_t>(row) * width, width);
}

template <class T>
void SurfaceImage<T>::blur(std::vector<T>& grid) {
  if (kernel_x_.size() > 1) {
    for (int i = 0; i < grid_.rows; ++i)
      blur_line(kernel_x_, outside_, grid.data() + i * grid_.cols, passed_.data() + i * grid_.cols,
                grid_.cols, 1);
    std::swap(grid, passed_);
  }
  if (kernel_y_.size() > 1) {
    for (int j = 0; j < grid_.cols; ++j)
      blur_line(kernel_y_, outside_, grid.data() + j, passed_.data() + j, grid_.rows, grid_.cols);
    std::swap(grid, passed_);
  }
}

/// Axes do not matter to each other, so those of the transpose come in the same order.
template <class T>
void SurfaceImage<T>::pull_back_blur(std::vector<T>& grid) {
  if (kernel_x_.size() > 1) {
    for (int i = 0; i < grid_.rows; ++i)
      pull_back_line(kernel_x_, outside_, grid.data() + i * grid_.cols,
                     passed_.data() + i * grid_.cols, grid_.cols, 1);
    std::swap(grid, passed_);
  }
  if (kernel_y_.size() > 1) {
    for (int j = 0; j < grid_.cols; ++j)
      pull_back_line(kernel_y_, outside_, grid.data() + j, passed_.data() + j, grid_.rows,
                     grid_.cols);
    std::swap(grid, passed_);
  }
}

template <class T>
void SurfaceImage<T>::set(std::span<const T> surface) {
  std::copy(surface.begin(), surface.end(), blurred_.begin());
  blur(blurred_);
  for (int i = 0; i < grid_.rows; ++i) {
    const T* const from = blurred_.data() + i * grid_.cols;
    const bool flat = std::all_of(from, from + grid_.cols, [](T h) { return h == T(0); });
    flat_[static_cast<std::size_t>(i)] = flat;
    const std::span<T> value = line(across_, i), slope = line(slope_, i);
    if (flat) {
      std::fill(value.begin(), value.end(), T(0));
      std::fill(slope.begin(), slope.end(), T(0));
      continue;
    }
    for (std::size_t x = 0; x < value.size(); ++x) {
      const SplineWeights<T>& w = columns_[x];
      T sum = 0, change = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        const T h = from[w.point[k]];
        sum += w.value[k] * h, change += w.slope[k] * h;
      }
      value[x] = sum, slope[x] = change;
    }
  }
}

template <class T>
bool SurfaceImage<T>::is_flat(int row) const {
  const SplineWeights<T>& w = lines_[static_cast<std::size_t>(row)];
  return std::all_of(w.point.begin(), w.point.end(),
                     [&](int point) { return flat_[static_cast<std::size_t>(point)]; });
}

template <class T>
void SurfaceImage<T>::read_heights(int row, std::span<T> height) const {
  const SplineWeights<T>& w = lines_[static_cast<std::size_t>(row)];
  std::array<const T*, 4> from;
  for (std::size_t k = 0; k < 4; ++k) from[k] = line(across_, w.point[k]).data();
  sum_of_four(from, w.value, height.data(), height.size());
}

template <class T>
void SurfaceImage<T>::read_slopes(int row, std::span<T> p, std::span<T> q) const {
  const SplineWeights<T>& w = lines_[static_cast<std::size_t>(row)];
  std::array<const T*, 4> value, slope;
  for (std::size_t k = 0; k < 4; ++k)
    value[k] = line(across_, w.point[k]).data(), slope[k] = line(slope_, w.point[k]).data();
  sum_of_four(slope, w.value, p.data(), p.size());
  sum_of_four(value, w.slope, q.data(), q.size());
}

template <class T>
void SurfaceImage<T>::begin_pull_back() {
  across_bar_.assign(across_.size(), T(0));
  slope_bar_.assign(slope_.size(), T(0));
}

template <class T>
void SurfaceImage<T>::add_heights(int row, std::span<const T> height_bar) {
  const SplineWeights<T>& w = lines_[static_cast<std::size_t>(row)];
  for (std::size_t k = 0; k < 4; ++k)
    add_scaled(w.value[k], height_bar.data(), line(across_bar_, w.point[k]).data(),
               height_bar.size());
}

template <class T>
void SurfaceImage<T>::add_slopes(int row, std::span<const T> p_bar, std::span<const T> q_bar) {
  const SplineWeights<T>& w = lines_[static_cast<std::size_t>(row)];
  for (std::size_t k = 0; k < 4; ++k) {
    add_scaled(w.value[k], p_bar.data(), line(slope_bar_, w.point[k]).data(), p_bar.size());
    add_scaled(w.slope[k], q_bar.data(), line(across_bar_, w.point[k]).data(), q_bar.size());
  }
}

template <class T>
void SurfaceImage<T>::take(std::span<T> surface_bar) {
  std::fill(blurred_.begin(), blurred_.end(), T(0));
  for (int i = 0; i < grid_.rows; ++i) {
    T* const to = blurred_.data() + i * grid_.cols;
    const std::span<const T> value = line(across_bar_, i), slope = line(slope_bar_, i);
    for (std::size_t x = 0; x < value.size(); ++x)
      for (std::size_t k = 0; k < 4; ++k)
        to[columns_[x].point[k]] +=
            columns_[x].value[k] * value[x] + columns_[x].slope[k] * slope[x];
  }
  pull_back_blur(blurred_);
  std::copy(blurred_.begin(), blurred_.end(), surface_bar.begin());
}

template class SurfaceImage<float>;
template class SurfaceImage<double>;

}  // namespace tangere
