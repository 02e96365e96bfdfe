// SPDX-License-Identifier: Apache-2.0
// The gradient is that of central differences inside of the grid and one-sided ones at its edges:
//   (∇p)_i = (p_{i+1} - p_{i-1}) / (x_{i+1} - x_{i-1})
// Across a single row there is none.
#include "engine/sense/marker_map.hpp"

#include <algorithm>
#include <vector>

#include "engine/model/compile_markers.hpp"
#include "engine/sense/spread_field.hpp"

namespace tangere {

struct MarkerMap::Impl {
  CompiledMarkers of;

  [[nodiscard]] std::size_t size() const { return 2 * std::size_t(of.rows) * std::size_t(of.cols); }

  /// Calls f(point, component, point ahead, point behind, 1/(distance of the two)) for all places
  /// and axes with a difference.
  template <class F>
  void for_differences(const F& f) const {
    const auto along = [&](int at, int points, double pitch, int stride, int point, int axis) {
      if (points < 2) return;
      const int ahead = std::min(at + 1, points - 1), behind = std::max(at - 1, 0);
      f(std::size_t(point), std::size_t(axis), std::size_t(point + (ahead - at) * stride),
        std::size_t(point + (behind - at) * stride), 1 / ((ahead - behind) * pitch));
    };
    for (int i = 0; i < of.rows; ++i)
      for (int j = 0; j < of.cols; ++j) {
        along(i, of.rows, of.pitch[0], of.cols, i * of.cols + j, 0);
        along(j, of.cols, of.pitch[1], 1, i * of.cols + j, 1);
      }
  }
  void spread(bool back, std::vector<double>& moved) const {
    thread_local std::vector<double> scratch;
    scratch.resize(std::max(scratch.size(), moved.size()));
    spread_field(of.spread, of.rows, of.cols, 2, back, moved, scratch);
  }
};

MarkerMap::MarkerMap(const Model& model, int sensor) {
  const TactileDescription& d = model.scene().sensors.at(std::size_t(sensor));
  if (!d.markers)
    throw InputError("sensor '" + d.name + "' has no <markers>; expected them in its <tactile>");
  impl_ = std::make_unique<Impl>(
      Impl{compile_markers(d, model.sensors()[std::size_t(sensor)].pressure_sign)});
}
MarkerMap::~MarkerMap() = default;
MarkerMap::MarkerMap(MarkerMap&&) noexcept = default;
MarkerMap& MarkerMap::operator=(MarkerMap&&) noexcept = default;

void MarkerMap::displace(std::span<const double> field, std::span<double> displacement) const {
  const Impl& m = *impl_;
  thread_local std::vector<double> moved;  // (points, 2)
  moved.resize(m.size());
  const double press = m.of.pressure_sign * m.of.bulge;
  for (std::size_t k = 0; k < moved.size(); ++k)
    moved[k] = m.of.compliance * field[k / 2 * 3 + k % 2];
  if (press != 0)
    m.for_differences([&](std::size_t point, std::size_t axis, std::size_t ahead,
                          std::size_t behind, double per_distance) {
      moved[2 * point + axis] -=
          press * per_distance * (field[3 * ahead + 2] - field[3 * behind + 2]);
    });
  m.spread(false, moved);
  std::copy(moved.begin(), moved.end(), displacement.begin());
}

void MarkerMap::pull_back(std::span<const double> displacement_bar,
                          std::span<double> field_bar) const {
  const Impl& m = *impl_;
  const double press = m.of.pressure_sign * m.of.bulge;
  thread_local std::vector<double> moved;  // (points, 2)
  moved.assign(displacement_bar.begin(), displacement_bar.end());
  m.spread(true, moved);
  for (std::size_t k = 0; k < moved.size(); ++k)
    field_bar[k / 2 * 3 + k % 2] += m.of.compliance * moved[k];
  if (press == 0) return;
  m.for_differences([&](std::size_t point, std::size_t axis, std::size_t ahead, std::size_t behind,
                        double per_distance) {
    const double x = press * per_distance * moved[2 * point + axis];
    field_bar[3 * ahead + 2] -= x;
    field_bar[3 * behind + 2] += x;
  });
}

}  // namespace tangere
