// SPDX-License-Identifier: Apache-2.0
// Evaluates the spline at the surface, where the distance is zero and its gradient the normal.
#include "engine/model/mesh_fit.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/contact/distance.hpp"

namespace tangere {

using kernels::Vec3;

namespace {

constexpr double kPlaces = 10000;
constexpr int kMostParts = 64;  // of an edge
// Beyond the middle of a wall the distance falls no further: at this depth, in cells, its gradient
// along the normal has then turned. Beside the edges of thick bodies it is about 0.
constexpr double kUnder = 0.9, kTurned = -0.2;

struct Triangle {
  Vec3<double> a, ab, ac, normal;
  double area;
};

Triangle triangle_of(const MeshShape& mesh, const std::array<int, 3>& t) {
  const auto at = [&](int corner) {
    const double* v = &mesh.vertices[3 * std::size_t(t[std::size_t(corner)])];
    return Vec3<double>{v[0], v[1], v[2]};
  };
  const Vec3<double> a = at(0), ab = at(1) - a, ac = at(2) - a, across = cross(ab, ac);
  const double twice = std::sqrt(dot(across, across));
  return {a, ab, ac, twice > 0 ? (1 / twice) * across : across, twice / 2};
}

}  // namespace

MeshFit mesh_fit(const MeshShape& mesh, const kernels::DistanceGrid& grid) {
  const auto distance = kernels::MeshDistance<double>::of({1, 1, 1}, &grid);
  double area = 0;
  for (const auto& t : mesh.triangles) area += triangle_of(mesh, t).area;
  if (!std::isfinite(area)) return {HUGE_VAL, 1};
  double square = 0, unresolved = 0;
  for (const auto& t : mesh.triangles) {
    const Triangle of = triangle_of(mesh, t);
    // n² equal parts, each by its centroid: n rows of 1, 3, 5, … of them.
    const int n =
        std::clamp(static_cast<int>(std::ceil(std::sqrt(of.area / area * kPlaces))), 1, kMostParts);
    const double weight = of.area / area / (double(n) * n);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j <= 2 * i; ++j) {
        const int place = j / 2;  // in its row
        const bool turned = j % 2 == 1;
        const double u = (i + (turned ? 1.0 / 3 : 2.0 / 3)) / n,
                     v = (place + (turned ? 2.0 / 3 : 1.0 / 3)) / n;
        const Vec3<double> at = of.a + (u - v) * of.ab + v * of.ac;
        const auto here = distance.evaluate(at),
                   under = distance.evaluate(at - (kUnder * grid.cell) * of.normal);
        square += weight * here.d * here.d;
        if (std::abs(here.d) > 0.1 * grid.cell || dot(here.n, of.normal) < 0.5 ||
            dot(under.n, of.normal) < kTurned)
          unresolved += weight;
      }
  }
  return {std::sqrt(square), unresolved};
}

}  // namespace tangere
