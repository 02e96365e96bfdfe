// SPDX-License-Identifier: Apache-2.0
// Volume integrals of meshes. Other shapes have closed forms in shapes.cpp.
#include "engine/scene/mass_properties.hpp"

namespace tangere {

/// Sums tetrahedra from the first vertex to every triangle, about that vertex. A body far from its
/// frame's origin thus loses no digits. With corners a, b, c and s = a + b + c:
///   volume = a·(b × c)/6, ∫x = volume (a + b + c)/4, ∫x xᵀ = volume (aaᵀ + bbᵀ + ccᵀ + ssᵀ)/20
MassProperties mesh_mass(const MeshShape& mesh, double density) {
  using kernels::Vec3;
  const auto vertex = [&](int k) {
    const double* p = &mesh.vertices[3 * std::size_t(k)];
    return Vec3<double>{p[0], p[1], p[2]};
  };
  const Vec3<double> origin = vertex(0);
  double volume = 0;
  Vec3<double> first = {0, 0, 0};
  kernels::Mat3<double> second = kernels::zero33<double>();
  for (const std::array<int, 3>& t : mesh.triangles) {
    const Vec3<double> a = vertex(t[0]) - origin, b = vertex(t[1]) - origin,
                       c = vertex(t[2]) - origin, s = a + b + c;
    const double part = dot(a, cross(b, c)) / 6;
    volume += part;
    first += (part / 4) * s;
    second += (part / 20) * (outer(a, a) + outer(b, b) + outer(c, c) + outer(s, s));
  }
  const Vec3<double> centre = (1 / volume) * first;
  second = density * (second - volume * outer(centre, centre));
  const double trace = second.m[0][0] + second.m[1][1] + second.m[2][2];
  return {density * volume, origin + centre, kernels::diagonal(trace) - second};
}

}  // namespace tangere
