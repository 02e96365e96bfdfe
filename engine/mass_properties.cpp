// SPDX-License-Identifier: Apache-2.0
// Mass and inertia of bodies of uniform density: closed forms, and volume integrals of meshes; what kernels call their size.
#include <algorithm>
#include <cmath>

#include "engine/compiled_model.hpp"

namespace tangere {

namespace {

MassProperties principal(double mass, double xx, double yy, double zz) {
  return {mass, {0, 0, 0}, {{{xx, 0, 0}, {0, yy, 0}, {0, 0, zz}}}};
}

MassProperties of(const SphereShape& s, double density) {
  const double mass = density * 4.0 / 3.0 * M_PI * s.radius * s.radius * s.radius;
  const double inertia = 0.4 * mass * s.radius * s.radius;
  return principal(mass, inertia, inertia, inertia);
}

MassProperties of(const CuboidShape& c, double density) {
  const Vector3& s = c.size;
  const double mass = density * s[0] * s[1] * s[2];
  return principal(mass, mass / 12 * (s[1] * s[1] + s[2] * s[2]), mass / 12 * (s[0] * s[0] + s[2] * s[2]),
                   mass / 12 * (s[0] * s[0] + s[1] * s[1]));
}

MassProperties of(const CylinderShape& c, double density) {
  const double square = c.radius * c.radius, mass = density * M_PI * square * c.length;
  const double across = mass / 12 * (3 * square + c.length * c.length);
  return principal(mass, across, across, mass / 2 * square);
}

/// A cylinder and two half balls, each with its centre of mass 3 r/8 beyond the cylinder's end.
MassProperties of(const CapsuleShape& c, double density) {
  const double r = c.radius, l = c.length;
  const double tube = density * M_PI * r * r * l, ball = density * 4.0 / 3.0 * M_PI * r * r * r;
  const double across =
      tube * (l * l / 12 + r * r / 4) + ball * (0.4 * r * r + l * l / 4 + 0.375 * l * r);
  return principal(tube + ball, across, across, tube * r * r / 2 + 0.4 * ball * r * r);
}

MassProperties of(const PlaneShape&, double) { return principal(0, 0, 0, 0); }

/// Tetrahedra from the first vertex to every triangle, about that vertex: far from its frame's origin a body loses nothing.
/// With corners a, b, c: volume = a·(b × c)/6, ∫x = volume (a + b + c)/4,
/// ∫x xᵀ = volume (aaᵀ + bbᵀ + ccᵀ + ssᵀ)/20, s = a + b + c.
MassProperties of(const MeshShape& mesh, double density) {
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
    const Vec3<double> a = vertex(t[0]) - origin, b = vertex(t[1]) - origin, c = vertex(t[2]) - origin, s = a + b + c;
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

MassProperties of(const AbstractShape& a, double) {
  const std::array<double, 6>& i = a.inertia;
  return {a.mass, {0, 0, 0}, {{{i[0], i[1], i[2]}, {i[1], i[3], i[4]}, {i[2], i[4], i[5]}}}};
}

}  // namespace

MassProperties mass_properties(const Shape& shape, double density) {
  return std::visit([&](const auto& s) { return of(s, density); }, shape);
}

void place_shape(const Shape& shape, CompiledBody& body) {
  if (const auto* sphere = std::get_if<SphereShape>(&shape)) {
    body.shape = PrimitiveShape::sphere;
    body.size = {sphere->radius, 0, 0};
  } else if (const auto* cuboid = std::get_if<CuboidShape>(&shape)) {
    body.shape = PrimitiveShape::cuboid;
    body.size = {0.5 * cuboid->size[0], 0.5 * cuboid->size[1], 0.5 * cuboid->size[2]};
  } else if (const auto* cylinder = std::get_if<CylinderShape>(&shape)) {
    body.shape = PrimitiveShape::cylinder;
    body.size = {cylinder->radius, 0.5 * cylinder->length, 0};
  } else if (const auto* capsule = std::get_if<CapsuleShape>(&shape)) {
    body.shape = PrimitiveShape::capsule;
    body.size = {capsule->radius, 0.5 * capsule->length, 0};
  } else if (std::holds_alternative<PlaneShape>(shape)) {
    body.shape = PrimitiveShape::plane;
  } else {
    body.touchable = false;
    const std::vector<double> p = contact_points(shape);
    for (std::size_t k = 0; k < p.size(); k += 3)
      body.size.x = std::max(body.size.x, std::hypot(p[k], p[k + 1], p[k + 2]));
  }
}

void add_inertia(kernels::Link& link, const CompiledBody& body, const MassProperties& properties) {
  const kernels::Mat3<double>& R = body.frame.R;
  const kernels::Vec3<double> centre = R * properties.centre + body.frame.p;
  const kernels::Mat3<double> p = kernels::skew(centre);
  link.massive = true;
  link.mass += body.mass;
  link.moment += body.mass * centre;
  link.inertia += R * properties.inertia * kernels::transpose(R) - body.mass * (p * p);
}

}  // namespace tangere
