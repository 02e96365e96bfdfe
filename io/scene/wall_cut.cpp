// SPDX-License-Identifier: Apache-2.0
// A convex polygon without a triangle is up to three convex polygons: to the right of its first
// edge, then to the right of the second of what is to the left of the first, and so on. Edges of
// the old and of the new triangles cancel in space, but corners of some lie on edges of others. A
// triangle without area between such an edge and corner takes the edge in two.
#include "io/scene/wall_cut.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "io/scene/mesh_corners.hpp"

namespace tangere {
namespace {

constexpr double kTiny = 1e-12;   // of size²: a polygon without area
constexpr double kSnap = 1e-6;    // of size: new corners nearer than this are one
constexpr double kOnEdge = 2e-6;  // of size: corners nearer to an edge than this lie on it
constexpr std::size_t kMostWork = 20'000'000;  // comparisons of a corner with an edge
// Pieces of a wall: more come of parts that overlap.
constexpr std::size_t kMostPieces = 2000, kPiecesPerFace = 10, kSomePieces = 200;

using Point = std::array<double, 2>;
using Planar = std::vector<Point>;  // anticlockwise, convex

double area_of(const Planar& p) {
  double twice = 0;
  for (std::size_t k = 1; k + 1 < p.size(); ++k)
    twice += (p[k][0] - p[0][0]) * (p[k + 1][1] - p[0][1]) -
             (p[k][1] - p[0][1]) * (p[k + 1][0] - p[0][0]);
  return 0.5 * twice;
}

/// What of a polygon lies to the left of the line from a to b.
Planar left_part(const Planar& p, const Point& a, const Point& b) {
  const auto side = [&](const Point& q) {
    return (b[0] - a[0]) * (q[1] - a[1]) - (b[1] - a[1]) * (q[0] - a[0]);
  };
  Planar out;
  for (std::size_t k = 0; k < p.size(); ++k) {
    const Point &from = p[k], &to = p[(k + 1) % p.size()];
    const double s = side(from), t = side(to);
    if (s >= 0) out.push_back(from);
    if ((s < 0) == (t < 0)) continue;
    const double part = s / (s - t);
    out.push_back({from[0] + part * (to[0] - from[0]), from[1] + part * (to[1] - from[1])});
  }
  return out;
}

Planar common_part(Planar p, const Planar& triangle) {
  for (std::size_t k = 0; k < 3 && !p.empty(); ++k)
    p = left_part(p, triangle[k], triangle[(k + 1) % 3]);
  return p;
}

/// Coordinates in the plane of a triangle.
struct PlaneFrame {
  Vector3 origin, u, v;

  PlaneFrame(const MeshShape& mesh, const std::array<int, 3>& t) : origin(place(mesh, t[0])) {
    u = unit(place(mesh, t[1]) - origin);
    v = cross(unit(cross(u, place(mesh, t[2]) - origin)), u);
  }
  [[nodiscard]] Point at(const Vector3& p) const {
    return {dot(p - origin, u), dot(p - origin, v)};
  }
  [[nodiscard]] Vector3 in_space(const Point& p) const { return origin + (p[0] * u + p[1] * v); }
  /// The triangle anticlockwise, and whether that is not how its corners run.
  [[nodiscard]] std::pair<Planar, bool> flat(const MeshShape& mesh,
                                             const std::array<int, 3>& t) const {
    Planar out;
    for (const int corner : t) out.push_back(at(place(mesh, corner)));
    const bool turned = area_of(out) < 0;
    if (turned) std::reverse(out.begin(), out.end());
    return {out, turned};
  }
};

class WallCutter {
 public:
  WallCutter(MeshShape& mesh, const Wall& wall, const std::vector<int>& same, double size)
      : mesh_(mesh),
        wall_(wall),
        same_(same),
        size_(size),
        most_(std::min(kMostPieces, kSomePieces + kPiecesPerFace * wall.faces.size())),
        frame_(mesh, largest()) {}

