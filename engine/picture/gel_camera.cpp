// SPDX-License-Identifier: Apache-2.0
// One row of pixels after the other, so that all that is computed of it stays in the cache.
#include "engine/picture/gel_camera.hpp"

#include <algorithm>

#include "engine/picture/clones.hpp"

namespace tangere {
namespace {

constexpr float kWhite = 255;

/// Rounds half up to bytes. What is not a number becomes 0.
TANGERE_CLONES void round_row(const float* from, std::uint8_t* to, std::size_t count) {
#pragma GCC ivdep
  for (std::size_t i = 0; i < count; ++i) {
    const float level = !(from[i] > 0) ? 0.0F : from[i] > kWhite ? kWhite : from[i];
    to[i] = static_cast<std::uint8_t>(static_cast<int>(level + 0.5F));
  }
}

TANGERE_CLONES void interleave(const std::uint8_t* planes, std::uint8_t* to, std::size_t width) {
  const std::uint8_t *const r = planes, *const g = r + width, *const b = g + width;
#pragma GCC ivdep
  for (std::size_t i = 0; i < width; ++i) {
    to[3 * i] = r[i];
    to[3 * i + 1] = g[i];
    to[3 * i + 2] = b[i];
  }
}

template <class T>
struct WeighedRow {
  const T *planes, *colour_bar;  ///< levels (3, width); cotangents of clamped levels (width, 3)
  T* planes_bar;                 ///< result: cotangents of levels (3, width)
  std::size_t width;
  std::array<T, kColours> gains;
};

template <class T>
[[gnu::always_inline]] inline void weigh_pixels(const WeighedRow<T>& row) {
  const std::size_t width = row.width;
  const T *const r = row.planes, *const g = r + width, *const b = g + width;
  const T* const bar = row.colour_bar;
  T *const r_bar = row.planes_bar, *const g_bar = r_bar + width, *const b_bar = g_bar + width;
  const std::array<T, kColours> gains = row.gains;
  const auto share = [](T level, T gain, T cotangent) {
    return level < T(0) || level > T(kWhite) ? T(0) : gain * cotangent;
  };
#pragma GCC ivdep
  for (std::size_t i = 0; i < width; ++i) {
    r_bar[i] = share(r[i], gains[0], bar[3 * i]);
    g_bar[i] = share(g[i], gains[1], bar[3 * i + 1]);
    b_bar[i] = share(b[i], gains[2], bar[3 * i + 2]);
  }
}
TANGERE_CLONES void weigh_row(const WeighedRow<float>& row) { weigh_pixels(row); }
TANGERE_CLONES void weigh_row(const WeighedRow<double>& row) { weigh_pixels(row); }

}  // namespace

PictureGrid picture_grid(const PictureDescription& picture, int rows, int cols, double pitch_x,
                         double pitch_y) {
  const std::array<double, 2> size = shown_size(picture, rows, cols, {pitch_y, pitch_x});
  return {rows, cols, pitch_x, pitch_y, picture.rows, picture.cols, size[1], size[0]};
}

template <class T>
GelCamera<T>::GelCamera(const PictureGrid& grid, const PictureDescription& picture, double reach,
                        Outside outside)
    : grid_(grid),
      noise_(picture.noise),
      gain_(picture.gain),
      membrane_(grid.rows, grid.cols, picture.gel->reach.value_or(reach) / grid.pitch_x,
                picture.gel->reach.value_or(reach) / grid.pitch_y),
      image_(grid, picture.gel->blur, outside),
      height_(grid, 0, outside),
      colour_(*picture.gel, grid.height, grid.width),
      depth_(static_cast<std::size_t>(grid.points())),
      surface_(depth_.size()),
      p_(static_cast<std::size_t>(grid.width)),
      q_(p_.size()),
      up_(p_.size()),
      planes_(kColours * p_.size()),
      p_bar_(p_.size()),
      q_bar_(p_.size()),
      bytes_(planes_.size()) {
  if (picture.markers[0] > 0)
    markers_.emplace(grid, picture.markers[0], picture.markers[1], picture.marker_pitch,
                     picture.marker_radius);
}

template <class T>
void GelCamera<T>::set_depth(std::span<const T> depth) {
  std::copy(depth.begin(), depth.end(), depth_.begin());
  membrane_.settle(depth_, surface_);
  image_.set(surface_);
}

template <class T>
void GelCamera<T>::set_surface(std::span<const T> surface) {
  std::copy(surface.begin(), surface.end(), surface_.begin());
  image_.set(surface_);
}

template <class T>
void GelCamera<T>::set_draws(const CameraKey& key) {
  key_ = key;
  const std::array<double, kColours> gains = camera_gains(key, gain_);
  std::transform(gains.begin(), gains.end(), gains_.begin(),
                 [](double x) { return static_cast<T>(x); });
}

template <class T>
void GelCamera<T>::read_height(std::span<T> height) {
  const std::size_t width = p_.size();
  height_.set(surface_);
  for (int row = 0; row < grid_.height; ++row)
    height_.read_heights(row, height.subspan(static_cast<std::size_t>(row) * width, width));
}

template <class T>
void GelCamera<T>::shade(int row) {
  if (image_.is_flat(row)) {
    std::fill(p_.begin(), p_.end(), T(0));
    std::fill(q_.begin(), q_.end(), T(0));
    std::fill(up_.begin(), up_.end(), T(1));
    const std::span<const T> flat = colour_.background(row);
    std::copy(flat.begin(), flat.end(), planes_.begin());
  } else {
    image_.read_slopes(row, p_, q_);
    colour_.shade(row, p_, q_, planes_, up_);
  }
}

template <class T>
void GelCamera<T>::add_draws(int row) {
  if (!key_) return;
  const std::size_t width = p_.size();
  for (std::size_t c = 0; c < kColours && gain_ != 0; ++c)
    for (std::size_t i = 0; i < width; ++i) planes_[c * width + i] *= gains_[c];
  if (noise_ != 0) add_camera_noise<T>(*key_, noise_, row * grid_.width, planes_);
}

template <class T>
void GelCamera<T>::paint(int row, bool markers) {
  shade(row);
  if (markers) markers_->darken(row, planes_);
  add_draws(row);
}

template <class T>
void GelCamera<T>::read(bool markers, std::span<T> colours) {
  const std::size_t width = p_.size();
  for (int row = 0; row < grid_.height; ++row) {
    paint(row, markers);
    T* const to = colours.data() + static_cast<std::size_t>(row) * planes_.size();
    for (std::size_t i = 0; i < width; ++i)
      for (std::size_t c = 0; c < kColours; ++c)
        to[kColours * i + c] = std::clamp(planes_[c * width + i], T(0), T(kWhite));
  }
}

template <class T>
void GelCamera<T>::read(bool markers,
                        std::span<std::uint8_t> colours) requires std::is_same_v<T, float> {
  for (int row = 0; row < grid_.height; ++row) {
    paint(row, markers);
    round_row(planes_.data(), bytes_.data(), planes_.size());
    interleave(bytes_.data(), colours.data() + static_cast<std::size_t>(row) * planes_.size(),
               p_.size());
  }
}

template <class T>
void GelCamera<T>::pull_back(bool markers, std::span<const T> height_bar,
                             std::span<const T> colour_bar, std::span<T> surface_bar,
                             std::span<T> displacement_bar) {
  if (colour_bar.empty()) {
    std::fill(surface_bar.begin(), surface_bar.end(), T(0));
  } else {
    pull_back_colours(markers, colour_bar, !displacement_bar.empty());
    image_.take(surface_bar);
    if (!displacement_bar.empty()) markers_->take(displacement_bar);
  }
  if (height_bar.empty()) return;
  const std::size_t width = p_.size();
  height_.begin_pull_back();
  for (int row = 0; row < grid_.height; ++row)
    height_.add_heights(row, height_bar.subspan(static_cast<std::size_t>(row) * width, width));
  std::vector<T> heights_bar(surface_bar.size());
  height_.take(heights_bar);
  for (std::size_t k = 0; k < heights_bar.size(); ++k) surface_bar[k] += heights_bar[k];
}

/// Leaves the cotangents of colours in image_ and, where they `move`, in markers_.
template <class T>
void GelCamera<T>::pull_back_colours(bool markers, std::span<const T> colour_bar, bool move) {
  const std::size_t width = p_.size();
  std::vector<T> planes_bar(planes_.size()), shaded, levels_bar(width);
  image_.begin_pull_back();
  if (move) markers_->begin_pull_back();
  for (int row = 0; row < grid_.height; ++row) {
    shade(row);
    if (move) shaded = planes_;
    if (markers) markers_->darken(row, planes_);
    add_draws(row);
    weigh_row({planes_.data(), colour_bar.data() + kColours * static_cast<std::size_t>(row) * width,
               planes_bar.data(), width, gains_});
    if (markers) markers_->darken(row, planes_bar);  // by the same factors as colours
    if (move) {
      for (std::size_t i = 0; i < width; ++i) {
        levels_bar[i] = 0;
        for (std::size_t c = 0; c < kColours; ++c)
          levels_bar[i] += shaded[c * width + i] * planes_bar[c * width + i];
      }
      markers_->add_row(row, levels_bar);
    }
    colour_.pull_back(row, p_, q_, up_, planes_bar, p_bar_, q_bar_);
    image_.add_slopes(row, p_bar_, q_bar_);
  }
}

template <class T>
void GelCamera<T>::pull_back_depth(std::span<const T> surface_bar, std::span<T> depth_bar) {
  membrane_.pull_back(depth_, surface_, surface_bar, depth_bar);
}

template class GelCamera<float>;
template class GelCamera<double>;

}  // namespace tangere
