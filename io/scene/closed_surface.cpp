// SPDX-License-Identifier: Apache-2.0
// Corners are one where their places are, or where they differ by rounding and only that keeps the
// surface open.
#include "io/scene/closed_surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace tangere {
namespace {

constexpr double kRounding = 1e-8;    // of the longest side: corners nearer than this are one
constexpr double kNearlyMeet = 1e-3;  // of the longest side: gaps that a message names

using Edge = std::pair<int, int>;

Vector3 place(const MeshShape& mesh, int v) {
  const double* const p = &mesh.vertices[3 * std::size_t(v)];
  return {p[0], p[1], p[2]};
}

std::string place_text(const Vector3& p) {
  return fmt::format("({:g} {:g} {:g})", p[0], p[1], p[2]);
}

double distance(const Vector3& a, const Vector3& b) {
  const Vector3 way = a - b;
  return std::sqrt(dot(way, way));
}

double longest_side(const MeshShape& mesh) {
  double longest = 0;
  for (std::size_t c = 0; c < 3 && !mesh.vertices.empty(); ++c) {
    double low = mesh.vertices[c], high = low;
    for (std::size_t k = c; k < mesh.vertices.size(); k += 3) {
      low = std::min(low, mesh.vertices[k]);
      high = std::max(high, mesh.vertices[k]);
    }
    longest = std::max(longest, high - low);
  }
  return longest;
}

/// Edges that run more often in one direction than in the other.
std::vector<Edge> open_edges(const MeshShape& mesh) {
  std::map<Edge, int> surplus;
  for (const std::array<int, 3>& t : mesh.triangles)
    for (std::size_t k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3];
      surplus[std::minmax(a, b)] += a < b ? 1 : -1;
    }
  std::vector<Edge> open;
  for (const auto& [edge, count] : surplus)
    if (count != 0) open.push_back(edge);
  return open;
}

std::vector<int> ends_of(const std::vector<Edge>& edges) {
  std::vector<int> ends;
  for (const Edge& e : edges) ends.insert(ends.end(), {e.first, e.second});
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  return ends;
}

/// For each vertex itself, or the first of those given that lies within `reach` of it.
std::vector<int> first_within(const MeshShape& mesh, const std::vector<int>& vertices,
                              double reach) {
  std::vector<int> first(mesh.vertices.size() / 3);
  std::iota(first.begin(), first.end(), 0);
  if (!(reach > 0)) return first;
  std::multimap<Vector3, int> firsts;  // by cell of the length `reach`
  for (const int v : vertices) {
    const Vector3 at = place(mesh, v);
    const auto find = [&] {
      for (int n = 0; n < 27; ++n) {
        Vector3 cell{};
        for (std::size_t c = 0; c < 3; ++c)
          cell[c] = std::floor(at[c] / reach) + (n / (c == 0 ? 1 : c == 1 ? 3 : 9)) % 3 - 1;
        const auto [from, to] = firsts.equal_range(cell);
        for (auto other = from; other != to; ++other)
          if (distance(place(mesh, other->second), at) <= reach) return other->second;
      }
      return v;
    };
    const int known = first[std::size_t(v)] = find();
    if (known != v) continue;
    Vector3 cell{};
    for (std::size_t c = 0; c < 3; ++c) cell[c] = std::floor(at[c] / reach);
    firsts.emplace(cell, v);
  }
  return first;
}

/// Gives triangles other corners, and leaves out those without an area and vertices without a
/// triangle.
MeshShape with_corners(const MeshShape& mesh, const std::vector<int>& corner_of) {
  MeshShape out;
  std::map<int, int> index;
  for (std::array<int, 3> t : mesh.triangles) {
    for (int& v : t) v = corner_of[std::size_t(v)];
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
    for (int& v : t) {
      const auto [found, fresh] = index.emplace(v, static_cast<int>(index.size()));
      if (fresh) {
        const Vector3 p = place(mesh, v);
        out.vertices.insert(out.vertices.end(), p.begin(), p.end());
      }
      v = found->second;
    }
    out.triangles.push_back(t);
  }
  return out;
}

