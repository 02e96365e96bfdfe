// SPDX-License-Identifier: Apache-2.0
// Makes each layout in its own frame. scene_sensors.cpp puts it on its body.
#include "io/scene/tactile_layouts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/error.hpp"
#include "engine/scene/outer_pose.hpp"
#include "io/files/word_reader.hpp"

namespace tangere {
namespace {

constexpr int kMostInFile = 1 << 24;

TactilePoint point_at(const Vector3& position, const Vector3& normal, const Vector3& axis0) {
  TactilePoint p;
  p.position = position;
  p.normal = normal;
  p.axis0 = axis0;
  p.axis1 = cross(normal, axis0);
  return p;
}

/// Reads three numbers from the k-th on and normalises them.
Vector3 direction(const WordReader& file, std::size_t k, const char* what) {
  const Vector3 a = {file.number(k), file.number(k + 1), file.number(k + 2)};
  if (!(dot(a, a) > 0)) file.fail(fmt::format("{} has no length; expected a direction", what));
  return unit(a);
}

TactilePoint parse_point(const WordReader& file) {
  constexpr std::size_t kPlain = 14, kFactors = 18;
  const std::size_t count = file.words.size();
  if (count != kPlain && count != kFactors)
    file.fail(
        fmt::format("{} numbers; expected position (3), row and column (2), normal, axis0, axis1 "
                    "(3 each), and perhaps "
                    "factors of kn, kt, mu, damping (4)",
                    count));
  TactilePoint p;
  for (std::size_t k = 0; k < 3; ++k) p.position[k] = file.position(k);
  for (std::size_t k = 0; k < 2; ++k) {
    const long x = file.integer(file.words[3 + k], "a whole number, or -1 for no pixel");
    if (x < -1 || x > kMostInFile)
      file.fail(fmt::format("pixel {}; expected -1 to {}", x, kMostInFile));
    p.pixel[k] = static_cast<int>(x);
  }
  p.normal = direction(file, 5, "the normal");
  p.axis0 = direction(file, 8, "axis0");
  p.axis1 = direction(file, 11, "axis1");
  for (std::size_t k = kPlain; k < count; ++k) {
    p.factors[k - kPlain] = file.number(k);
    if (p.factors[k - kPlain] < 0)
      file.fail(fmt::format("factor {}; expected zero or more", p.factors[k - kPlain]));
  }
  return p;
}

/// Maps a direction with z ≥ 0 to its place in the square [-1, 1]². Rings about the pole become
/// square rings with the same share of the area. An eighth of a ring becomes one half of an edge.
std::array<double, 2> square_place(const Vector3& n) {
  const double ring = std::sqrt(std::max(0.0, 1 - n[2])), x = std::abs(n[0]), y = std::abs(n[1]);
  const double along = ring * std::atan2(std::min(x, y), std::max(x, y)) * 4 / M_PI;
  return {std::copysign(x >= y ? ring : along, n[0]), std::copysign(x >= y ? along : ring, n[1])};
}

}  // namespace

TactilePoint listed_point(const Vector3& position, const Vector3& normal, const Vector3& axis1) {
  return point_at(position, normal, cross(axis1, normal));
}

std::vector<TactilePoint> hemisphere_points(double radius, int count) {
  std::vector<TactilePoint> points;
  const double golden = M_PI * (3 - std::sqrt(5.0));
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (i + 0.5) / count, across = std::sqrt(1 - z * z), turn = golden * i;
    const double c = std::cos(turn), s = std::sin(turn);
    const Vector3 normal = {across * c, across * s, z};
    points.push_back(point_at(radius * normal, normal, {z * c, z * s, -across}));
  }
  return points;
}

