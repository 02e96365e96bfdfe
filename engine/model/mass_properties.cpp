// SPDX-License-Identifier: Apache-2.0
// Mass and inertia of bodies of uniform density: closed forms, and volume integrals of meshes; what
// kernels call their size.
#include <algorithm>
#include <cmath>

#include "engine/model/compiled_model.hpp"
#include "kernels/numbers/dual.hpp"

namespace tangere {

namespace {

/// Mass and principal inertia, over any number type.
template <class T>
struct Principal {
  T mass, xx, yy, zz;
};

template <class T>
Principal<T> of_ball(double density, const T& r) {
  const T mass = density * 4.0 / 3.0 * M_PI * r * r * r, inertia = 0.4 * mass * r * r;
  return {mass, inertia, inertia, inertia};
}

template <class T>
Principal<T> of_cuboid(double density, const T& x, const T& y, const T& z) {
  const T mass = density * x * y * z;
  return {mass, mass / 12 * (y * y + z * z), mass / 12 * (x * x + z * z),
          mass / 12 * (x * x + y * y)};
}

template <class T>
Principal<T> of_cylinder(double density, const T& r, const T& l) {
  const T square = r * r, mass = density * M_PI * square * l;
  const T across = mass / 12 * (3 * square + l * l);
  return {mass, across, across, mass / 2 * square};
}

/// A cylinder and two half balls, each with its centre of mass 3 r/8 beyond the cylinder's end.
template <class T>
Principal<T> of_capsule(double density, const T& r, const T& l) {
  const T tube = density * M_PI * r * r * l, ball = density * 4.0 / 3.0 * M_PI * r * r * r;
  const T across =
      tube * (l * l / 12 + r * r / 4) + ball * (0.4 * r * r + l * l / 4 + 0.375 * l * r);
  return {tube + ball, across, across, tube * r * r / 2 + 0.4 * ball * r * r};
}

MassProperties centred(const Principal<double>& p) {
  return {p.mass, {0, 0, 0}, {{{p.xx, 0, 0}, {0, p.yy, 0}, {0, 0, p.zz}}}};
}

MassProperties of(const SphereShape& s, double density) {
  return centred(of_ball(density, s.radius));
}
MassProperties of(const CuboidShape& c, double density) {
  return centred(of_cuboid(density, c.size[0], c.size[1], c.size[2]));
}
MassProperties of(const CylinderShape& c, double density) {
  return centred(of_cylinder(density, c.radius, c.length));
}
MassProperties of(const CapsuleShape& c, double density) {
  return centred(of_capsule(density, c.radius, c.length));
}
MassProperties of(const PlaneShape&, double) { return centred({0, 0, 0, 0}); }

/// Tetrahedra from the first vertex to every triangle, about that vertex: far from its frame's
/// origin a body loses nothing. With corners a, b, c: volume = a·(b × c)/6, ∫x = volume (a + b +
/// c)/4, ∫x xᵀ = volume (aaᵀ + bbᵀ + ccᵀ + ssᵀ)/20, s = a + b + c.
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

MassProperties of(const AbstractShape& a, double) {
  const std::array<double, 6>& i = a.inertia;
  return {a.mass, {0, 0, 0}, {{{i[0], i[1], i[2]}, {i[1], i[3], i[4]}, {i[2], i[4], i[5]}}}};
}

}  // namespace

MassProperties mass_properties(const Shape& shape, double density) {
  return std::visit([&](const auto& s) { return of(s, density); }, shape);
}

MassProperties mass_properties_by_size(const Shape& shape, double density, int which) {
  using D = kernels::Dual<double>;
  const auto number = [which](double x, int k) { return D(x, k == which ? 1 : 0); };
  const auto slope = [](const Principal<D>& p) {
    return centred({p.mass.epsilon, p.xx.epsilon, p.yy.epsilon, p.zz.epsilon});
  };
  if (const auto* s = std::get_if<SphereShape>(&shape))
    return slope(of_ball(density, number(s->radius, 0)));
  if (const auto* c = std::get_if<CuboidShape>(&shape))
    return slope(
        of_cuboid(density, number(c->size[0], 2), number(c->size[1], 3), number(c->size[2], 4)));
  if (const auto* c = std::get_if<CylinderShape>(&shape))
    return slope(of_cylinder(density, number(c->radius, 0), number(c->length, 1)));
  const auto& c = std::get<CapsuleShape>(shape);
  return slope(of_capsule(density, number(c.radius, 0), number(c.length, 1)));
}

InertiaRows inertia_rows(const kernels::Link& link) {
  const auto& I = link.inertia.m;
  return {link.mass, link.moment.x, link.moment.y, link.moment.z, I[0][0],
          I[0][1],   I[0][2],       I[1][1],       I[1][2],       I[2][2]};
}
InertiaRows inertia_rows(const CompiledBody& body, const MassProperties& properties) {
  kernels::Link link{};
  CompiledBody of_these = body;
  of_these.mass = properties.mass;
  add_inertia(link, of_these, properties);
  return inertia_rows(link);
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