  bool cut(std::vector<std::array<int, 3>>& out) {
    const std::size_t before = mesh_.vertices.size();
    std::vector<Planar> flat;
    std::vector<char> turned;
    for (const std::array<int, 3>& f : wall_.faces) {
      auto [polygon, round] = frame_.flat(mesh_, f);
      flat.push_back(std::move(polygon));
      turned.push_back(static_cast<char>(round));
      for (const int v : f) keep(same_[std::size_t(v)], frame_.at(place(mesh_, v)));
      add_edges({same_[std::size_t(f[0])], same_[std::size_t(f[1])], same_[std::size_t(f[2])]}, 1);
    }
    std::vector<std::array<int, 3>> made;
    std::size_t pieces = 0;
    for (std::size_t f = 0; f < flat.size(); ++f) {
      std::vector<Planar> left = {flat[f]};
      for (const int other : wall_.opposite[f]) left = without(left, flat[std::size_t(other)]);
      pieces += left.size();
      if (pieces > most_) break;
      for (const Planar& p : left) add_piece(p, turned[f] != 0, made);
    }
    if (pieces > most_ || !close_edges(made)) {
      mesh_.vertices.resize(before);
      return false;
    }
    out.insert(out.end(), made.begin(), made.end());
    return true;
  }

 private:
  [[nodiscard]] const std::array<int, 3>& largest() const {
    const auto area = [&](const std::array<int, 3>& t) {
      const Vector3 a = place(mesh_, t[0]);
      const Vector3 n = cross(place(mesh_, t[1]) - a, place(mesh_, t[2]) - a);
      return dot(n, n);
    };
    return *std::max_element(wall_.faces.begin(), wall_.faces.end(),
                             [&](const auto& a, const auto& b) { return area(a) < area(b); });
  }

  [[nodiscard]] std::vector<Planar> without(const std::vector<Planar>& polygons,
                                            const Planar& triangle) const {
    const double tiny = kTiny * size_ * size_;
    std::vector<Planar> out;
    for (const Planar& p : polygons) {
      if (area_of(common_part(p, triangle)) <= tiny) {
        out.push_back(p);
        continue;
      }
      Planar rest = p;
      for (std::size_t k = 0; k < 3 && !rest.empty(); ++k) {
        const Point &a = triangle[k], &b = triangle[(k + 1) % 3];
        Planar outside = left_part(rest, b, a);
        if (area_of(outside) > tiny) out.push_back(std::move(outside));
        rest = left_part(rest, a, b);
      }
    }
    return out;
  }

  void keep(int vertex, const Point& at) {
    if (known_.emplace(vertex, at).second) order_.push_back(vertex);
  }
  /// The vertex in a place, or a new one.
  int vertex_at(const Point& at) {
    int nearest = -1;
    double least = kSnap * size_;
    for (const int v : order_) {
      const Point& p = known_.at(v);
      const double apart = std::hypot(p[0] - at[0], p[1] - at[1]);
      if (apart < least) least = apart, nearest = v;
    }
    if (nearest >= 0) return nearest;
    const auto fresh = static_cast<int>(mesh_.vertices.size() / 3);
    const Vector3 p = frame_.in_space(at);
    mesh_.vertices.insert(mesh_.vertices.end(), p.begin(), p.end());
    keep(fresh, at);
    return fresh;
  }

  void add_piece(const Planar& p, bool turned, std::vector<std::array<int, 3>>& made) {
    std::vector<int> corners;
    for (const Point& at : p) {
      const int v = vertex_at(at);
      if (corners.empty() || (corners.back() != v && corners.front() != v)) corners.push_back(v);
    }
    if (turned) std::reverse(corners.begin(), corners.end());
    for (std::size_t k = 1; k + 1 < corners.size(); ++k)
      add({corners[0], corners[k], corners[k + 1]}, made);
  }

  void add(const std::array<int, 3>& t, std::vector<std::array<int, 3>>& made) {
    made.push_back(t);
    add_edges(t, -1);
  }