/// " The nearest corners …" of open edges that do not share an edge, if they nearly meet.
std::string gap_text(const MeshShape& mesh, const std::vector<Edge>& open) {
  const std::vector<int> ends = ends_of(open);
  std::vector<int> by_x = ends;
  std::sort(by_x.begin(), by_x.end(), [&](int a, int b) {
    return mesh.vertices[3 * std::size_t(a)] < mesh.vertices[3 * std::size_t(b)];
  });
  const double size = longest_side(mesh);
  double least = kNearlyMeet * size;
  Edge nearest{-1, -1};
  for (std::size_t i = 0; i < by_x.size(); ++i)
    for (std::size_t j = i + 1; j < by_x.size(); ++j) {
      const Vector3 a = place(mesh, by_x[i]), b = place(mesh, by_x[j]);
      if (b[0] - a[0] >= least) break;
      const Edge pair = std::minmax(by_x[i], by_x[j]);
      const double apart = distance(a, b);
      if (apart >= least || std::binary_search(open.begin(), open.end(), pair)) continue;
      least = apart;
      nearest = pair;
    }
  if (nearest.first < 0) return "";
  return fmt::format(
      "; the corners {} and {} at open edges are {:.2g} apart, {:.2g} of the "
      "longest side, and up to {:g} of it counts as rounding",
      place_text(place(mesh, nearest.first)), place_text(place(mesh, nearest.second)), least,
      least / size, kRounding);
}

}  // namespace

MeshShape weld(const RawMesh& raw) {
  MeshShape mesh;
  std::map<Vector3, int> index;
  for (const std::array<int, 3>& t : raw.triangles) {
    std::array<int, 3> welded{};
    for (std::size_t k = 0; k < 3; ++k) {
      Vector3 at = raw.positions[std::size_t(t[k])];
      for (double& x : at) x += 0.0;  // -0 and +0 are the same position
      const auto [found, fresh] = index.emplace(at, static_cast<int>(index.size()));
      if (fresh) mesh.vertices.insert(mesh.vertices.end(), at.begin(), at.end());
      welded[k] = found->second;
    }
    if (welded[0] != welded[1] && welded[1] != welded[2] && welded[2] != welded[0])
      mesh.triangles.push_back(welded);
  }
  const std::vector<Edge> open = open_edges(mesh);
  if (open.empty()) return mesh;
  MeshShape closed =
      with_corners(mesh, first_within(mesh, ends_of(open), kRounding * longest_side(mesh)));
  return open_edges(closed).empty() ? closed : mesh;
}

std::string open_edge(const MeshShape& mesh) {
  const std::vector<Edge> open = open_edges(mesh);
  if (open.empty()) return "";
  return fmt::format(
      "the surface is open, or its faces disagree on what is outside, at the edge from {} to {}{}; "
      "expected a closed surface",
      place_text(place(mesh, open.front().first)), place_text(place(mesh, open.front().second)),
      gap_text(mesh, open));
}

namespace {

// --- walls ---

constexpr double kParallel = 1e-4;   // between the normals of a wall's two sides
constexpr double kCell = 1e-3;       // of the table of planes
constexpr double kWide = 1e-6;       // of the longest side: the widest gap that is still a wall
constexpr double kShare = 1e-6;      // of an area: less is rounding
constexpr double kLeastWall = 1e-4;  // of the area of all: less is no fault

struct Face {
  std::array<int, 3> corners;
  Vector3 normal;       // of length 1
  double area, offset;  // offset: of its plane from the middle of the mesh
};

/// Two triangles that face each other in one plane.
struct Facing {
  int first, second;
  double area;    // common to both
  bool touches;   // no gap but rounding
  Vector3 place;  // in the middle of the smaller
};

using Planar = std::vector<std::array<double, 2>>;

double area_of(const Planar& p) {
  double twice = 0;
  for (std::size_t k = 1; k + 1 < p.size(); ++k)
    twice += (p[k][0] - p[0][0]) * (p[k + 1][1] - p[0][1]) -
             (p[k][1] - p[0][1]) * (p[k + 1][0] - p[0][0]);
  return 0.5 * twice;
}

/// Cuts off what lies to the right of the line from a to b.
Planar left_part(const Planar& p, const std::array<double, 2>& a, const std::array<double, 2>& b) {
  const auto side = [&](const std::array<double, 2>& q) {
    return (b[0] - a[0]) * (q[1] - a[1]) - (b[1] - a[1]) * (q[0] - a[0]);
  };
  Planar out;
  for (std::size_t k = 0; k < p.size(); ++k) {
    const std::array<double, 2>&from = p[k], &to = p[(k + 1) % p.size()];
    const double s = side(from), t = side(to);
    if (s >= 0) out.push_back(from);
    if ((s < 0) == (t < 0)) continue;
    const double part = s / (s - t);
    out.push_back({from[0] + part * (to[0] - from[0]), from[1] + part * (to[1] - from[1])});
  }
  return out;
}

/// The pairs of triangles that face each other, found by a table of planes.
class Walls {
 public:
  explicit Walls(MeshShape& mesh) : mesh_(mesh), size_(longest_side(mesh)) {
    for (std::size_t k = 0; k < mesh.vertices.size(); k += 3)
      for (std::size_t c = 0; c < 3; ++c)
        middle_[c] += mesh.vertices[k + c] * 3 / static_cast<double>(mesh.vertices.size());
    for (const std::array<int, 3>& t : mesh.triangles) {
      const Vector3 a = place(mesh, t[0]);
      Vector3 normal = cross(place(mesh, t[1]) - a, place(mesh, t[2]) - a);
      const double twice = std::sqrt(dot(normal, normal));
      if (twice > 0) normal = (1 / twice) * normal;
      faces_.push_back({t, normal, 0.5 * twice, dot(normal, a - middle_) / size_});
      whole_ += 0.5 * twice;
    }
    find();
  }

