// SPDX-License-Identifier: Apache-2.0
// From places of a scene to places on a page, without perspective, and the lines of drawings in
// three dimensions.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "engine/base/vector3.hpp"
#include "io/picture/scene_plot.hpp"

namespace tangere::svg {

// Space that a projection leaves free on the page.
inline constexpr double kAbove = 64, kBelow = 46, kEdge = 60;

/// On the page, y downward.
struct Place {
  double x, y;
};

/// Turns places of the scene into places on the page.
class Projection {
 public:
  Projection(const SceneCamera& camera, double width, double height)
      : width_(width), height_(height) {
    const double turn = camera.turn * M_PI / 180, lift = camera.lift * M_PI / 180;
    right_ = {std::cos(turn), std::sin(turn), 0};
    const Vector3 forward = {-std::sin(turn), std::cos(turn), 0};
    up_ = std::sin(lift) * forward + Vector3{0, 0, std::cos(lift)};
    near_ = cross(right_, up_);
  }
  /// Makes everything that was taken fit the page.
  void take(const Vector3& p) {
    const double x = dot(right_, p), y = dot(up_, p);
    low_ = {std::min(low_.x, x), std::min(low_.y, y)};
    high_ = {std::max(high_.x, x), std::max(high_.y, y)};
  }
  void fit() {
    const double wide = std::max(high_.x - low_.x, 1e-9), tall = std::max(high_.y - low_.y, 1e-9);
    scale_ = std::min((width_ - 2 * kEdge) / wide, (height_ - kAbove - kBelow - kEdge) / tall);
  }
  [[nodiscard]] Place operator()(const Vector3& p) const {
    return {width_ / 2 + scale_ * (dot(right_, p) - (low_.x + high_.x) / 2),
            (kAbove + height_ - kBelow) / 2 - scale_ * (dot(up_, p) - (low_.y + high_.y) / 2)};
  }
  /// Direction on the page of a direction of the scene, y downward.
  [[nodiscard]] Place along(const Vector3& d) const { return {dot(right_, d), -dot(up_, d)}; }
  [[nodiscard]] double nearness(const Vector3& p) const { return dot(near_, p); }
  /// Length in the scene of a length on the page [m].
  [[nodiscard]] double metres(double length) const { return length / scale_; }

 private:
  Vector3 right_{}, up_{}, near_{};  ///< near: towards the eye
  Place low_{HUGE_VAL, HUGE_VAL}, high_{-HUGE_VAL, -HUGE_VAL};
  double width_, height_, scale_ = 1;
};

/// Returns the attribute d of a path.
std::string path_of(const std::vector<Place>& places, bool closed);

/// Returns a line that ends in a tip.
std::string arrow(const std::vector<Place>& way, const char* colour);

}  // namespace tangere::svg
