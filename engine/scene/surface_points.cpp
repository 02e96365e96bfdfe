// SPDX-License-Identifier: Apache-2.0
// Midpoint rules over the surfaces of shapes.
#include "engine/scene/surface_points.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/base/vector3.hpp"
#include "engine/scene/frames.hpp"

namespace tangere {

namespace {

constexpr double kPi = std::numbers::pi;
/// Share of a turn between neighbouring rings or points of a spiral: the golden section, by which
/// no two of them come to lie at the same angle.
constexpr double kGolden = 0.61803398874989485;
constexpr int kLeastAround = 12;  // points around an axis
constexpr int kLeastOnBall = 64;  // points of an ellipsoid

/// An interval of a line.
struct Cell {
  double low, high;
  [[nodiscard]] double middle() const { return 0.5 * (low + high); }
  [[nodiscard]] double width() const { return high - low; }
};

int cells_along(double length, double pitch, int least) {
  return std::max(least, static_cast<int>(std::ceil(length / pitch - 1e-9)));
}

/// Splits [low, high] into equal cells. The last cell is split into a half and two quarters.
std::vector<Cell> cells_to_rim(double low, double high, double pitch) {
  const int n = cells_along(high - low, pitch, 1);
  const double p = (high - low) / n;
  std::vector<Cell> cells;
  for (int k = 0; k + 1 < n; ++k) cells.push_back({low + k * p, low + (k + 1) * p});
  for (const double from : {1.0, 0.5, 0.25})
    cells.push_back({high - from * p, from == 0.25 ? high : high - 0.5 * from * p});
  return cells;
}

/// The same between two rims, from -length/2 to length/2.
std::vector<Cell> cells_between_rims(double length, double pitch) {
  const double half = 0.5 * length;
  const int n = cells_along(length, pitch, 2);
  const double middle = n % 2 == 0 ? 0 : 0.5 * length / n;
  std::vector<Cell> upper;
  if (middle < half) upper = cells_to_rim(middle, half, length / n);
  std::vector<Cell> cells;
  for (auto c = upper.rbegin(); c != upper.rend(); ++c) cells.push_back({-c->high, -c->low});
  if (middle > 0) cells.push_back({-middle, middle});
  cells.insert(cells.end(), upper.begin(), upper.end());
  return cells;
}

void add(SurfacePoints& to, const Vector3& at, double area) {
  to.places.insert(to.places.end(), at.begin(), at.end());
  to.areas.push_back(area);
}

/// Adds `count` points around z that share an area. Ring `number` is turned against the others.
void add_ring(SurfacePoints& to, int count, int number, double radius, double z, double area) {
  for (int k = 0; k < count; ++k) {
    const double angle = 2 * kPi * (k + number * kGolden) / count;
    add(to, {radius * std::cos(angle), radius * std::sin(angle), z}, area / count);
  }
}
int around(double radius, double pitch, int least) {
  return cells_along(2 * kPi * radius, pitch, least);
}

/// The side of a cylinder.
void add_tube(SurfacePoints& to, double radius, const std::vector<Cell>& cells, double pitch) {
  const int count = around(radius, pitch, kLeastAround);
  int ring = 0;
  for (const Cell& c : cells)
    add_ring(to, count, ring++, radius, c.middle(), 2 * kPi * radius * c.width());
}

SurfacePoints points_of(const CuboidShape& shape, double pitch, double) {
  SurfacePoints out;
  std::array<std::vector<Cell>, 3> cells;
  for (std::size_t k = 0; k < 3; ++k) cells[k] = cells_between_rims(shape.size[k], pitch);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t i = (axis + 1) % 3, j = (axis + 2) % 3;
    for (const double side : {-0.5, 0.5})
      for (const Cell& a : cells[i])
        for (const Cell& b : cells[j]) {
          Vector3 at{};
          at[axis] = side * shape.size[axis];
          at[i] = a.middle(), at[j] = b.middle();
          add(out, at, a.width() * b.width());
        }
  }
  return out;
}

SurfacePoints points_of(const CylinderShape& shape, double pitch, double along) {
  SurfacePoints out;
  add_tube(out, shape.radius, cells_between_rims(shape.length, along), pitch);
  for (const double side : {-0.5, 0.5}) {
    int ring = 0;
    for (const Cell& c : cells_to_rim(0, shape.radius, pitch)) {
      // The mean distance of a ring's area from the axis.
      const double r =
          2.0 / 3 * (c.low * c.low + c.low * c.high + c.high * c.high) / (c.low + c.high);
      add_ring(out, around(r, pitch, 6), ring++, r, side * shape.length,
               kPi * (c.high * c.high - c.low * c.low));
    }
  }
  return out;
}

SurfacePoints points_of(const CapsuleShape& shape, double pitch, double along) {
  SurfacePoints out;
  std::vector<Cell> cells;
  const int n = cells_along(shape.length, along, 1);
  for (int k = 0; k < n; ++k)
    cells.push_back({shape.length * (double(k) / n - 0.5), shape.length * ((k + 1.0) / n - 0.5)});
  add_tube(out, shape.radius, cells, pitch);
  // Bands of a half ball; the area between two heights is 2πr times the height.
  const double r = shape.radius;
  const int bands = cells_along(0.5 * kPi * r, pitch, 3);
  for (const double side : {-1.0, 1.0})
    for (int k = 0; k < bands; ++k) {
      const double low = r * std::sin(0.5 * kPi * k / bands),
                   high = r * std::sin(0.5 * kPi * (k + 1) / bands), z = 0.5 * (low + high),
                   across = std::sqrt(std::max(r * r - z * z, 0.0));
      add_ring(out, around(across, pitch, 3), n + k, across, side * (0.5 * shape.length + z),
               2 * kPi * r * (high - low));
    }
  return out;
}

/// A spiral on the unit ball, stretched. Each point stands for an equal part of the ball, which
/// grows by the ratio of areas b c |x|, a c |y|, a b |z|.
SurfacePoints on_ellipsoid(const Vector3& half, double pitch) {
  const Vector3 grown = {half[1] * half[2], half[0] * half[2], half[0] * half[1]};
  const double most = *std::max_element(grown.begin(), grown.end());
  const int count =
      std::max(kLeastOnBall, static_cast<int>(std::ceil(4 * kPi * most / (pitch * pitch))));
  SurfacePoints out;
  for (int k = 0; k < count; ++k) {
    const double z = 1 - (2 * k + 1.0) / count, across = std::sqrt(1 - z * z),
                 angle = 2 * kPi * kGolden * k;
    const Vector3 u = {across * std::cos(angle), across * std::sin(angle), z};
    const double ratio = std::hypot(grown[0] * u[0], grown[1] * u[1], grown[2] * u[2]);
    add(out, {half[0] * u[0], half[1] * u[1], half[2] * u[2]}, 4 * kPi / count * ratio);
  }
  return out;
}
SurfacePoints points_of(const EllipsoidShape& shape, double pitch, double) {
  return on_ellipsoid(0.5 * Vector3{shape.size[0], shape.size[1], shape.size[2]}, pitch);
}
SurfacePoints points_of(const SphereShape& shape, double pitch, double) {
  return on_ellipsoid({shape.radius, shape.radius, shape.radius}, pitch);
}

double triangle_area(const std::array<Vector3, 3>& t) {
  const Vector3 across = cross(t[1] - t[0], t[2] - t[0]);
  return 0.5 * std::sqrt(dot(across, across));
}

struct Triangle {
  std::array<Vector3, 3> corners;
  std::array<bool, 3> sharp;  ///< corners of the solid
};

/// Halves a triangle across its longest edge until no edge is longer than `most`, and at sharp
/// corners a quarter of it.
void add_triangle(SurfacePoints& to, const Triangle& triangle, double most) {
  const std::array<Vector3, 3>& t = triangle.corners;
  const std::array<bool, 3>& sharp = triangle.sharp;
  const bool corner = sharp[0] || sharp[1] || sharp[2];
  std::size_t longest = 0;
  double square = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Vector3 edge = t[(k + 1) % 3] - t[k];
    if (dot(edge, edge) > square) square = dot(edge, edge), longest = k;
  }
  if (square <= most * most * (corner ? 1.0 / 16 : 1)) {
    const Vector3 middle = (1.0 / 3) * (t[0] + t[1] + t[2]);
    if (const double area = triangle_area(t); area > 0) add(to, middle, area);
    return;
  }
  const std::size_t i = longest, j = (longest + 1) % 3, k = (longest + 2) % 3;
  const Vector3 between = 0.5 * (t[i] + t[j]);
  add_triangle(to, {{t[i], between, t[k]}, {sharp[i], false, sharp[k]}}, most);
  add_triangle(to, {{between, t[j], t[k]}, {false, sharp[j], sharp[k]}}, most);
}

