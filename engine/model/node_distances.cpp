// SPDX-License-Identifier: Apache-2.0
// The distance d to a triangle is a convex function of the place. With its gradient g at c,
//   d(c + s) ≥ d(c) + g·s
// The nodes are halved along all axes into blocks, and these again. Each block has the triangles
// that may be nearest to one of its nodes, with d and g at its middle c. With T the nearest
// triangle to c, D and G its distance and gradient there, and |s| ≤ ρ in the block,
//   d_T(c + s) ≤ D + G·s + ρ²/(2 (D - ρ)) if ρ < D, and d_T(c + s) ≤ D + ρ
// A gradient at a distance far below ρ is not accurate enough for that: both count as zero there.
// A triangle whose bound is above one of these in the whole block is left out. A part of the block
// starts from the bounds of the whole, and computes the distances of few triangles anew.
#include "engine/model/node_distances.hpp"

#include <algorithm>
#include <cmath>

#include "kernels/numbers/linalg.hpp"

namespace tangere {

using kernels::Vec3;

namespace {

struct Corners {
  Vec3<double> a, b, c;
};

/// Returns the vector from p to the nearest place of a triangle. It is a corner, on an edge, or
/// inside, as the signs of six products say.
Vec3<double> to_triangle(const Vec3<double>& p, const Corners& t) {
  const Vec3<double> ab = t.b - t.a, ac = t.c - t.a, ap = p - t.a;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return t.a - p;
  const Vec3<double> bp = p - t.b;
  const double d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return t.b - p;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return t.a + (d1 / (d1 - d3)) * ab - p;
  const Vec3<double> cp = p - t.c;
  const double d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return t.c - p;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return t.a + (d2 / (d2 - d6)) * ac - p;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    return t.b + ((d4 - d3) / ((d4 - d3) + (d5 - d6))) * (t.c - t.b) - p;
  const double whole = va + vb + vc;
  return t.a + (vb / whole) * ab + (vc / whole) * ac - p;
}

/// A triangle's distance and its gradient at the middle of a block.
struct Candidate {
  double d;
  Vec3<double> g;
  int triangle;
};

struct NodeBlock {
  int first[3], count[3];  ///< nodes

  /// The distance from the middle to a corner [m].
  [[nodiscard]] double radius(double cell) const {
    double square = 0;
    for (const int n : count) square += (n - 1) * (n - 1);
    return 0.5 * cell * std::sqrt(square);
  }
  [[nodiscard]] Vec3<double> middle(const GridNodes& nodes) const {
    const auto along = [&](int k) {
      return nodes.origin[k] + (first[k] + 0.5 * (count[k] - 1)) * nodes.cell;
    };
    return {along(0), along(1), along(2)};
  }
};

/// Distances at a block's middle below this part of its radius count as zero, with gradient zero.
constexpr double kTouching = 1e-4;

/// Leaves out triangles that are nearest to no node of a block.
class BlockFilter {
 public:
  /// `nearest`: a triangle at the block's middle. `margin`: far above rounding [m].
  BlockFilter(const NodeBlock& block, double cell, const Candidate& nearest, double margin)
      : gradient_(nearest.g) {
    double* half = &half_.x;
    for (int k = 0; k < 3; ++k) half[k] = 0.5 * (block.count[k] - 1) * cell;
    const double radius = block.radius(cell), square = radius * radius;
    most_ = nearest.d + (1 + kTouching) * radius + margin;
    most_beside_ =
        nearest.d + margin + (nearest.d > radius ? square / (2 * (nearest.d - radius)) : HUGE_VAL);
  }
  /// Whether a triangle of distance d and gradient g, or of a lower bound d + g·s, may be nearest.
  [[nodiscard]] bool keeps(double d, const Vec3<double>& g) const {
    return d - spread(g) <= most_ && d - spread(g - gradient_) <= most_beside_;
  }

 private:
  /// Returns the largest g·s in the block.
  [[nodiscard]] double spread(const Vec3<double>& g) const {
    return std::abs(g.x) * half_.x + std::abs(g.y) * half_.y + std::abs(g.z) * half_.z;
  }

  Vec3<double> half_, gradient_;
  double most_, most_beside_;
};

class NodeDistances {
 public:
  NodeDistances(std::span<const double> vertices, std::span<const std::array<int, 3>> triangles,
                const GridNodes& nodes)
      : nodes_(nodes), out_(nodes.all(), HUGE_VAL) {
    double largest = 0;
    for (int k = 0; k < 3; ++k)
      for (const int i : {0, nodes.count[k] - 1})
        largest = std::max(largest, std::abs(nodes.place(k, i)));
    for (const double x : vertices) largest = std::max(largest, std::abs(x));
    margin_ = 1e-11 * largest;
    const auto vertex = [&](int k) {
      const double* p = &vertices[3 * std::size_t(k)];
      return Vec3<double>{p[0], p[1], p[2]};
    };
    for (const std::array<int, 3>& t : triangles)
      triangles_.push_back({vertex(t[0]), vertex(t[1]), vertex(t[2])});
  }