  /// Takes walls away whose two sides are the same.
  void remove() {
    if (facing_.empty()) return;
    std::vector<int> ends;
    for (const Facing& f : facing_)
      for (const int face : {f.first, f.second})
        for (const int v : faces_[std::size_t(face)].corners) ends.push_back(v);
    std::sort(ends.begin(), ends.end());
    ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
    same_ = first_within(mesh_, ends, kRounding * size_);
    std::vector<int> corner_of(mesh_.vertices.size() / 3);
    std::iota(corner_of.begin(), corner_of.end(), 0);
    std::vector<char> gone(faces_.size());
    for (const std::vector<int>& wall : connected()) {
      if (!is_closed(wall)) continue;
      for (const int f : wall) {
        gone[std::size_t(f)] = 1;
        for (const int v : faces_[std::size_t(f)].corners)
          corner_of[std::size_t(v)] = same_[std::size_t(v)];
      }
    }
    facing_.erase(std::remove_if(facing_.begin(), facing_.end(),
                                 [&](const Facing& f) { return gone[std::size_t(f.first)] != 0; }),
                  facing_.end());
    if (std::find(gone.begin(), gone.end(), 1) == gone.end()) return;
    std::vector<std::array<int, 3>> kept;
    for (std::size_t f = 0; f < faces_.size(); ++f)
      if (gone[f] == 0) kept.push_back(faces_[f].corners);
    mesh_.triangles = std::move(kept);
    mesh_ = with_corners(mesh_, corner_of);
  }

  [[nodiscard]] std::string fault() const {
    double area = 0;
    for (const Facing& f : facing_) area += 2 * f.area;
    if (!(area > kLeastWall * whole_)) return "";
    const Facing& largest =
        *std::max_element(facing_.begin(), facing_.end(),
                          [](const Facing& a, const Facing& b) { return a.area < b.area; });
    return fmt::format(
        "{:.2g} % of the area are walls inside the solid, as at {}, where closed parts lie flush "
        "on each other in part; expected one surface around all parts (unite them), or "
        "hull=\"true\" for their convex hull",
        100 * area / whole_, place_text(largest.place));
  }

 private:
  using Key = std::array<int, 4>;

  /// The plane of a face, seen from the side that is the same for both directions of a normal.
  [[nodiscard]] static bool is_front(const Face& face) {
    return dot(face.normal, {0.6180339887, 0.3141592653, 0.7182818284}) > 0;
  }
  [[nodiscard]] std::array<double, 4> plane(const Face& f) const {
    const double sign = is_front(f) ? 1 : -1;
    return {sign * f.normal[0], sign * f.normal[1], sign * f.normal[2], sign * f.offset};
  }
  static int cell(double x) { return static_cast<int>(std::floor(x / kCell)); }

