// SPDX-License-Identifier: Apache-2.0
// A triangle's nearest place is a corner, on an edge, or inside, as the signs of six products say.
#include "engine/model/triangle_tree.hpp"

#include <algorithm>
#include <cmath>

namespace tangere {

using kernels::Vec3;

namespace {

constexpr int kLeaf = 4;  // triangles

/// Returns the vector from p to the nearest place of a triangle.
template <class Corners>
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

double component(const Vec3<double>& v, int k) { return k == 0 ? v.x : k == 1 ? v.y : v.z; }

}  // namespace

TriangleTree::TriangleTree(std::span<const double> vertices,
                           std::span<const std::array<int, 3>> triangles) {
  const auto vertex = [&](int k) {
    const double* p = &vertices[3 * std::size_t(k)];
    return Vec3<double>{p[0], p[1], p[2]};
  };
  for (const std::array<int, 3>& t : triangles)
    triangles_.push_back({vertex(t[0]), vertex(t[1]), vertex(t[2])});
  nodes_.reserve(triangles_.size() + 2);
  nodes_.emplace_back();
  split(0, triangles_, 0);
}

/// Halves the triangles across the longest side of the box around their middles.
void TriangleTree::split(int node, std::span<Corners> all, int first) {
  Box box, middles;
  for (int k = 0; k < 3; ++k) {
    box.low[k] = middles.low[k] = HUGE_VAL;
    box.high[k] = middles.high[k] = -HUGE_VAL;
  }
  const auto middle = [](const Corners& t, int k) {
    return component(t.a, k) + component(t.b, k) + component(t.c, k);
  };
  for (const Corners& t : all)
    for (int k = 0; k < 3; ++k) {
      for (const Vec3<double>* v : {&t.a, &t.b, &t.c}) {
        box.low[k] = std::min(box.low[k], component(*v, k));
        box.high[k] = std::max(box.high[k], component(*v, k));
      }
      middles.low[k] = std::min(middles.low[k], middle(t, k));
      middles.high[k] = std::max(middles.high[k], middle(t, k));
    }
  Node& here = nodes_[std::size_t(node)];
  here.box = box;
  here.first = first;
  here.count = static_cast<int>(all.size());
  if (here.count <= kLeaf) return;
  int side = 0;
  for (int k = 1; k < 3; ++k)
    if (middles.high[k] - middles.low[k] > middles.high[side] - middles.low[side]) side = k;
  const std::size_t half = all.size() / 2;
  std::nth_element(
      all.begin(), all.begin() + std::ptrdiff_t(half), all.end(),
      [&](const Corners& a, const Corners& b) { return middle(a, side) < middle(b, side); });
  const int left = static_cast<int>(nodes_.size());
  here.first = left;
  here.count = 0;
  nodes_.resize(nodes_.size() + 2);
  split(left, all.first(half), first);
  split(left + 1, all.subspan(half), first + static_cast<int>(half));
}

double TriangleTree::squared_distance(const Vec3<double>& at, int& nearest) const {
  const auto to_box = [&](const Box& box) {
    double square = 0;
    for (int k = 0; k < 3; ++k) {
      const double x = component(at, k), beyond = std::max({box.low[k] - x, x - box.high[k], 0.0});
      square += beyond * beyond;
    }
    return square;
  };
  struct Pending {
    double square;
    int node;
  };
  std::array<Pending, 64> stack;  // halves of halves: less than 64 levels
  int pending = 0;
  stack[0] = {to_box(nodes_[0].box), 0};
  const auto to = [&](int k) {
    const Vec3<double> way = to_triangle(at, triangles_[std::size_t(k)]);
    return dot(way, way);
  };
  double best = to(nearest);
  if (!(best >= 0)) best = HUGE_VAL;  // a triangle without area may have no nearest place
  for (pending = 1; pending > 0;) {
    const Pending next = stack[std::size_t(--pending)];
    if (next.square >= best) continue;
    const Node& node = nodes_[std::size_t(next.node)];
    if (node.count > 0) {
      for (int k = node.first; k < node.first + node.count; ++k) {
        const double square = to(k);
        if (square < best) best = square, nearest = k;
      }
      continue;
    }
    const double left = to_box(nodes_[std::size_t(node.first)].box),
                 right = to_box(nodes_[std::size_t(node.first) + 1].box);
    const bool swapped = right < left;  // visit the nearer one first
    stack[std::size_t(pending++)] = {std::max(left, right), node.first + (swapped ? 0 : 1)};
    stack[std::size_t(pending++)] = {std::min(left, right), node.first + (swapped ? 1 : 0)};
  }
  return best;
}

}  // namespace tangere