  std::vector<double> compute() {
    const NodeBlock all = {{0, 0, 0}, {nodes_.count[0], nodes_.count[1], nodes_.count[2]}};
    const Vec3<double> middle = all.middle(nodes_);
    std::vector<Candidate> list;
    for (std::size_t t = 0; t < triangles_.size(); ++t)
      add(middle, all.radius(nodes_.cell), static_cast<int>(t), list);
    for_each_part(all, [&](const NodeBlock& part) { fill(part, list, middle, 0); });
    return std::move(out_);
  }

 private:
  /// Calls f for the parts of a block that is halved along every axis, at most eight.
  template <class F>
  static void for_each_part(const NodeBlock& block, const F& f) {
    for (int part = 0; part < 8; ++part) {
      NodeBlock half;
      bool some = true;
      for (int k = 0; k < 3; ++k) {
        const int low = (block.count[k] + 1) / 2, upper = part >> k & 1;
        half.first[k] = block.first[k] + upper * low;
        half.count[k] = upper == 0 ? low : block.count[k] - low;
        some = some && half.count[k] > 0;
      }
      if (some) f(half);
    }
  }

  /// Appends a triangle with its distance and gradient at the middle c of a block. One that has no
  /// nearest place is left out: its edges belong to its neighbours as well.
  void add(const Vec3<double>& c, double radius, int triangle, std::vector<Candidate>& list) const {
    const Vec3<double> way = to_triangle(c, triangles_[std::size_t(triangle)]);
    const double d = std::sqrt(dot(way, way));
    if (!(d >= 0)) return;
    if (d > std::max(margin_, kTouching * radius))
      list.push_back({d, (-1 / d) * way, triangle});
    else
      list.push_back({0, {0, 0, 0}, triangle});
  }

  /// `list`: triangles that may be nearest, with their numbers at the place `from`.
  void fill(const NodeBlock& block, const std::vector<Candidate>& list, const Vec3<double>& from,
            std::size_t depth) {
    if (list.empty()) return;
    const Vec3<double> c = block.middle(nodes_), step = c - from;
    std::size_t first = 0;  // that of the lowest bound, probably the nearest
    bounds_.resize(std::max(bounds_.size(), list.size()));
    for (std::size_t n = 0; n < list.size(); ++n) {
      bounds_[n] = list[n].d + dot(list[n].g, step);
      if (bounds_[n] < bounds_[first]) first = n;
    }
    if (block.count[0] * block.count[1] * block.count[2] == 1)
      return set_node(block, list, c, first);
    if (lists_.size() <= depth) lists_.resize(depth + 1);
    std::vector<Candidate> own = std::move(lists_[depth]);  // keeps its memory
    own.clear();
    const double radius = block.radius(nodes_.cell);
    add(c, radius, list[first].triangle, own);
    const Candidate far = {HUGE_VAL, {0, 0, 0}, 0};
    const BlockFilter filter(block, nodes_.cell, own.empty() ? far : own[0], margin_);
    for (std::size_t n = 0; n < list.size(); ++n)
      if (n != first && filter.keeps(bounds_[n], list[n].g)) {
        const std::size_t before = own.size();
        add(c, radius, list[n].triangle, own);
        if (own.size() > before && !filter.keeps(own.back().d, own.back().g)) own.pop_back();
      }
    for_each_part(block, [&](const NodeBlock& part) { fill(part, own, c, depth + 1); });
    lists_[depth] = std::move(own);
  }

  /// Computes the distance of the only node of a block, which is at `at`. `first`: the triangle of
  /// the lowest bound in the list.
  void set_node(const NodeBlock& block, const std::vector<Candidate>& list, const Vec3<double>& at,
                std::size_t first) {
    const auto square = [&](std::size_t n) {
      const Vec3<double> way = to_triangle(at, triangles_[std::size_t(list[n].triangle)]);
      return dot(way, way);
    };
    double best = square(first);
    if (!(best >= 0)) best = HUGE_VAL;
    double distance = std::sqrt(best);
    for (std::size_t n = 0; n < list.size(); ++n) {
      if (n == first || bounds_[n] > distance + margin_) continue;
      if (const double other = square(n); other < best) best = other, distance = std::sqrt(best);
    }
    out_[nodes_.at(block.first[0], block.first[1], block.first[2])] = distance;
  }

  const GridNodes& nodes_;
  std::vector<Corners> triangles_;
  std::vector<double> out_, bounds_;
  std::vector<std::vector<Candidate>> lists_;  // of each depth
  double margin_ = 0;                          // far above the rounding of distances and bounds [m]
};

}  // namespace

std::vector<double> node_distances(std::span<const double> vertices,
                                   std::span<const std::array<int, 3>> triangles,
                                   const GridNodes& nodes) {
  return NodeDistances(vertices, triangles, nodes).compute();
}

}  // namespace tangere
