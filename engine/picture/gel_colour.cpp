// SPDX-License-Identifier: Apache-2.0
// Rows have one plane per channel, so that loops over pixels become vectors.
#include "engine/picture/gel_colour.hpp"

#include <algorithm>
#include <cmath>

#include "engine/picture/clones.hpp"

namespace tangere {
namespace {

/// Averages `from` numbers, `step` apart, over `to` equal intervals.
template <class T>
void average_line(const float* given, std::ptrdiff_t step, int from, T* out,
                  std::ptrdiff_t out_step, int to) {
  for (int k = 0; k < to; ++k) {
    const double low = double(k) * from / to, high = double(k + 1) * from / to;
    double sum = 0;
    for (int i = static_cast<int>(low); i < std::min<double>(from, std::ceil(high)); ++i)
      sum += (std::min<double>(high, i + 1) - std::max<double>(low, i)) * double(given[i * step]);
    out[k * out_step] = static_cast<T>(from == to ? double(given[k * step]) : sum / (high - low));
  }
}

template <class T>
struct RowLoop {
  const T *p, *q, *x, *background;
  T *planes, *up;  // up: N of the normals
  std::size_t width;
  const std::array<std::array<T, kShades>, kColours>*level, *tilt;
};

/// The root and the quotient of a normal take most of a pixel's time, so the channels share them.
template <class T>
[[gnu::always_inline]] inline void shade_pixels(const RowLoop<T>& row) {
  const T *const p = row.p, *const q = row.q, *const x = row.x;
  T* const up = row.up;
#pragma GCC ivdep
  for (std::size_t i = 0; i < row.width; ++i)
    up[i] = T(1) / std::sqrt(T(1) + (p[i] * p[i] + q[i] * q[i]));
  for (std::size_t c = 0; c < kColours; ++c) {
    const T* const background = row.background + c * row.width;
    T* const plane = row.planes + c * row.width;
    const auto a = (*row.level)[c], b = (*row.tilt)[c];
#pragma GCC ivdep
    for (std::size_t i = 0; i < row.width; ++i) {
      const T z = up[i], u = -p[i] * z, v = -q[i] * z, w = z - T(1);
      const T xx = u * u, xy = u * v, yy = v * v, xz = u * z, yz = v * z;
      const T level = ((a[0] * u + a[1] * v) + (a[2] * w + a[3] * xx)) +
                      ((a[4] * xy + a[5] * yy) + (a[6] * xz + a[7] * yz));
      const T tilt = ((b[0] * u + b[1] * v) + (b[2] * w + b[3] * xx)) +
                     ((b[4] * xy + b[5] * yy) + (b[6] * xz + b[7] * yz));
      plane[i] = background[i] + (level + x[i] * tilt);
    }
  }
}

template <class T>
struct RowPullback {
  const T *p, *q, *x, *up, *planes_bar;
  T *p_bar, *q_bar;
  std::size_t width;
  const std::array<std::array<T, kShades>, kColours>*level, *tilt;
};

template <class T>
[[gnu::always_inline]] inline void pull_back_pixels(const RowPullback<T>& row) {
  const T *const p = row.p, *const q = row.q, *const places = row.x, *const up = row.up;
  const T *const r = row.planes_bar, *const g = r + row.width, *const b = g + row.width;
  T *const p_bar = row.p_bar, *const q_bar = row.q_bar;
  const auto level = *row.level, tilt = *row.tilt;
#pragma GCC ivdep
  for (std::size_t i = 0; i < row.width; ++i) {
    const T z = up[i], x = -p[i] * z, y = -q[i] * z;
    const auto bar = [&](std::size_t j) {  // of φ_j
      return (r[i] * level[0][j] + g[i] * level[1][j] + b[i] * level[2][j]) +
             places[i] * (r[i] * tilt[0][j] + g[i] * tilt[1][j] + b[i] * tilt[2][j]);
    };
    const T gx = (bar(0) + 2 * x * bar(3)) + (y * bar(4) + z * bar(6)),
            gy = (bar(1) + x * bar(4)) + (2 * y * bar(5) + z * bar(7)),
            gz = bar(2) + (x * bar(6) + y * bar(7)), along = gx * x + gy * y + gz * z;
    p_bar[i] = -z * (gx - along * x);
    q_bar[i] = -z * (gy - along * y);
  }
}

TANGERE_CLONES void pull_back_row(const RowPullback<float>& row) { pull_back_pixels(row); }
TANGERE_CLONES void pull_back_row(const RowPullback<double>& row) { pull_back_pixels(row); }
TANGERE_CLONES void shade_row(const RowLoop<float>& row) { shade_pixels(row); }
TANGERE_CLONES void shade_row(const RowLoop<double>& row) { shade_pixels(row); }

}  // namespace

double picture_place(int pixel, int pixels, int smaller) {
  return (pixel + 0.5 - 0.5 * pixels) / smaller;
}

template <class T>
GelColour<T>::GelColour(const Gel& gel, int height, int width) : height_(height), width_(width) {
  for (std::size_t c = 0; c < kColours; ++c)
    for (std::size_t j = 0; j < kShades; ++j)
      for (std::size_t k = 0; k < kShadePlaces; ++k)
        lamps_[c][j][k] = static_cast<T>(gel.lamps[c][j][k]);
  for (int j = 0; j < width; ++j)
    x_.push_back(static_cast<T>(picture_place(j, width, std::min(height, width))));
  for (int i = 0; i < height; ++i)
    y_.push_back(static_cast<T>(picture_place(i, height, std::min(height, width))));
  const GelBackground& given = gel.background;
  const auto numbers = static_cast<std::ptrdiff_t>(kColours);
  std::vector<float> lines(static_cast<std::size_t>(given.rows) * width * kColours);
  for (int i = 0; i < given.rows; ++i)
    for (int c = 0; c < numbers; ++c)
      average_line(given.levels.data() + std::ptrdiff_t(i) * given.cols * numbers + c, numbers,
                   given.cols, lines.data() + (std::ptrdiff_t(i) * numbers + c) * width, 1, width);
  background_.resize(static_cast<std::size_t>(height) * width * kColours);
  const std::ptrdiff_t line = numbers * width;
  for (std::ptrdiff_t k = 0; k < line; ++k)
    average_line(lines.data() + k, line, given.rows, background_.data() + k, line, height);
}

template <class T>
std::span<const T> GelColour<T>::background(int row) const {
  const std::size_t line = kColours * static_cast<std::size_t>(width_);
  return std::span(background_).subspan(static_cast<std::size_t>(row) * line, line);
}

template <class T>
typename GelColour<T>::Row GelColour<T>::row_of(int row) const {
  Row of;
  const T y = y_[static_cast<std::size_t>(row)];
  for (std::size_t c = 0; c < kColours; ++c)
    for (std::size_t j = 0; j < kShades; ++j) {
      of.level[c][j] = lamps_[c][j][0] + y * lamps_[c][j][2];
      of.tilt[c][j] = lamps_[c][j][1];
    }
  return of;
}

template <class T>
void GelColour<T>::shade(int row, std::span<const T> p, std::span<const T> q, std::span<T> planes,
                         std::span<T> up) const {
  const Row of = row_of(row);
  shade_row({p.data(), q.data(), x_.data(), background(row).data(), planes.data(), up.data(),
             p.size(), &of.level, &of.tilt});
}

template <class T>
void GelColour<T>::pull_back(int row, std::span<const T> p, std::span<const T> q,
                             std::span<const T> up, std::span<const T> planes_bar,
                             std::span<T> p_bar, std::span<T> q_bar) const {
  const Row of = row_of(row);
  pull_back_row({p.data(), q.data(), x_.data(), up.data(), planes_bar.data(), p_bar.data(),
                 q_bar.data(), p.size(), &of.level, &of.tilt});
}

template class GelColour<float>;
template class GelColour<double>;

}  // namespace tangere