void draw_hemisphere(int rows, int cols, std::vector<TactilePoint>& points) {
  std::vector<bool> taken(static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols));
  const auto at = [&](int i, int j) {
    return static_cast<std::size_t>(i) * static_cast<std::size_t>(cols) + j;
  };
  for (TactilePoint& p : points) {
    const auto [x, y] = square_place(p.normal);
    const double row = rows * (1 + x) / 2, col = cols * (1 + y) / 2;
    const int i0 = static_cast<int>(row), j0 = static_cast<int>(col);
    double nearest = INFINITY;
    // Pixels outside a window of ± reach are farther away than reach.
    for (int reach = 1; !(nearest < double(reach) * reach) && reach < 2 * std::max(rows, cols);
         reach *= 2)
      for (int i = std::max(0, i0 - reach); i <= std::min(rows - 1, i0 + reach); ++i)
        for (int j = std::max(0, j0 - reach); j <= std::min(cols - 1, j0 + reach); ++j) {
          const double away = std::pow(i + 0.5 - row, 2) + std::pow(j + 0.5 - col, 2);
          if (away < nearest && !taken[at(i, j)]) nearest = away, p.pixel = {i, j};
        }
    taken[at(p.pixel[0], p.pixel[1])] = true;
  }
}

std::vector<TactilePoint> cylinder_points(double radius, double length, int along, int around) {
  std::vector<TactilePoint> points;
  for (int i = 0; i < along; ++i)
    for (int j = 0; j < around; ++j) {
      const double z = along > 1 ? length * (double(i) / (along - 1) - 0.5) : 0,
                   turn = 2 * M_PI * j / around;
      const double c = std::cos(turn), s = std::sin(turn);
      points.push_back(point_at({radius * c, radius * s, z}, {c, s, 0}, {-s, c, 0}));
      points.back().pixel = {i, j};
    }
  return points;
}

std::vector<TactilePoint> mesh_points(const MeshShape& mesh, double pitch, std::size_t most) {
  std::vector<TactilePoint> points;
  const auto vertex = [&](int k) {
    const double* p = &mesh.vertices[3 * std::size_t(k)];
    return Vector3{p[0], p[1], p[2]};
  };
  for (const std::array<int, 3>& t : mesh.triangles) {
    const Vector3 a = vertex(t[0]), ab = vertex(t[1]) - a, ac = vertex(t[2]) - a, bc = ac - ab;
    const Vector3 area = cross(ab, ac);
    if (!(dot(area, area) > 0)) continue;  // a point without area has no force
    const double longest = std::sqrt(std::max({dot(ab, ab), dot(ac, ac), dot(bc, bc)})),
                 cuts = std::ceil(longest / pitch);
    if (cuts * cuts + double(points.size()) > double(most)) return {};
    const int n = static_cast<int>(cuts);
    const auto add = [&](double u, double v) {
      points.push_back(point_at(a + (u / (3 * n)) * ab + (v / (3 * n)) * ac, unit(area), unit(ab)));
    };
    for (int i = 0; i < n; ++i)
      for (int j = 0; i + j < n; ++j) {
        add(3 * i + 1, 3 * j + 1);
        if (i + j + 1 < n)
          add(3 * i + 2, 3 * j + 2);  // the small triangle with the opposite orientation
      }
  }
  return points;
}

std::vector<TactilePoint> read_tactile_points(const std::string& path) {
  WordReader file(path);
  if (!file.next()) throw InputError(path + ": empty; expected a count of points");
  const long count = file.integer(file.words[0], "a count of points");
  if (file.words.size() != 1 || count < 1 || count > kMostInFile)
    file.fail(fmt::format("the first line is no count of points from 1 to {}", kMostInFile));
  std::vector<TactilePoint> points;
  while (std::ssize(points) < count) {
    if (!file.next())
      file.fail(fmt::format("the file ends after {} of {} points", points.size(), count));
    points.push_back(parse_point(file));
  }
  if (file.next()) file.fail(fmt::format("more than the {} points announced", count));
  return points;
}

void move_points(const Pose& pose, std::vector<TactilePoint>& points) {
  for (TactilePoint& p : points) {
    p.position = outer_point(pose, p.position);
    for (Vector3* a : {&p.normal, &p.axis0, &p.axis1}) *a = outer_direction(pose, *a);
  }
}

}  // namespace tangere