  void add_edges(const std::array<int, 3>& t, int count) {
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3];
      if (a == b) continue;
      const auto at = surplus_.try_emplace(std::minmax(a, b), 0).first;
      at->second += a < b ? count : -count;
      if (at->second == 0) surplus_.erase(at);
    }
  }

  /// Adds triangles without area until every edge of the old faces is one of the new.
  bool close_edges(std::vector<std::array<int, 3>>& made) {
    std::size_t work = 0;
    while (!surplus_.empty() && made.size() <= 5 * most_) {
      bool changed = false;
      const std::map<Edge, int> open = surplus_;
      for (const auto& [edge, count] : open) {
        const auto now = surplus_.find(edge);
        if (now == surplus_.end()) continue;
        if ((work += open.size()) > kMostWork) return false;
        const int between = corner_on(edge, open);
        if (between < 0) continue;
        const bool forward = now->second > 0;
        for (int n = std::abs(now->second); n > 0; --n)
          add({forward ? edge.first : edge.second, forward ? edge.second : edge.first, between},
              made);
        changed = true;
      }
      if (!changed) return fill_gaps(made);
    }
    return surplus_.empty();
  }

  /// Fills what is still open, as where faces of one side overlap. A sum of faces in a plane whose
  /// edges cancel is none, so that new and old faces then enclose the same.
  bool fill_gaps(std::vector<std::array<int, 3>>& made) {
    while (!surplus_.empty()) {
      const auto& [edge, count] = *surplus_.begin();
      const int first = count > 0 ? edge.first : edge.second,
                second = count > 0 ? edge.second : edge.first, third = next_after(second);
      if (third < 0) return false;
      add({first, second, third}, made);
    }
    return true;
  }
  /// The end of an open edge that starts at a corner.
  [[nodiscard]] int next_after(int corner) const {
    for (const auto& [edge, count] : surplus_) {
      if (edge.first == corner && count > 0) return edge.second;
      if (edge.second == corner && count < 0) return edge.first;
    }
    return -1;
  }

  /// A corner of open edges that lies on an edge, between its ends; -1 if there is none.
  [[nodiscard]] int corner_on(const Edge& edge, const std::map<Edge, int>& open) const {
    const Point &a = known_.at(edge.first), &b = known_.at(edge.second);
    const Point along = {b[0] - a[0], b[1] - a[1]};
    const double length = std::hypot(along[0], along[1]);
    if (!(length > 0)) return -1;
    int found = -1;
    double least = HUGE_VAL;
    for (const auto& [other, count] : open)
      for (const int v : {other.first, other.second}) {
        const Point& p = known_.at(v);
        const Point way = {p[0] - a[0], p[1] - a[1]};
        const double s = (way[0] * along[0] + way[1] * along[1]) / length,
                     off = std::abs(way[0] * along[1] - way[1] * along[0]) / length;
        if (v == edge.first || v == edge.second || s <= 0 || s >= length || off > kOnEdge * size_)
          continue;
        // Parts are shorter than the edge, so that this ends.
        if (std::hypot(s, off) >= length || std::hypot(length - s, off) >= length) continue;
        if (s < least) least = s, found = v;
      }
    return found;
  }

  MeshShape& mesh_;
  const Wall& wall_;
  const std::vector<int>& same_;
  double size_;
  std::size_t most_;
  PlaneFrame frame_;
  std::map<int, Point> known_;   // vertices of the wall
  std::vector<int> order_;       // in which they came
  std::map<Edge, int> surplus_;  // of edges of the old faces over those of the new
};

}  // namespace

double common_area(const MeshShape& mesh, const std::array<int, 3>& a,
                   const std::array<int, 3>& b) {
  const PlaneFrame frame(mesh, a);
  return area_of(common_part(frame.flat(mesh, b).first, frame.flat(mesh, a).first));
}

bool cut_wall(MeshShape& mesh, const Wall& wall, const std::vector<int>& same, double size,
              std::vector<std::array<int, 3>>& out) {
  return WallCutter(mesh, wall, same, size).cut(out);
}

}  // namespace tangere