std::array<Vector3, 3> corners_of(const MeshShape& mesh, const std::array<int, 3>& triangle) {
  std::array<Vector3, 3> t;
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t c = 0; c < 3; ++c)
      t[k][c] = mesh.scale * mesh.vertices[3 * std::size_t(triangle[k]) + c];
  return t;
}

/// Returns the vertices at which faces meet at more than 40°.
std::vector<bool> sharp_vertices(const MeshShape& mesh) {
  constexpr double kSmooth = 0.77;  // cosine between a face and the mean of those at a vertex
  std::vector<Vector3> sum(mesh.vertices.size() / 3, Vector3{0, 0, 0});
  const auto normal = [&](const std::array<int, 3>& triangle) {
    const std::array<Vector3, 3> t = corners_of(mesh, triangle);
    const Vector3 n = cross(t[1] - t[0], t[2] - t[0]);
    const double size = std::sqrt(dot(n, n));
    return size > 0 ? (1 / size) * n : n;
  };
  for (const std::array<int, 3>& t : mesh.triangles)
    for (const int v : t) sum[std::size_t(v)] = sum[std::size_t(v)] + normal(t);
  std::vector<bool> sharp(sum.size());
  for (const std::array<int, 3>& t : mesh.triangles) {
    const Vector3 n = normal(t);
    for (const int v : t) {
      const Vector3& mean = sum[std::size_t(v)];
      if (dot(n, n) > 0 && dot(n, mean) < kSmooth * std::sqrt(dot(mean, mean)))
        sharp[std::size_t(v)] = true;
    }
  }
  return sharp;
}

