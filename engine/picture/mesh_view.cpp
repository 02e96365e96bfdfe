// SPDX-License-Identifier: Apache-2.0
// Triangles in a picture. Corners lie on a grid of 1/256 of a pixel, where whole numbers say
// exactly on which side of an edge a pixel's centre is; of a centre on an edge two triangles agree
// by the rule of top and left edges, so a closed mesh has neither gaps nor pixels that are drawn
// twice. The depth is that of the triangle's plane: with a normal m and a corner a,
//
//   1/t = m·(u, v, 1) / m·a
#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/picture/scene_view.hpp"

namespace tangere {
namespace {

constexpr std::int64_t kParts = 256, kHalf = kParts / 2;  // of a pixel
constexpr double kFarthest = 1 << 29;                     // of a corner, in parts
constexpr double kGuard = 8192;  // pixels from the middle beyond which triangles are cut off

/// E(x, y) = (b - a) x (p - a) of an edge from a to b, zero or more on the inner side.
struct Edge {
  std::int64_t start = 0, per_col = 0, per_row = 0;  // at the first pixel, and from one to the next
};

template <class Place>
Edge edge_of(const Place& a, const Place& b, std::int64_t x, std::int64_t y) {
  const std::int64_t dx = b.x - a.x, dy = b.y - a.y;
  const bool top_or_left = dy < 0 || (dy == 0 && dx > 0);
  return {dx * (y - a.y) - dy * (x - a.x) - (top_or_left ? 0 : 1), -dy * kParts, dx * kParts};
}

/// Whether corners are anticlockwise in the picture, whose rows count downwards.
template <class Place>
bool is_seen(const Place& a, const Place& b, const Place& c) {
  return (c.x - a.x) * (b.y - a.y) - (c.y - a.y) * (b.x - a.x) > 0;
}

std::int64_t first_centre(std::int64_t place) { return (place - kHalf + kParts - 1) >> 8; }
std::int64_t last_centre(std::int64_t place) { return (place - kHalf) >> 8; }

/// The colour of a solid times a tone, and a share of white, rounded; at most white.
std::uint32_t lit_colour(const ViewSolid& of, double tone, double white) {
  std::uint32_t colour = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double level = 255 * std::clamp(of.colour[k], 0.0, 1.0) * tone + 255 * white;
    colour |= static_cast<std::uint32_t>(std::min(level, 255.0) + 0.5) << (8 * k);
  }
  return colour;
}

/// The strength of the highlight at a surface with a unit normal, along a ray of any length.
double highlight(const Vector3& normal, double cosine, const Vector3& light, const Vector3& ray,
                 int exponent) {
  const double length = std::sqrt(dot(ray, ray)), ahead = dot(light, ray) / length;
  const double half =
      (cosine - dot(normal, ray) / length) / std::sqrt(std::max(2 - 2 * ahead, 1e-20));
  double x = std::clamp(half, 0.0, 1.0), power = 1;
  for (int left = exponent; left > 0; left >>= 1, x *= x)
    if ((left & 1) != 0) power *= x;
  return power;
}

}  // namespace

SceneView::Place SceneView::place_of(const Vector3& corner) const {
  const auto part = [&](double along, int count) {
    const double place = (along / corner[2] * focal_ + 0.5 * count) * kParts;
    return static_cast<std::int64_t>(std::llrint(std::clamp(place, -kFarthest, kFarthest)));
  };
  return {part(corner[0], grid_.cols), part(corner[1], grid_.rows)};
}

void SceneView::add(const ViewMesh& mesh, const ViewSolid& at) {
  const std::size_t count = mesh.vertices.size() / 3;
  corners_.resize(count), places_.resize(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double *const v = mesh.vertices.data() + 3 * k, x = mesh.scale * v[0],
                        y = mesh.scale * v[1], z = mesh.scale * v[2];
    for (std::size_t i = 0; i < 3; ++i)
      corners_[k][i] = at.origin[i] + (x * at.axes[0][i] + (y * at.axes[1][i] + z * at.axes[2][i]));
    if (corners_[k][2] > kNearest) places_[k] = place_of(corners_[k]);
  }
  const double wide = kGuard / focal_;
  const auto fits = [wide](const Vector3& p) {
    return std::abs(p[0]) <= wide * p[2] && std::abs(p[1]) <= wide * p[2];
  };
  for (const std::array<int, 3>& t : mesh.triangles) {
    const std::size_t i = std::size_t(t[0]), j = std::size_t(t[1]), k = std::size_t(t[2]);
    const Vector3 &a = corners_[i], &b = corners_[j], &c = corners_[k];
    const int before = int(a[2] > kNearest) + int(b[2] > kNearest) + int(c[2] > kNearest);
    const bool whole = before == 3 && fits(a) && fits(b) && fits(c);
    if (whole && !is_seen(places_[i], places_[j], places_[k])) continue;
    if (whole)
      add_triangle({a, b, c}, {places_[i], places_[j], places_[k]}, at);
    else if (before > 0)
      add_cut_triangle({a, b, c}, at);
  }
}

