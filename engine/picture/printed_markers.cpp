// SPDX-License-Identifier: Apache-2.0
// Pixels need not be square: distances are measured along both axes in units of the radius there.
#include "engine/picture/printed_markers.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {
namespace {

constexpr double kDarkness = 0.7;

/// Places of a row of discs on an axis of `pixels` pixels [pixels].
double disc_place(int k, int count, double pixels, double pitch) {
  if (pitch == 0) return (k + 0.5) / count * pixels;
  return 0.5 * pixels + (k - 0.5 * (count - 1)) * pitch;
}

}  // namespace

template <class T>
PrintedMarkers<T>::PrintedMarkers(const PictureGrid& grid, int cols, int rows, double pitch,
                                  double radius)
    : grid_(grid) {
  const double per_x = grid.width / grid.size_x, per_y = grid.height / grid.size_y;  // [pixels/m]
  const double apart = pitch > 0 ? pitch : std::min(grid.size_x / cols, grid.size_y / rows);
  const double r = radius > 0 ? radius : 0.1 * apart;
  radius_x_ = r * per_x, radius_y_ = r * per_y;
  for (int i = 0; i < rows; ++i)
    for (int j = 0; j < cols; ++j) {
      const Disc disc{disc_place(j, cols, grid.width, pitch * per_x),
                      disc_place(i, rows, grid.height, pitch * per_y)};
      rest_.push_back(disc);
      const double x = (disc.x - 0.5 * grid.width) / per_x,
                   y = (disc.y - 0.5 * grid.height) / per_y;
      columns_.push_back(spline_weights<double>(x / grid.pitch_x + 0.5 * (grid.cols - 1), grid.cols,
                                                Outside::nearest));
      lines_.push_back(spline_weights<double>(y / grid.pitch_y + 0.5 * (grid.rows - 1), grid.rows,
                                              Outside::nearest));
    }
  moved_ = rest_;
}

template <class T>
void PrintedMarkers<T>::move(std::span<const T> displacement) {
  for (std::size_t d = 0; d < rest_.size(); ++d) {
    double x = 0, y = 0;
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < 4; ++j) {
        const double w = lines_[d].value[i] * columns_[d].value[j];
        const auto at =
            static_cast<std::size_t>(lines_[d].point[i] * grid_.cols + columns_[d].point[j]);
        x += w * static_cast<double>(displacement[2 * at]);
        y += w * static_cast<double>(displacement[2 * at + 1]);
      }
    moved_[d] = {rest_[d].x + x * grid_.width / grid_.size_x,
                 rest_[d].y + y * grid_.height / grid_.size_y};
  }
}

template <class T>
template <class F>
void PrintedMarkers<T>::for_pixels(const Disc& disc, int row, const F& f) const {
  const double y = (row + 0.5 - disc.y) * (radius_x_ / radius_y_);
  if (!(std::abs(y) < radius_x_ + 0.5)) return;
  const double first = std::clamp(disc.x - radius_x_ - 1, 0.0, double(grid_.width)),
               end = std::clamp(disc.x + radius_x_ + 2, 0.0, double(grid_.width));
  for (auto i = static_cast<std::size_t>(first); i < static_cast<std::size_t>(end); ++i)
    f(i, static_cast<double>(i) + 0.5 - disc.x, y);
}

template <class T>
void PrintedMarkers<T>::darken(int row, std::span<T> planes) const {
  const auto width = static_cast<std::size_t>(grid_.width);
  for (const Disc& disc : moved_)
    for_pixels(disc, row, [&](std::size_t i, double x, double y) {
      const double t = std::clamp(radius_x_ + 0.5 - std::sqrt(x * x + y * y), 0.0, 1.0);
      const T factor = static_cast<T>(1 - kDarkness * (t * t * (3 - 2 * t)));
      for (std::size_t c = 0; c < 3; ++c) planes[c * width + i] *= factor;
    });
}

template <class T>
void PrintedMarkers<T>::begin_pull_back() {
  bar_.assign(moved_.size(), Disc{});
}

// With the factor f of a disc: ∂f/∂(centre) = -a s'(t) (x, y radius_x/radius_y)/d,
// s' = 6 t (1 - t).
template <class T>
void PrintedMarkers<T>::add_row(int row, std::span<const T> levels_bar) {
  for (std::size_t k = 0; k < moved_.size(); ++k)
    for_pixels(moved_[k], row, [&](std::size_t i, double x, double y) {
      const double d = std::sqrt(x * x + y * y), t = radius_x_ + 0.5 - d;
      if (!(t > 0 && t < 1 && d > 0)) return;
      const double factor = 1 - kDarkness * (t * t * (3 - 2 * t)),
                   by = -kDarkness * 6 * t * (1 - t) / (d * factor) *
                        static_cast<double>(levels_bar[i]);
      bar_[k].x += by * x;
      bar_[k].y += by * y * (radius_x_ / radius_y_);
    });
}

template <class T>
void PrintedMarkers<T>::take(std::span<T> displacement_bar) const {
  std::fill(displacement_bar.begin(), displacement_bar.end(), T(0));
  for (std::size_t d = 0; d < bar_.size(); ++d)
    for (std::size_t i = 0; i < 4; ++i)
      for (std::size_t j = 0; j < 4; ++j) {
        const double w = lines_[d].value[i] * columns_[d].value[j];
        const auto at =
            static_cast<std::size_t>(lines_[d].point[i] * grid_.cols + columns_[d].point[j]);
        displacement_bar[2 * at] += static_cast<T>(w * bar_[d].x * grid_.width / grid_.size_x);
        displacement_bar[2 * at + 1] += static_cast<T>(w * bar_[d].y * grid_.height / grid_.size_y);
      }
}

template class PrintedMarkers<float>;
template class PrintedMarkers<double>;

}  // namespace tangere
