// SPDX-License-Identifier: Apache-2.0
// Closed meshes of shapes whose distance is known.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere::testing {

/// An icosahedron whose triangles are halved `times` times, each vertex moved out to the unit
/// sphere and then to where `place` says.
inline MeshShape ball_mesh(int times, const std::function<Vector3(const Vector3&)>& place) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  std::vector<Vector3> v = {{-1, g, 0}, {1, g, 0}, {-1, -g, 0}, {1, -g, 0},
                            {0, -1, g}, {0, 1, g}, {0, -1, -g}, {0, 1, -g},
                            {g, 0, -1}, {g, 0, 1}, {-g, 0, -1}, {-g, 0, 1}};
  std::vector<std::array<int, 3>> t = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                       {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                       {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                       {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int n = 0; n < times; ++n) {
    std::map<std::pair<int, int>, int> middles;
    const auto middle = [&](int a, int b) {
      const auto [found, fresh] = middles.emplace(std::minmax(a, b), static_cast<int>(v.size()));
      if (fresh) {
        const Vector3 p = v[std::size_t(a)], q = v[std::size_t(b)];
        v.push_back({(p[0] + q[0]) / 2, (p[1] + q[1]) / 2, (p[2] + q[2]) / 2});
      }
      return found->second;
    };
    std::vector<std::array<int, 3>> halved;
    for (const auto& [a, b, c] : t) {
      const int ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      for (const std::array<int, 3>& part : {std::array{a, ab, ca}, std::array{b, bc, ab},
                                             std::array{c, ca, bc}, std::array{ab, bc, ca}})
        halved.push_back(part);
    }
    t = std::move(halved);
  }
  MeshShape mesh;
  mesh.triangles = std::move(t);
  for (const Vector3& p : v) {
    const double size = std::hypot(p[0], p[1], p[2]);
    const Vector3 at = place({p[0] / size, p[1] / size, p[2] / size});
    mesh.vertices.insert(mesh.vertices.end(), at.begin(), at.end());
  }
  return mesh;
}
inline MeshShape ellipsoid_mesh(int times, const Vector3& axes) {
  return ball_mesh(times, [&](const Vector3& p) {
    return Vector3{axes[0] * p[0], axes[1] * p[1], axes[2] * p[2]};
  });
}

inline MeshShape cuboid_mesh(const Vector3& half) {
  MeshShape mesh;
  for (int k = 0; k < 8; ++k)
    for (int c = 0; c < 3; ++c)
      mesh.vertices.push_back((k >> c & 1) != 0 ? half[std::size_t(c)] : -half[std::size_t(c)]);
  mesh.triangles = {{0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}};
  return mesh;
}

/// A closed strip of `around` × `along` quadrilaterals, whose corner (i, j) is at place(u, v), u
/// and v from 0 to 1. Both ways round it comes back to its start.
inline MeshShape torus_mesh(double ring, double tube, int around, int along) {
  MeshShape mesh;
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < along; ++j) {
      const double u = 2 * M_PI * i / around, v = 2 * M_PI * j / along;
      const double r = ring + tube * std::cos(v);
      mesh.vertices.insert(mesh.vertices.end(),
                           {r * std::cos(u), r * std::sin(u), tube * std::sin(v)});
    }
  const auto at = [&](int i, int j) { return i % around * along + j % along; };
  for (int i = 0; i < around; ++i)
    for (int j = 0; j < along; ++j) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

/// A capsule along z, of rings of `around` vertices.
inline MeshShape capsule_mesh(double radius, double half, int around) {
  MeshShape mesh;
  const int rings = around / 2;  // of both half balls
  const auto ring = [&](double z, double r) {
    for (int j = 0; j < around; ++j) {
      const double u = 2 * M_PI * j / around;
      mesh.vertices.insert(mesh.vertices.end(), {r * std::cos(u), r * std::sin(u), z});
    }
  };
  for (int k = 1; k < rings; ++k) {
    const double polar = M_PI * k / rings;  // from the lower pole
    const double z = -radius * std::cos(polar);
    if (2 * k == rings) {
      ring(-half, radius), ring(half, radius);
    } else {
      ring(z + (2 * k > rings ? half : -half), radius * std::sin(polar));
    }
  }
  const int all = static_cast<int>(mesh.vertices.size()) / (3 * around);
  const int low = all * around, high = low + 1;
  mesh.vertices.insert(mesh.vertices.end(), {0, 0, -half - radius, 0, 0, half + radius});
  for (int j = 0; j < around; ++j) {
    const int next = (j + 1) % around;
    mesh.triangles.push_back({low, next, j});
    mesh.triangles.push_back({high, (all - 1) * around + j, (all - 1) * around + next});
    for (int k = 0; k + 1 < all; ++k) {
      const int a = k * around + j, b = k * around + next;
      mesh.triangles.push_back({a, b, b + around});
      mesh.triangles.push_back({a, b + around, a + around});
    }
  }
  return mesh;
}

/// A body of revolution about z, from a profile (z, radius), anticlockwise in the plane (radius,
/// z). It is closed at both ends.
inline MeshShape turned_mesh(const std::vector<std::array<double, 2>>& profile, int around) {
  MeshShape mesh;
  for (const auto& [z, r] : profile)
    for (int j = 0; j < around; ++j)
      mesh.vertices.insert(mesh.vertices.end(), {r * std::cos(2 * M_PI * j / around),
                                                 r * std::sin(2 * M_PI * j / around), z});
  const int rings = static_cast<int>(profile.size()), low = rings * around, high = low + 1;
  mesh.vertices.insert(mesh.vertices.end(), {0, 0, profile.front()[0], 0, 0, profile.back()[0]});
  for (int j = 0; j < around; ++j) {
    const int next = (j + 1) % around;
    mesh.triangles.push_back({low, next, j});
    mesh.triangles.push_back({high, (rings - 1) * around + j, (rings - 1) * around + next});
    for (int k = 0; k + 1 < rings; ++k) {
      const int a = k * around + j, b = k * around + next;
      mesh.triangles.push_back({a, b, b + around});
      mesh.triangles.push_back({a, b + around, a + around});
    }
  }
  return mesh;
}

/// A plate with a square hole along z, by half widths.
inline MeshShape frame_mesh(double outer, double inner, double height) {
  MeshShape mesh;
  for (const double z : {-height, height})
    for (const double r : {outer, inner})
      for (const auto& [x, y] : {std::pair{-r, -r}, {r, -r}, {r, r}, {-r, r}})
        mesh.vertices.insert(mesh.vertices.end(), {x, y, z});
  const auto quad = [&](int a, int b, int c, int d) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({a, c, d});
  };
  for (int k = 0; k < 4; ++k) {  // 0 … 3 outer and 4 … 7 inner below, 8 … above
    const int n = (k + 1) % 4;
    quad(k, n, 8 + n, 8 + k);            // outside
    quad(4 + n, 4 + k, 12 + k, 12 + n);  // the hole
    quad(8 + k, 8 + n, 12 + n, 12 + k);  // above
    quad(n, k, 4 + k, 4 + n);            // below
  }
  return mesh;
}

/// Makes meshes of a scene's ellipsoids and spheres.
inline Scene with_meshes(Scene s) {
  for (LinkDescription& link : s.links) {
    MeshShape mesh;
    if (const auto* ball = std::get_if<SphereShape>(&link.body.shape)) {
      mesh = ellipsoid_mesh(1, {ball->radius, ball->radius, ball->radius});
    } else if (const auto* e = std::get_if<EllipsoidShape>(&link.body.shape)) {
      mesh = ellipsoid_mesh(1, {e->size[0] / 2, e->size[1] / 2, e->size[2] / 2});
    } else {
      continue;
    }
    mesh.resolution = 12;
    link.body.shape = mesh;
  }
  // Points of a body that was a ball touch now, too: contacts that were left out stay left out.
  return s;
}
/// Whether something touches a mesh.
inline bool has_mesh(const Scene& s) {
  return std::any_of(s.pair_contacts.begin(), s.pair_contacts.end(), [&](const auto& c) {
    return std::any_of(s.links.begin(), s.links.end(), [&](const LinkDescription& l) {
      return l.body.name == c.primitive_body && std::holds_alternative<MeshShape>(l.body.shape);
    });
  });
}

}  // namespace tangere::testing
