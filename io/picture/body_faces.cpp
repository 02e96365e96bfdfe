// SPDX-License-Identifier: Apache-2.0
// Round shapes are rings of quadrilaterals around z. The surface of a shape that has no form of its
// own is where rays from its middle leave it. A large mesh is thinned: vertices in one cell
// of a grid become one, their mean, and triangles that lose a corner are left out.
#include "io/picture/body_faces.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "engine/base/vector3.hpp"
#include "engine/scene/shapes.hpp"

namespace tangere {
namespace {

constexpr int kAround = 24, kRings = 6;  // of a quarter turn from pole to equator

/// A circle around z.
struct Ring {
  double z, radius;
};

/// Returns the faces between circles, from the lowest to the highest, and what closes them.
std::vector<Face> lathe(const std::vector<Ring>& rings) {
  const auto at = [](const Ring& r, int k) {
    const double angle = 2 * M_PI * k / kAround;
    return Vector3{r.radius * std::cos(angle), r.radius * std::sin(angle), r.z};
  };
  std::vector<Face> faces;
  for (std::size_t i = 0; i + 1 < rings.size(); ++i)
    for (int k = 0; k < kAround; ++k) {
      const Ring &a = rings[i], &b = rings[i + 1];
      Face face;
      face.push_back(at(a, k));
      if (a.radius > 0) face.push_back(at(a, k + 1));
      face.push_back(at(b, k + 1));
      if (b.radius > 0) face.push_back(at(b, k));
      faces.push_back(std::move(face));
    }
  Face below, above;
  for (int k = 0; k < kAround; ++k) {
    below.push_back(at(rings.front(), -k));
    above.push_back(at(rings.back(), k));
  }
  if (rings.front().radius > 0) faces.push_back(std::move(below));
  if (rings.back().radius > 0) faces.push_back(std::move(above));
  return faces;
}

/// A unit ball whose halves are moved apart.
std::vector<Face> ball(double radius, double half) {
  std::vector<Ring> rings;
  for (int k = -kRings; k <= kRings; ++k) {
    const double lift = 0.5 * M_PI * k / kRings;
    const double across = std::abs(k) == kRings ? 0 : radius * std::cos(lift);
    if (k == 0 && half > 0) rings.push_back({-half, across});
    rings.push_back({radius * std::sin(lift) + (k < 0 ? -half : half), across});
  }
  return lathe(rings);
}

std::vector<Face> box(const Vector3& half) {
  std::vector<Face> faces;
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (const double side : {-1.0, 1.0}) {
      const std::size_t u = (axis + 1) % 3, w = (axis + 2) % 3;
      Face face;
      for (const auto& [a, b] : {std::pair{-1.0, -1.0}, {1.0, -1.0}, {1.0, 1.0}, {-1.0, 1.0}}) {
        Vector3 corner{};
        corner[axis] = side * half[axis];
        corner[u] = side * a * half[u], corner[w] = b * half[w];
        face.push_back(corner);
      }
      faces.push_back(std::move(face));
    }
  return faces;
}

struct Surface {
  std::vector<Vector3> vertices;
  std::vector<std::array<int, 3>> triangles;
};

/// Joins the vertices in each cell of a grid with `cells` cells along the longest side.
Surface thinned(const Surface& s, int cells) {
  Vector3 low = s.vertices.at(0), high = low;
  for (const Vector3& v : s.vertices)
    for (std::size_t c = 0; c < 3; ++c)
      low[c] = std::min(low[c], v[c]), high[c] = std::max(high[c], v[c]);
  const double longest = std::max({high[0] - low[0], high[1] - low[1], high[2] - low[2]});
  std::map<std::array<int, 3>, int> cell_vertex;
  std::vector<int> becomes, count;
  Surface out;
  for (const Vector3& v : s.vertices) {
    std::array<int, 3> cell{};
    for (std::size_t c = 0; c < 3; ++c)
      cell[c] = static_cast<int>(std::floor((v[c] - low[c]) / longest * cells));
    const auto [found, fresh] = cell_vertex.emplace(cell, static_cast<int>(out.vertices.size()));
    if (fresh) out.vertices.push_back({0, 0, 0}), count.push_back(0);
    const auto k = static_cast<std::size_t>(found->second);
    out.vertices[k] = out.vertices[k] + v;
    ++count[k];
    becomes.push_back(found->second);
  }
  for (std::size_t k = 0; k < out.vertices.size(); ++k)
    out.vertices[k] = (1.0 / count[k]) * out.vertices[k];
  for (const auto& t : s.triangles) {
    const std::array<int, 3> u = {becomes[std::size_t(t[0])], becomes[std::size_t(t[1])],
                                  becomes[std::size_t(t[2])]};
    if (u[0] != u[1] && u[1] != u[2] && u[2] != u[0]) out.triangles.push_back(u);
  }
  return out;
}

/// Returns where a ray from the middle of a shape leaves it. `way`: on the unit ball, which is
/// stretched by the shape's widths.
Vector3 exit_of(const Shape& shape, const Vector3& way) {
  const Vector3 width = widths(shape);
  const Vector3 ray = {width[0] / 2 * way[0], width[1] / 2 * way[1], width[2] / 2 * way[2]};
  double inside = 0, outside = 2;  // the widths' corner is √3 away
  for (int k = 0; k < 60; ++k) {
    const double middle = (inside + outside) / 2;
    (distance_from(shape, middle * ray).value().distance < 0 ? inside : outside) = middle;
  }
  return outside * ray;
}

struct FacesOf {
  double half_space;
  std::size_t most;

