// SPDX-License-Identifier: Apache-2.0
// A table of planes finds the triangles that face each other. Those that overlap, and what overlaps
// them in turn, are a wall.
#include "io/scene/inner_walls.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "io/scene/mesh_corners.hpp"
#include "io/scene/wall_cut.hpp"

namespace tangere {
namespace {

constexpr double kParallel = 1e-4;  // between the normals of a wall's two sides
constexpr double kCell = 1e-3;      // of the table of planes
constexpr double kWide = 1e-6;      // of the longest side: the widest gap that is still a wall
constexpr double kDeep = 2.5e-7;    // of the longest side: how far its sides may overlap
constexpr double kShare = 1e-6;     // of an area: less is rounding
constexpr std::size_t kMostPairs = 300000;
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
  Vector3 place;  // in the middle of the smaller
};

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

  [[nodiscard]] bool has_too_many() const { return facing_.size() >= kMostPairs; }

  /// Takes walls away. Returns whether there were any.
  bool remove() {
    if (facing_.empty()) return false;
    std::vector<int> ends;
    for (const Facing& f : facing_)
      for (const int face : {f.first, f.second})
        for (const int v : faces_[std::size_t(face)].corners) ends.push_back(v);
    std::sort(ends.begin(), ends.end());
    ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
    const std::vector<int> same = first_within(mesh_, ends, kWide * size_);
    std::vector<int> corner_of(same.size());
    std::iota(corner_of.begin(), corner_of.end(), 0);
    std::vector<char> gone(faces_.size());
    std::vector<std::array<int, 3>> made;
    for (const std::vector<int>& list : connected()) {
      if (!cut_wall(mesh_, wall_of(list), same, size_, made)) continue;
      for (const int f : list) {
        gone[std::size_t(f)] = 1;
        for (const int v : faces_[std::size_t(f)].corners)
          corner_of[std::size_t(v)] = same[std::size_t(v)];
      }
    }
    for (std::size_t f = 0; f < faces_.size(); ++f)
      if (gone[f] == 0) made.push_back(faces_[f].corners);
    mesh_.triangles = std::move(made);
    for (std::size_t v = corner_of.size(); v < mesh_.vertices.size() / 3; ++v)
      corner_of.push_back(static_cast<int>(v));
    mesh_ = with_corners(mesh_, corner_of);
    return true;
  }

  /// Of both sides of all walls.
  [[nodiscard]] double area() const {
    double sum = 0;
    for (const Facing& f : facing_) sum += 2 * f.area;
    return sum;
  }

  [[nodiscard]] std::string fault() const {
    if (!(area() > kLeastWall * whole_)) return "";
    const Facing& largest =
        *std::max_element(facing_.begin(), facing_.end(),
                          [](const Facing& a, const Facing& b) { return a.area < b.area; });
    return fmt::format(
        "{:.2g} % of the area are walls inside the solid, as at {}, where closed parts lie flush "
        "on each other and overlap; expected one surface around all parts (unite them), or "
        "hull=\"true\" for their convex hull",
        100 * area() / whole_, place_text(largest.place));
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
    std::map<Key, std::vector<int>> back;  // faces whose normal points away, by plane
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
    if (has_too_many()) return;
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
    if (nearest < -kDeep * size_ || farthest > kWide * size_) return;
    const double common = common_area(mesh_, large.corners, small.corners);
    if (common > kShare * small.area) facing_.push_back({f, other, common, middle});
  }

  /// Faces that are connected by pairs: one list for each wall.
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

  [[nodiscard]] Wall wall_of(const std::vector<int>& list) const {
    Wall wall;
    for (const int f : list) wall.faces.push_back(faces_[std::size_t(f)].corners);
    wall.opposite.resize(list.size());
    const auto at = [&](int f) {
      return std::lower_bound(list.begin(), list.end(), f) - list.begin();
    };
    for (const Facing& f : facing_) {
      if (!std::binary_search(list.begin(), list.end(), f.first)) continue;
      wall.opposite[std::size_t(at(f.first))].push_back(static_cast<int>(at(f.second)));
      wall.opposite[std::size_t(at(f.second))].push_back(static_cast<int>(at(f.first)));
    }
    return wall;
  }

  MeshShape& mesh_;
  double size_, whole_ = 0;  // longest side, area
  Vector3 middle_{};
  std::vector<Face> faces_;
  std::vector<Facing> facing_;
};

}  // namespace

std::string remove_walls(MeshShape& mesh) {
  // Parts that overlap may leave walls among the pieces: cut again as long as that helps.
  for (double before = HUGE_VAL;;) {
    Walls walls(mesh);
    if (walls.has_too_many())
      return fmt::format(
          "{} or more pairs of triangles face each other in one place; expected a "
          "surface around a solid",
          kMostPairs);
    const double area = walls.area();
    if (area > 0.9 * before) return walls.fault();
    if (!walls.remove()) return "";
    before = area;
  }
}

}  // namespace tangere