/// Halved triangles have edges of 0.7 to 1.4 times their mean.
SurfacePoints points_of(const MeshShape& mesh, double pitch, double) {
  SurfacePoints out;
  const std::vector<bool> sharp = sharp_vertices(mesh);
  const auto is_sharp = [&](int v) { return bool(sharp[std::size_t(v)]); };
  for (const std::array<int, 3>& t : mesh.triangles)
    add_triangle(out, {corners_of(mesh, t), {is_sharp(t[0]), is_sharp(t[1]), is_sharp(t[2])}},
                 std::sqrt(2.0) * pitch);
  return out;
}

}  // namespace

bool has_surface(const Shape& shape) {
  return std::visit(
      [](const auto& s) {
        return requires { points_of(s, 1.0, 1.0); };
      },
      shape);
}

SurfacePoints surface_points(const Shape& shape, double pitch, double along) {
  return std::visit(
      [&](const auto& s) {
        if constexpr (requires { points_of(s, pitch, along); }) {
          return points_of(s, pitch, along);
        } else {
          return SurfacePoints{};
        }
      },
      shape);
}

double expected_points(const Shape& shape, double pitch, double along) {
  constexpr double kRims = 4;  // more cells between two rims
  const auto cells = [](double length, double p) { return std::max(2.0, length / p) + kRims; };
  const auto disc = [&](double r) {
    return kPi * r * r / (pitch * pitch) + 3 * 2 * kPi * r / pitch;
  };
  if (const auto* const s = std::get_if<CuboidShape>(&shape)) {
    const double x = cells(s->size[0], pitch), y = cells(s->size[1], pitch),
                 z = cells(s->size[2], pitch);
    return 2 * (x * y + y * z + x * z);
  }
  if (const auto* const s = std::get_if<CylinderShape>(&shape))
    return (2 * kPi * s->radius / pitch + kLeastAround) * cells(s->length, along) +
           2 * disc(s->radius);
  if (const auto* const s = std::get_if<CapsuleShape>(&shape))
    return (2 * kPi * s->radius / pitch + kLeastAround) * (s->length / along + 1) +
           4 * kPi * s->radius * s->radius / (pitch * pitch);
  if (const auto* const s = std::get_if<EllipsoidShape>(&shape)) {
    const double x = s->size[0], y = s->size[1], z = s->size[2];
    return kLeastOnBall + kPi * std::max({x * y, y * z, x * z}) / (pitch * pitch);
  }
  if (const auto* const mesh = std::get_if<MeshShape>(&shape))
    return double(mesh->triangles.size()) + 1.5 * surface_area(shape) / (pitch * pitch);
  return kLeastOnBall + surface_area(shape) / (pitch * pitch);
}

double surface_area(const Shape& shape) {
  double area = 0;
  if (const auto* const mesh = std::get_if<MeshShape>(&shape)) {
    for (const std::array<int, 3>& t : mesh->triangles) area += triangle_area(corners_of(*mesh, t));
    return area;
  }
  for (const double a : surface_points(shape, HUGE_VAL, HUGE_VAL).areas) area += a;
  return area;
}

}  // namespace tangere
