// SPDX-License-Identifier: Apache-2.0
// Corners are one where their places are, or where they differ by rounding and only that keeps the
// surface open.
#include "io/scene/closed_surface.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "io/scene/mesh_corners.hpp"

namespace tangere {
namespace {

constexpr double kNearlyMeet = 1e-3;  // of the longest side: gaps that a message names

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

/// " The nearest corners …" of open edges that do not share an edge, if they nearly meet.
std::string gap_text(const MeshShape& mesh, const std::vector<Edge>& open) {
  const std::vector<int> ends = ends_of(open);
  std::vector<int> ends_along_x = ends;
  std::sort(ends_along_x.begin(), ends_along_x.end(), [&](int a, int b) {
    return mesh.vertices[3 * std::size_t(a)] < mesh.vertices[3 * std::size_t(b)];
  });
  const double size = longest_side(mesh);
  double least = kNearlyMeet * size;
  Edge nearest{-1, -1};
  for (std::size_t i = 0; i < ends_along_x.size(); ++i)
    for (std::size_t j = i + 1; j < ends_along_x.size(); ++j) {
      const Vector3 a = place(mesh, ends_along_x[i]), b = place(mesh, ends_along_x[j]);
      if (b[0] - a[0] >= least) break;
      const Edge pair = std::minmax(ends_along_x[i], ends_along_x[j]);
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
  return with_corners(mesh, first_within(mesh, ends_of(open), kRounding * longest_side(mesh)));
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

}  // namespace tangere