  std::vector<Face> operator()(const SphereShape& s) const { return ball(s.radius, 0); }
  std::vector<Face> operator()(const CuboidShape& s) const { return box(0.5 * s.size); }
  std::vector<Face> operator()(const CylinderShape& s) const {
    return lathe({{-s.length / 2, s.radius}, {s.length / 2, s.radius}});
  }
  std::vector<Face> operator()(const CapsuleShape& s) const { return ball(s.radius, s.length / 2); }
  std::vector<Face> operator()(const auto& s) const {
    std::vector<Face> faces = ball(1, 0);
    for (Face& face : faces)
      for (Vector3& corner : face) corner = exit_of(s, corner);
    return faces;
  }
  std::vector<Face> operator()(const PlaneShape&) const {
    const double a = half_space;
    return {{{-a, -a, 0}, {a, -a, 0}, {a, a, 0}, {-a, a, 0}}};
  }
  std::vector<Face> operator()(const MeshShape& s) const {
    Surface surface;
    for (std::size_t k = 0; k < s.vertices.size(); k += 3)
      surface.vertices.push_back(s.scale *
                                 Vector3{s.vertices[k], s.vertices[k + 1], s.vertices[k + 2]});
    surface.triangles = s.triangles;
    for (int cells = 64; surface.triangles.size() > most && cells > 4; cells = cells * 3 / 4)
      surface = thinned(surface, cells);
    std::vector<Face> faces;
    for (const auto& [a, b, c] : surface.triangles)
      faces.push_back({surface.vertices[std::size_t(a)], surface.vertices[std::size_t(b)],
                       surface.vertices[std::size_t(c)]});
    return faces;
  }
  std::vector<Face> operator()(const AbstractShape&) const { return {}; }
};

}  // namespace

std::vector<Face> faces_of(const Shape& shape, double half_space, std::size_t most) {
  return std::visit(FacesOf{half_space, most}, shape);
}

RoundSurface round_surface_of(const Shape& shape) {
  constexpr int kSides = 48, kBands = 32;
  RoundSurface out;
  for (int k = 0; k <= kBands; ++k)
    for (int s = 0; s < kSides; ++s) {
      const double lift = M_PI * k / kBands, turn = 2 * M_PI * s / kSides;
      const Vector3 at = exit_of(shape, {std::sin(lift) * std::cos(turn),
                                         std::sin(lift) * std::sin(turn), -std::cos(lift)});
      out.vertices.push_back(at);
      out.normals.push_back(distance_from(shape, at).value().normal);
      if (k == kBands) continue;
      const int a = k * kSides + s, b = k * kSides + (s + 1) % kSides;
      out.triangles.push_back({a, b, a + kSides});
      out.triangles.push_back({a + kSides, b, b + kSides});
    }
  return out;
}

}  // namespace tangere
