// SPDX-License-Identifier: Apache-2.0
// Quickhull on whole numbers. On a grid of 2^20 cells along the longest side, six times the volume
// of a tetrahedron is an exact number of 64 bits. So tests for points outside a face are exact, and
// the result is closed.
#include "io/scene/convex_hull.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>

namespace tangere {
namespace {

using Whole = std::int64_t;
using GridPlace = std::array<Whole, 3>;
constexpr double kCells = 1 << 20;

GridPlace difference(const GridPlace& a, const GridPlace& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
GridPlace normal_of(const GridPlace& a, const GridPlace& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Whole product(const GridPlace& a, const GridPlace& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
double square(const GridPlace& a) {
  double sum = 0;
  for (const Whole x : a) sum += static_cast<double>(x) * static_cast<double>(x);
  return sum;
}

/// A triangle with its corners anticlockwise seen from outside.
struct HullFace {
  std::array<int, 3> corners;
  std::array<int, 3> beyond;  ///< the face across the edge from corner k to the next
  std::vector<int> outside;   ///< points above this face, each assigned to one face
  bool gone = false;
};

class HullBuilder {
 public:
  explicit HullBuilder(const std::vector<double>& points) : points_(points) {
    place_points();
    if (!start()) return;
    for (std::size_t f = 0; f < faces_.size(); ++f)
      while (!faces_[f].gone && !faces_[f].outside.empty()) grow(static_cast<int>(f));
  }

  [[nodiscard]] MeshShape mesh() const {
    MeshShape out;
    std::map<int, int> index;
    for (const HullFace& face : faces_) {
      if (face.gone) continue;
      std::array<int, 3> triangle{};
      for (std::size_t k = 0; k < 3; ++k) {
        const int at = face.corners[k];
        const auto [found, fresh] = index.emplace(at, static_cast<int>(index.size()));
        const double* const p = &points_[3 * std::size_t(source_[std::size_t(at)])];
        if (fresh) out.vertices.insert(out.vertices.end(), p, p + 3);
        triangle[k] = found->second;
      }
      out.triangles.push_back(triangle);
    }
    return out;
  }

 private:
  /// Puts the points on the grid, equal ones once.
  void place_points() {
    std::array<double, 3> low{}, high{};
    for (std::size_t k = 0; k < points_.size(); ++k) {
      const std::size_t c = k % 3;
      low[c] = k < 3 ? points_[k] : std::min(low[c], points_[k]);
      high[c] = k < 3 ? points_[k] : std::max(high[c], points_[k]);
    }
    const double side = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
    std::map<GridPlace, int> known;
    for (std::size_t k = 0; side > 0 && k < points_.size(); k += 3) {
      GridPlace at{};
      for (std::size_t c = 0; c < 3; ++c)
        at[c] = static_cast<Whole>(std::round((points_[k + c] - low[c]) / side * kCells));
      if (!known.emplace(at, 0).second) continue;
      places_.push_back(at);
      source_.push_back(static_cast<int>(k / 3));
    }
  }

  [[nodiscard]] const GridPlace& at(int point) const { return places_[std::size_t(point)]; }
  [[nodiscard]] HullFace& face(int f) { return faces_[std::size_t(f)]; }

  /// Six times the signed volume between a face and a point: above 0 if the point is outside.
  [[nodiscard]] Whole height(const HullFace& f, int point) const {
    const GridPlace& a = at(f.corners[0]);
    return product(normal_of(difference(at(f.corners[1]), a), difference(at(f.corners[2]), a)),
                   difference(at(point), a));
  }

  /// The point for which `measure` is greatest, the first of equals; -1 if it is 0 for all.
  template <class Measure>
  [[nodiscard]] int farthest(Measure&& measure) const {
    int best = -1;
    double most = 0;
    for (int p = 0; p < static_cast<int>(places_.size()); ++p)
      if (const double x = measure(at(p)); x > most) best = p, most = x;
    return best;
  }

  /// Makes a tetrahedron of points that are far from each other. Returns false in a plane.
  bool start() {
    if (places_.empty()) return false;
    const int a = 0;
    const int b = farthest([&](const GridPlace& p) { return square(difference(p, at(a))); });
    if (b < 0) return false;
    const GridPlace along = difference(at(b), at(a));
    const int c = farthest(
        [&](const GridPlace& p) { return square(normal_of(along, difference(p, at(a)))); });
    if (c < 0) return false;
    const GridPlace normal = normal_of(along, difference(at(c), at(a)));
    const auto above = [&](const GridPlace& p) { return product(normal, difference(p, at(a))); };
    const int d = farthest([&](const GridPlace& p) { return std::abs(double(above(p))); });
    if (d < 0) return false;
    const auto [second, third] = above(at(d)) < 0 ? std::pair{b, c} : std::pair{c, b};
    faces_ = {{{a, second, third}, {1, 2, 3}, {}},
              {{second, a, d}, {0, 3, 2}, {}},
              {{third, second, d}, {0, 1, 3}, {}},
              {{a, third, d}, {0, 2, 1}, {}}};
    std::vector<int> all;
    for (int p = 0; p < static_cast<int>(places_.size()); ++p) all.push_back(p);
    share(all, 0);
    return true;
  }

  /// Assigns each point to a face, of those from `first` on, that it is above. Others are inside.
  void share(const std::vector<int>& points, std::size_t first) {
    for (const int p : points)
      for (std::size_t f = first; f < faces_.size(); ++f)
        if (height(faces_[f], p) > 0) {
          faces_[f].outside.push_back(p);
          break;
        }
  }

  /// Replaces all faces below the farthest point of face `f` by a cone to it.
  void grow(int f) {
    const std::vector<int>& outside = face(f).outside;
    const int apex = *std::max_element(outside.begin(), outside.end(), [&](int p, int q) {
      return height(face(f), p) < height(face(f), q);
    });
    std::vector<int> visible = {f}, left;
    face(f).gone = true;
    const std::size_t first = faces_.size();
    std::map<int, int> starts, ends;  // new faces by the corner where their edge starts, or ends
    for (std::size_t i = 0; i < visible.size(); ++i) {
      const int now = visible[i];
      left.insert(left.end(), face(now).outside.begin(), face(now).outside.end());
      face(now).outside.clear();
      for (std::size_t k = 0; k < 3; ++k) {
        const int other = face(now).beyond[k];
        if (face(other).gone) continue;
        if (height(face(other), apex) > 0) {
          face(other).gone = true;
          visible.push_back(other);
          continue;
        }
        const int from = face(now).corners[k], to = face(now).corners[(k + 1) % 3];
        const int fresh = static_cast<int>(faces_.size());
        for (std::size_t e = 0; e < 3; ++e)
          if (face(other).corners[e] == to && face(other).corners[(e + 1) % 3] == from)
            face(other).beyond[e] = fresh;
        starts[from] = ends[to] = fresh;
        faces_.push_back({{from, to, apex}, {other, 0, 0}, {}});
      }
    }
    for (std::size_t i = first; i < faces_.size(); ++i) {
      faces_[i].beyond[1] = starts.at(faces_[i].corners[1]);
      faces_[i].beyond[2] = ends.at(faces_[i].corners[0]);
    }
    share(left, first);
  }

  const std::vector<double>& points_;
  std::vector<GridPlace> places_;  // on the grid
  std::vector<int> source_;        // of a place: its point
  std::vector<HullFace> faces_;
};

}  // namespace

MeshShape convex_hull(const std::vector<double>& points) { return HullBuilder(points).mesh(); }

}  // namespace tangere
