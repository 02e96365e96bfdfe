// SPDX-License-Identifier: Apache-2.0
// Mass and inertia of bodies of uniform density, in closed form.
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

}  // namespace

MassProperties mass_properties(const Shape& shape, double density) {
  return std::visit([&](const auto& s) { return of(s, density); }, shape);
}

}  // namespace tangere