/// Cuts off what lies behind the nearest depth, and what is so far outside of the picture that it
/// has no place on the grid. A cut goes from the inner corner to the outer one, so two triangles
/// have the same place on their common edge.
void SceneView::add_cut_triangle(const std::array<Vector3, 3>& corners, const ViewSolid& of) {
  constexpr std::size_t kPlanes = 5;
  const double wide = kGuard / focal_;
  const std::array<Vector3, kPlanes> inward{
      {{0, 0, 1}, {1, 0, wide}, {-1, 0, wide}, {0, 1, wide}, {0, -1, wide}}};
  std::array<Vector3, 3 + kPlanes> kept{corners[0], corners[1], corners[2]}, next;
  std::size_t count = 3;
  for (std::size_t plane = 0; plane < kPlanes; ++plane) {
    const auto inside = [&](const Vector3& p) {
      return dot(inward[plane], p) - (plane == 0 ? kNearest : 0);
    };
    std::size_t n = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const Vector3 &a = kept[k], &b = kept[(k + 1) % count];
      const double at_a = inside(a), at_b = inside(b);
      if (at_a > 0) next[n++] = a;
      if ((at_a > 0) == (at_b > 0)) continue;
      const Vector3 &in = at_a > 0 ? a : b, &out = at_a > 0 ? b : a;
      const double at_in = std::max(at_a, at_b), at_out = std::min(at_a, at_b);
      next[n] = in + (at_in / (at_in - at_out)) * (out - in);
      if (plane == 0) next[n][2] = kNearest;
      ++n;
    }
    std::swap(kept, next);
    count = n;
    if (count < 3) return;
  }
  for (std::size_t k = 2; k < count; ++k)
    add_triangle({kept[0], kept[k - 1], kept[k]},
                 {place_of(kept[0]), place_of(kept[k - 1]), place_of(kept[k])}, of);
}

void SceneView::add_triangle(const std::array<Vector3, 3>& corners,
                             const std::array<Place, 3>& places, const ViewSolid& of) {
  const Place &a = places[0], &b = places[2], &c = places[1];  // clockwise: rows count downwards
  if (!is_seen(places[0], places[1], places[2])) return;
  const auto clamp = [](std::int64_t x, int most) {
    return static_cast<int>(std::clamp<std::int64_t>(x, -1, most));
  };
  const int first_col = std::max(0, clamp(first_centre(std::min({a.x, b.x, c.x})), grid_.cols)),
            last_col =
                std::min(grid_.cols - 1, clamp(last_centre(std::max({a.x, b.x, c.x})), grid_.cols)),
            first_row = std::max(0, clamp(first_centre(std::min({a.y, b.y, c.y})), grid_.rows)),
            last_row =
                std::min(grid_.rows - 1, clamp(last_centre(std::max({a.y, b.y, c.y})), grid_.rows));
  if (first_col > last_col || first_row > last_row) return;
  const Vector3 normal = cross(corners[1] - corners[0], corners[2] - corners[0]);
  const double length = std::sqrt(dot(normal, normal)), plane = dot(normal, corners[0]);
  if (!(plane < 0)) return;
  const auto [low, high] = std::minmax({corners[0][2], corners[1][2], corners[2][2]});
  const auto least = static_cast<float>(low), most = static_cast<float>(high);
  const double cosine = dot(normal, light_) / length;
  const double tone = ambient_ + direct_ * std::clamp(cosine, 0.0, 1.0) + of.emission;
  const bool shines = of.specular > 0 && cosine > 0;
  const std::uint32_t colour = lit_colour(of, tone, 0);
  const std::int64_t x = kParts * first_col + kHalf, y = kParts * first_row + kHalf;
  std::array<Edge, 3> edges{edge_of(a, b, x, y), edge_of(b, c, x, y), edge_of(c, a, x, y)};
  const auto per_u = static_cast<float>(normal[0] / plane);
  for (int i = first_row; i <= last_row; ++i) {
    const double v = ray_row(i);
    const auto per_row = static_cast<float>((normal[1] * v + normal[2]) / plane);
    std::int64_t p = edges[0].start, q = edges[1].start, r = edges[2].start;
    const std::size_t row = std::size_t(i) * std::size_t(grid_.cols);
    for (int j = first_col; j <= last_col; ++j) {
      if ((p | q | r) >= 0) {
        const std::size_t pixel = row + std::size_t(j);
        const float t = std::clamp(1.0F / (per_u * u_[std::size_t(j)] + per_row), least, most);
        if (t < depth_[pixel]) {
          depth_[pixel] = t;
          numbers_[pixel] = of.number;
          colours_[pixel] =
              shines ? lit_colour(of, tone,
                                  direct_ * of.specular *
                                      highlight((1 / length) * normal, cosine, light_,
                                                {double(u_[std::size_t(j)]), v, 1}, of.exponent))
                     : colour;
        }
      }
      p += edges[0].per_col, q += edges[1].per_col, r += edges[2].per_col;
    }
    for (Edge& edge : edges) edge.start += edge.per_row;
  }
}

}  // namespace tangere
