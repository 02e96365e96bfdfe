// SPDX-License-Identifier: Apache-2.0
// With R the body's orientation, I its inertia and ω its angular velocity:
//   L = R I Rᵀ ω,   T = Σ (m v² + ω·L)/2,   V = -Σ m gravity·x
#include "tasks/stress/stress_history.hpp"

#include "engine/base/as_size.hpp"
#include "engine/scene/sensed_bodies.hpp"
#include "engine/scene/shapes.hpp"

namespace tangere {
namespace {

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

StressHistory::StressHistory(const Model& model, double step) : model_(model), step_(step) {
  for (int b = 0; b < bodies(); ++b) {
    const Shape& shape = scene().links[as_size(b)].body.shape;
    const bool mesh = std::holds_alternative<MeshShape>(shape);
    if (mesh && moving_link(scene(), b) >= 0)
      throw InputError(
          "a hard case with a mesh that moves; expected shapes whose centre is their origin");
    inertia_.push_back(mesh ? std::array<double, 6>{} : solid_inertia(shape, mass(b)));
  }
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
