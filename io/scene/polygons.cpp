// SPDX-License-Identifier: Apache-2.0
// An ear is a corner b between a and c whose triangle (a, b, c) lies in the polygon: it has a
// positive area, and no other corner lies in it. Cutting ears keeps every corner, straight ones as
// well, so that neighbours of the face stay closed; libraries for maps drop straight corners.
#include "io/scene/polygons.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tangere {
namespace {

constexpr double kFlat = 1e-12;       // area of a triangle without one, over the polygon's size²
constexpr double kFanFlat = 1e-9;     // the same for a fan, which may lie outside by as much
constexpr long kMostTests = 1 << 28;  // of a corner against a triangle or of two edges

using Point = std::array<double, 2>;

class Polygon {
 public:
  Polygon(const std::vector<Vector3>& positions, const std::vector<int>& corners)
      : corners_(corners) {
    // Newell's normal: the sum of all triangles on one corner.
    Vector3 normal{};
    const Vector3& first = positions[std::size_t(corners[0])];
    std::vector<Vector3> from_first;
    for (const int v : corners) {
      Vector3 p = positions[std::size_t(v)];
      for (std::size_t c = 0; c < 3; ++c) p[c] -= first[c];
      from_first.push_back(p);
    }
    for (std::size_t k = 0; k < from_first.size(); ++k) {
      const Vector3 part = cross(from_first[k], from_first[(k + 1) % from_first.size()]);
      for (std::size_t c = 0; c < 3; ++c) normal[c] += part[c];
    }
    // The projection along the normal's greatest component keeps the order of corners.
    std::size_t axis = 0;
    for (std::size_t c = 1; c < 3; ++c)
      if (std::abs(normal[c]) > std::abs(normal[axis])) axis = c;
    std::size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    if (normal[axis] < 0) std::swap(u, v);
    double size = 0;
    for (const Vector3& p : from_first) {
      points_.push_back({p[u], p[v]});
      size = std::max({size, std::abs(p[u]), std::abs(p[v])});
    }
    square_ = size * size;
  }

  [[nodiscard]] bool is_fan() const {
    for (std::size_t k = 1; k + 1 < points_.size(); ++k)
      if (area(0, k, k + 1) < -kFanFlat * square_) return false;
    return true;
  }

  /// Appends n - 2 triangles. Returns why it could not, or "".
  std::string cut(std::vector<std::array<int, 3>>& out) {
    if (crosses_itself()) return "edges that cross each other";
    std::vector<std::size_t> left(points_.size());
    for (std::size_t k = 0; k < left.size(); ++k) left[k] = k;
    std::size_t at = 0, tried = 0;
    bool flat_too = false;
    while (left.size() > 3 && tests_ < kMostTests) {
      const std::size_t n = left.size();
      if (tried == n && flat_too) return "no corner that can be cut off";
      if (tried == n) flat_too = true, tried = 0;
      at %= n;
      if (!is_ear(left, at, flat_too)) {
        ++at;
        ++tried;
        continue;
      }
      add(left[(at + n - 1) % n], left[at], left[(at + 1) % n], out);
      left.erase(left.begin() + static_cast<std::ptrdiff_t>(at));
      tried = 0;
      flat_too = false;
    }
    if (left.size() > 3) return "too many corners for a face that is not convex";
    add(left[0], left[1], left[2], out);
    return "";
  }

  void fan(std::vector<std::array<int, 3>>& out) const {
    for (std::size_t k = 1; k + 1 < points_.size(); ++k) add(0, k, k + 1, out);
  }

 private:
  void add(std::size_t a, std::size_t b, std::size_t c,
           std::vector<std::array<int, 3>>& out) const {
    out.push_back({corners_[a], corners_[b], corners_[c]});
  }

  /// Twice the area of a triangle, above 0 if it is anticlockwise.
  [[nodiscard]] double area(std::size_t a, std::size_t b, std::size_t c) const {
    const Point &p = points_[a], &q = points_[b], &r = points_[c];
    return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0]);
  }
  [[nodiscard]] int side(std::size_t a, std::size_t b, std::size_t c) const {
    const double x = area(a, b, c);
    return std::abs(x) <= kFlat * square_ ? 0 : x > 0 ? 1 : -1;
  }

  [[nodiscard]] bool is_ear(const std::vector<std::size_t>& left, std::size_t at, bool flat_too) {
    const std::size_t n = left.size(), a = left[(at + n - 1) % n], b = left[at],
                      c = left[(at + 1) % n];
    const int turn = side(a, b, c);
    if (turn <= 0) return turn == 0 && flat_too;
    for (std::size_t k = 0; k < n; ++k) {
      const std::size_t p = left[k];
      if (p == a || p == b || p == c) continue;
      ++tests_;
      if (points_[p] == points_[b]) {
        // A second visit of the corner: its edges must not lead into the ear.
        for (const std::size_t end : {left[(k + n - 1) % n], left[(k + 1) % n]})
          if (side(a, b, end) > 0 && side(b, c, end) > 0) return false;
        continue;
      }
      if (points_[p] == points_[a] || points_[p] == points_[c]) continue;
      if (side(a, b, p) >= 0 && side(b, c, p) >= 0 && side(c, a, p) >= 0) return false;
    }
    return true;
  }

  [[nodiscard]] bool crosses_itself() {
    const std::size_t n = points_.size();
    for (std::size_t i = 0; i < n && tests_ < kMostTests; ++i)
      for (std::size_t j = i + 2; j < n; ++j) {
        const std::size_t i1 = i + 1, j1 = (j + 1) % n;
        ++tests_;
        if (side(i, i1, j) * side(i, i1, j1) < 0 && side(j, j1, i) * side(j, j1, i1) < 0)
          return true;
      }
    return false;
  }

  const std::vector<int>& corners_;
  std::vector<Point> points_;  // in the plane, anticlockwise
  double square_ = 0;          // of the polygon's size
  long tests_ = 0;
};

}  // namespace

std::string cut_polygon(const std::vector<Vector3>& positions, const std::vector<int>& corners,
                        std::vector<std::array<int, 3>>& triangles) {
  if (corners.size() == 3) {
    triangles.push_back({corners[0], corners[1], corners[2]});
    return "";
  }
  Polygon polygon(positions, corners);
  const std::size_t before = triangles.size();
  std::string fault = polygon.is_fan() ? "" : polygon.cut(triangles);
  if (triangles.size() - before == corners.size() - 2) return "";
  triangles.resize(before);
  polygon.fan(triangles);
  return fault;
}

}  // namespace tangere
