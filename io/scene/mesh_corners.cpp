// SPDX-License-Identifier: Apache-2.0
// Cells as wide as the reach keep the search for equal corners linear.
#include "io/scene/mesh_corners.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

namespace tangere {

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

}  // namespace tangere