  void find() {
    if (!(whole_ > 0)) return;
    std::map<Key, std::vector<int>> back;  // faces whose normal looks away, by plane
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      const std::array<double, 4> p = plane(faces_[f]);
      if (faces_[f].area > 0 && !is_front(faces_[f]))
        back[{cell(p[0]), cell(p[1]), cell(p[2]), cell(p[3])}].push_back(static_cast<int>(f));
    }
    for (auto& [key, list] : back) {
      const std::size_t axis = axis_of(key);
      std::sort(list.begin(), list.end(),
                [&](int a, int b) { return range(a, axis).first < range(b, axis).first; });
    }
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      if (!(faces_[f].area > 0) || !is_front(faces_[f])) continue;
      const std::array<double, 4> p = plane(faces_[f]);
      Key low{}, high{}, at{};
      for (std::size_t c = 0; c < 4; ++c) {
        low[c] = cell(p[c] - kParallel - kWide);
        high[c] = cell(p[c] + kParallel + kWide);
      }
      for (at[0] = low[0]; at[0] <= high[0]; ++at[0])
        for (at[1] = low[1]; at[1] <= high[1]; ++at[1])
          for (at[2] = low[2]; at[2] <= high[2]; ++at[2])
            for (at[3] = low[3]; at[3] <= high[3]; ++at[3])
              if (const auto found = back.find(at); found != back.end())
                meet(static_cast<int>(f), found->second, axis_of(at));
    }
  }

  /// The axis along which a plane is widest, about.
  static std::size_t axis_of(const Key& plane) {
    std::size_t axis = 0;
    for (std::size_t c = 1; c < 3; ++c)
      if (std::abs(plane[c]) < std::abs(plane[axis])) axis = c;
    return axis;
  }
  [[nodiscard]] std::pair<double, double> range(int f, std::size_t axis) const {
    const auto x = [&](std::size_t k) {
      return mesh_.vertices[3 * std::size_t(faces_[std::size_t(f)].corners[k]) + axis];
    };
    return std::minmax({x(0), x(1), x(2)});
  }

  void meet(int f, const std::vector<int>& others, std::size_t axis) {
    const auto [low, high] = range(f, axis);
    for (const int other : others) {
      const auto [from, to] = range(other, axis);
      if (from > high) break;
      if (to >= low) add_pair(f, other);
    }
  }

  void add_pair(int f, int other) {
    const Face &a = faces_[std::size_t(f)], &b = faces_[std::size_t(other)];
    if (dot(a.normal, b.normal) > -1 + kParallel * kParallel) return;
    const Face &small = a.area < b.area ? a : b, &large = a.area < b.area ? b : a;
    double nearest = HUGE_VAL, farthest = -HUGE_VAL;  // in front of the larger one
    Vector3 middle{};
    for (const int v : small.corners) {
      const Vector3 p = place(mesh_, v);
      const double gap = dot(large.normal, p - place(mesh_, large.corners[0]));
      nearest = std::min(nearest, gap);
      farthest = std::max(farthest, gap);
      middle = middle + (1.0 / 3) * p;
    }
    if (nearest < -kRounding * size_ || farthest > kWide * size_) return;
    const double common = common_area(large, small);
    if (common > kShare * small.area)
      facing_.push_back({f, other, common, farthest <= kRounding * size_, middle});
  }

  [[nodiscard]] double common_area(const Face& a, const Face& b) const {
    const Vector3 origin = place(mesh_, a.corners[0]);
    const Vector3 u = unit(place(mesh_, a.corners[1]) - origin), v = cross(a.normal, u);
    const auto flat = [&](const Face& f) {
      Planar out;
      for (const int corner : f.corners) {
        const Vector3 p = place(mesh_, corner) - origin;
        out.push_back({dot(p, u), dot(p, v)});
      }
      return out;
    };
    const Planar first = flat(a);
    Planar common = flat(b);
    std::reverse(common.begin(), common.end());
    for (std::size_t k = 0; k < 3 && !common.empty(); ++k)
      common = left_part(common, first[k], first[(k + 1) % 3]);
    return area_of(common);
  }

  /// Faces that are connected by pairs which touch: one list for each wall.
  [[nodiscard]] std::vector<std::vector<int>> connected() const {
    std::map<int, int> root;
    const auto find_root = [&](int f) {
      root.emplace(f, f);
      while (root[f] != f) f = root[f] = root[root[f]];
      return f;
    };
    for (const Facing& f : facing_) {
      const int a = find_root(f.first), b = find_root(f.second);
      root[std::max(a, b)] = std::min(a, b);
    }
    std::map<int, std::vector<int>> lists;
    for (const auto& [f, up] : root) lists[find_root(f)].push_back(f);
    std::vector<std::vector<int>> out;
    for (auto& [first, list] : lists) out.push_back(std::move(list));
    return out;
  }

  /// Whether the two sides of a wall cover the same place, so that the rest stays closed without
  /// them.
  [[nodiscard]] bool is_closed(const std::vector<int>& wall) const {
    double front = 0, back = 0, common = 0;
    std::map<Edge, int> surplus;
    for (const int f : wall) {
      const Face& face = faces_[std::size_t(f)];
      (is_front(face) ? front : back) += face.area;
      for (std::size_t k = 0; k < 3; ++k) {
        const int a = same_[std::size_t(face.corners[k])],
                  b = same_[std::size_t(face.corners[(k + 1) % 3])];
        if (a != b) surplus[std::minmax(a, b)] += a < b ? 1 : -1;
      }
    }
    for (const Facing& f : facing_)
      if (std::binary_search(wall.begin(), wall.end(), f.first)) {
        if (!f.touches) return false;
        common += f.area;
      }
    const auto equal = [](double x, double y) { return std::abs(x - y) <= kShare * y; };
    return equal(front, back) && equal(common, back) &&
           std::all_of(surplus.begin(), surplus.end(), [](const auto& e) { return e.second == 0; });
  }

  MeshShape& mesh_;
  double size_, whole_ = 0;  // longest side, area
  Vector3 middle_{};
  std::vector<Face> faces_;
  std::vector<Facing> facing_;
  std::vector<int> same_;  // by vertex: the first in the same place
};

}  // namespace

std::string remove_walls(MeshShape& mesh) {
  Walls walls(mesh);
  walls.remove();
  return walls.fault();
}

}  // namespace tangere
