// SPDX-License-Identifier: Apache-2.0
// With R the body's orientation, I its inertia and ω its angular velocity:
//   L = R I Rᵀ ω,   T = Σ (m v² + ω·L)/2,   V = -Σ m gravity·x
#include "tasks/stress/stress_history.hpp"

#include "engine/base/as_size.hpp"

namespace tangere {
namespace {

std::array<double, 6> diagonal(double xx, double yy, double zz) { return {xx, 0, 0, yy, 0, zz}; }

/// Two half balls and a cylinder between them. The centre of a half ball is 3/8 r from its flat
/// side.
std::array<double, 6> capsule_inertia(const CapsuleShape& c, double mass) {
  const double r2 = c.radius * c.radius, l2 = c.length * c.length;
  const double tube = c.length, balls = 4.0 / 3 * c.radius;  // volumes over π r²
  const double m_tube = mass * tube / (tube + balls), m_balls = mass * balls / (tube + balls);
  const double across =
      m_tube * (l2 / 12 + r2 / 4) + m_balls * (0.4 * r2 + l2 / 4 + 3.0 / 8 * c.length * c.radius);
  return diagonal(across, across, m_tube * r2 / 2 + m_balls * 0.4 * r2);
}

struct InertiaOf {
  double mass;
  std::array<double, 6> operator()(const SphereShape& s) const {
    const double i = 0.4 * mass * s.radius * s.radius;
    return diagonal(i, i, i);
  }
  [[nodiscard]] std::array<double, 6> of_lengths(const Vector3& size, double share) const {
    const double x = size[0] * size[0], y = size[1] * size[1], z = size[2] * size[2];
    return diagonal(share * mass * (y + z), share * mass * (x + z), share * mass * (x + y));
  }
  std::array<double, 6> operator()(const CuboidShape& s) const {
    return of_lengths(s.size, 1.0 / 12);
  }
  std::array<double, 6> operator()(const EllipsoidShape& s) const {
    return of_lengths(s.size, 1.0 / 20);
  }
  std::array<double, 6> operator()(const CylinderShape& s) const {
    const double r2 = s.radius * s.radius, across = mass * (s.length * s.length / 12 + r2 / 4);
    return diagonal(across, across, mass * r2 / 2);
  }
  std::array<double, 6> operator()(const CapsuleShape& s) const { return capsule_inertia(s, mass); }
  std::array<double, 6> operator()(const AbstractShape& s) const { return s.inertia; }
  std::array<double, 6> operator()(const PlaneShape&) const { return {}; }
  std::array<double, 6> operator()(const MeshShape&) const {
    throw InputError("a hard case with a mesh; expected shapes whose centre is their origin");
  }
};

/// Rotates by the quaternion w x y z, or back: x + 2 w (u × x) + 2 u × (u × x).
Vector3 turned(const Quaternion& q, const Vector3& x, double sense) {
  const Vector3 u{q[1], q[2], q[3]}, first = 2.0 * cross(u, x);
  return x + sense * q[0] * first + cross(u, first);
}

Vector3 product(const std::array<double, 6>& i, const Vector3& w) {
  return {i[0] * w[0] + i[1] * w[1] + i[2] * w[2], i[1] * w[0] + i[3] * w[1] + i[4] * w[2],
          i[2] * w[0] + i[4] * w[1] + i[5] * w[2]};
}

}  // namespace

std::array<double, 6> solid_inertia(const Shape& shape, double mass) {
  return std::visit(InertiaOf{mass}, shape);
}

StressHistory::StressHistory(const Model& model, double step) : model_(model), step_(step) {
  for (int b = 0; b < bodies(); ++b)
    inertia_.push_back(solid_inertia(scene().links[as_size(b)].body.shape, mass(b)));
}

void StressHistory::add(Readout& readout, const Batch& batch, int environment) {
  const std::size_t nb = as_size(bodies());
  poses_.resize(poses_.size() + 7 * nb);
  twists_.resize(twists_.size() + 6 * nb);
  readout.bodies(batch, environment, std::span(poses_).last(7 * nb),
                 std::span(twists_).last(6 * nb));
  ++frames_;
}

const double* StressHistory::pose(int frame, int body) const {
  return &poses_[7 * (as_size(frame) * as_size(bodies()) + as_size(body))];
}
const double* StressHistory::twist(int frame, int body) const {
  return &twists_[6 * (as_size(frame) * as_size(bodies()) + as_size(body))];
}

Vector3 StressHistory::position(int frame, int body) const {
  const double* p = pose(frame, body);
  return {p[0], p[1], p[2]};
}
Quaternion StressHistory::orientation(int frame, int body) const {
  const double* p = pose(frame, body);
  return {p[3], p[4], p[5], p[6]};
}
Vector3 StressHistory::velocity(int frame, int body) const {
  const double* t = twist(frame, body);
  return {t[3], t[4], t[5]};
}
Vector3 StressHistory::spin(int frame, int body) const {
  const double* t = twist(frame, body);
  return {t[0], t[1], t[2]};
}

Vector3 StressHistory::angular_momentum(int frame, int body) const {
  const Quaternion q = orientation(frame, body);
  return turned(q, product(inertia_[as_size(body)], turned(q, spin(frame, body), -1)), 1);
}

Vector3 StressHistory::angular_momentum(int frame) const {
  Vector3 sum{0, 0, 0};
  for (int b = 0; b < bodies(); ++b) sum = sum + angular_momentum(frame, b);
  return sum;
}

double StressHistory::kinetic_energy(int frame) const {
  double sum = 0;
  for (int b = 0; b < bodies(); ++b) {
    const Vector3 v = velocity(frame, b);
    sum += 0.5 * mass(b) * dot(v, v) + 0.5 * dot(spin(frame, b), angular_momentum(frame, b));
  }
  return sum;
}

double StressHistory::height_energy(int frame) const {
  double sum = 0;
  for (int b = 0; b < bodies(); ++b) sum -= mass(b) * dot(scene().gravity, position(frame, b));
  return sum;
}

}  // namespace tangere
