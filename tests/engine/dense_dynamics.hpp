// SPDX-License-Identifier: Apache-2.0
// A second derivation of the equations of motion, for tests: world axes, dense Jacobians of the
// centres of mass, Newton and Euler summed over bodies, in any floating-point type. It shares no
// formula and no code with the kernels.
//
//   M = Σ m Jᵀ J + J_ωᵀ I J_ω,   M a + b = Q,   b = Σ Jᵀ m (a₀ - g) + J_ωᵀ (I α₀ + ω × I ω)
//       (a₀, α₀: with q̈ = 0)
//   Q: joint effects and motors. Joints of the scene are used whole, not split into chains.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "engine/scene/scene.hpp"

namespace tangere::testing {

template <class S>
class DenseDynamics {
 public:
  using V3 = Eigen::Matrix<S, 3, 1>;
  using M3 = Eigen::Matrix<S, 3, 3>;
  using Vector = Eigen::Matrix<S, Eigen::Dynamic, 1>;
  using Matrix = Eigen::Matrix<S, Eigen::Dynamic, Eigen::Dynamic>;
  using Quat = Eigen::Quaternion<S>;

  explicit DenseDynamics(const Scene& scene) : scene_(scene) {
    for (const LinkDescription& l : scene.links) {
      q_.push_back(nq);
      v_.push_back(nv);
      nq += position_count(l.joint.type);
      nv += dof_count(l.joint.type);
    }
    for (std::size_t i = 0; i < scene.links.size(); ++i)
      masses_.push_back(mass_of(scene.links[i].body));
  }

  int nq = 0, nv = 0;

  /// Mass matrix (armature included), bias and the forces of joints and motors at a state.
  struct Terms {
    Matrix mass;
    Vector bias, force;
    V3 momentum, angular_momentum;  ///< of all bodies, about the world's origin
    S energy;                       ///< kinetic and of gravity
  };
  [[nodiscard]] Terms terms(const Vector& q, const Vector& v, const std::vector<double>& u) const {
    Terms t{Matrix::Zero(nv, nv), Vector::Zero(nv), Vector::Zero(nv), V3::Zero(), V3::Zero(), S(0)};
    std::vector<Motion> joints;
    const V3 gravity = vec(scene_.gravity);
    for (std::size_t i = 0; i < scene_.links.size(); ++i) {
      const LinkDescription& l = scene_.links[i];
      Motion at;
      if (l.parent >= 0) at = joints[std::size_t(l.parent)];
      move(l.joint, q, v, q_[i], v_[i], at);
      joints.push_back(at);
      add_body(l.body, masses_[i], at, v, S(l.body.gravity_share) * gravity, t);
      joint_forces(l.joint, q, v, q_[i], v_[i], t);
    }
    motor_forces(q, v, u, t.force);
    return t;
  }
  [[nodiscard]] Vector acceleration(const Vector& q, const Vector& v,
                                    const std::vector<double>& u) const {
    const Terms t = terms(q, v, u);
    return t.mass.ldlt().solve(t.force - t.bias);
  }

  /// q̇ of a state. The rate of a quaternion is half its product with (0, ω).
  [[nodiscard]] Vector rate(const Vector& q, const Vector& v) const {
    Vector out(nq);
    for (std::size_t i = 0; i < scene_.links.size(); ++i) {
      const JointType type = scene_.links[i].joint.type;
      const int plain = position_count(type) - (ball(type) ? 4 : 0);
      for (int k = 0; k < plain; ++k) out[q_[i] + k] = v[v_[i] + k];
      if (!ball(type)) continue;
      const int a = q_[i] + plain, w = v_[i] + plain;
      const Quat turn =
          Quat(q[a], q[a + 1], q[a + 2], q[a + 3]) * Quat(S(0), v[w], v[w + 1], v[w + 2]);
      out[a] = turn.w() / 2, out[a + 1] = turn.x() / 2, out[a + 2] = turn.y() / 2,
      out[a + 3] = turn.z() / 2;
    }
    return out;
  }

  [[nodiscard]] Vector initial_q() const {
    Vector q = Vector::Zero(nq);
    for (std::size_t i = 0; i < scene_.links.size(); ++i) {
      const JointType type = scene_.links[i].joint.type;
      if (ball(type)) q[q_[i] + position_count(type) - 4] = S(1);
    }
    copy_initial(q_, &InitialState::q, q);
    return q;
  }
  [[nodiscard]] Vector initial_v() const {
    Vector v = Vector::Zero(nv);
    copy_initial(v_, &InitialState::v, v);
    return v;
  }

 private:
  struct Mass {
    S mass;
    M3 inertia;  ///< about the centre, body axes
  };
  struct Column {
    int dof;
    V3 angular, linear, at;  ///< world axes; linear velocity of the material point at `at`
  };
  /// A joint frame in world axes: pose, twist, acceleration for q̈ = 0, and the dependence of its
  /// motion on v.
  struct Motion {
    M3 R = M3::Identity();
    V3 p = V3::Zero(), omega = V3::Zero(), velocity = V3::Zero(), alpha = V3::Zero(),
       acceleration = V3::Zero();
    std::vector<Column> columns;
  };

  static V3 vec(const Vector3& a) { return V3(S(a[0]), S(a[1]), S(a[2])); }
  static M3 rotation(const Quaternion& q) {
    return Quat(S(q[0]), S(q[1]), S(q[2]), S(q[3])).normalized().toRotationMatrix();
  }
  static bool ball(JointType t) { return t == JointType::spherical || t == JointType::free; }

  static Mass mass_of(const BodyDescription& body) {
    const S density = S(body.density);
    if (const auto* sphere = std::get_if<SphereShape>(&body.shape)) {
      const S r = S(sphere->radius), m = density * 4 * std::acos(S(-1)) / 3 * r * r * r;
      return {m, M3::Identity() * (2 * m * r * r / 5)};
    }
    const auto rod = [](S m, S axial, S across) {
      return Mass{m, M3(V3(across, across, axial).asDiagonal())};
    };
    if (const auto* c = std::get_if<CylinderShape>(&body.shape)) {
      const S r2 = S(c->radius) * S(c->radius), l = S(c->length),
              m = density * std::acos(S(-1)) * r2 * l;
      return rod(m, m * r2 / 2, m * (3 * r2 + l * l) / 12);
    }
    if (const auto* c = std::get_if<CapsuleShape>(&body.shape)) {
      const S r = S(c->radius), l = S(c->length), pi = std::acos(S(-1));
      const S tube = density * pi * r * r * l, ends = density * 4 * pi / 3 * r * r * r;
      return rod(
          tube + ends, tube * r * r / 2 + 2 * ends * r * r / 5,
          tube * (3 * r * r + l * l) / 12 + ends * (2 * r * r / 5 + l * l / 4 + 3 * l * r / 8));
    }
    if (std::holds_alternative<PlaneShape>(body.shape)) return {0, M3::Zero()};
    if (const auto* c = std::get_if<EllipsoidShape>(&body.shape)) {
      const V3 a = vec(c->size) / 2, a2 = a.cwiseProduct(a);
      const S m = density * 4 * std::acos(S(-1)) / 3 * a.prod();
      return {m, M3(V3(a2.y() + a2.z(), a2.x() + a2.z(), a2.x() + a2.y()).asDiagonal()) * (m / 5)};
    }
    if (const auto* given = std::get_if<AbstractShape>(&body.shape)) {
      const auto& [xx, xy, xz, yy, yz, zz] = given->inertia;
      M3 inertia;
      inertia << S(xx), S(xy), S(xz), S(xy), S(yy), S(yz), S(xz), S(yz), S(zz);
      return {S(given->mass), inertia};
    }
    const auto* box = std::get_if<CuboidShape>(&body.shape);
    if (box == nullptr) throw std::logic_error("dense dynamics: a shape without a formula here");
    const V3 s = vec(box->size), s2 = s.cwiseProduct(s);
    const S m = density * s.prod();
    return {m, M3(V3(s2.y() + s2.z(), s2.x() + s2.z(), s2.x() + s2.y()).asDiagonal()) * (m / 12)};
  }

  /// Moves to the frame that is fixed to the current one at c.
  static void shift(Motion& m, const V3& c, const V3& slide = V3::Zero()) {
    const V3 d = c + slide;
    m.velocity += m.omega.cross(d);
    m.acceleration += m.alpha.cross(d) + m.omega.cross(m.omega.cross(d));
    m.p += d;
  }
  static void slide_along(Motion& m, const V3& axis, S q, S v, int dof) {
    shift(m, axis * q);
    m.acceleration += S(2) * m.omega.cross(axis * v);
    m.velocity += axis * v;
    m.columns.push_back({dof, V3::Zero(), axis, m.p});
  }
  static void turn_with(Motion& m,
                        const V3& rate) {  // rate: R times a vector that is constant when q̈ = 0
    m.alpha += m.omega.cross(rate);
    m.omega += rate;
  }

  static void move(const JointDescription& d, const Vector& q, const Vector& v, int iq, int iv,
                   Motion& m) {
    shift(m, m.R * vec(d.pose.position));
    m.R = (m.R * rotation(d.pose.orientation)).eval();
    const V3 a0 = vec(d.axis0), a1 = vec(d.axis1);
    const auto slide = [&](int k, const V3& axis) {
      slide_along(m, m.R * axis, q[iq + k], v[iv + k], iv + k);
    };
    const auto hinge = [&](int k, const V3& axis) {
      const V3 world = m.R * axis;
      m.R = (m.R * Eigen::AngleAxis<S>(q[iq + k], axis).toRotationMatrix()).eval();
      turn_with(m, world * v[iv + k]);
      m.columns.push_back({iv + k, world, V3::Zero(), m.p});
    };
    switch (d.type) {
      case JointType::fixed: break;
      case JointType::revolute: hinge(0, a0); break;
      case JointType::prismatic: slide(0, a0); break;
      case JointType::planar: slide(0, a0), slide(1, a1); break;
      case JointType::translational:
      case JointType::free:
        for (int k = 0; k < 3; ++k) slide(k, V3::Unit(k));
        break;
      case JointType::free2d:
        slide(0, V3::UnitX()), slide(1, V3::UnitY()), hinge(2, V3::UnitZ());
        break;
      case JointType::spherical: break;
    }
    if (!ball(d.type)) return;
    const int a = iq + position_count(d.type) - 4, w = iv + dof_count(d.type) - 3;
    m.R = (m.R * Quat(q[a], q[a + 1], q[a + 2], q[a + 3]).normalized().toRotationMatrix()).eval();
    turn_with(m, m.R * V3(v[w], v[w + 1], v[w + 2]));
    for (int k = 0; k < 3; ++k) m.columns.push_back({w + k, m.R.col(k), V3::Zero(), m.p});
  }

  void add_body(const BodyDescription& d, const Mass& body, Motion m, const Vector& v,
                const V3& gravity, Terms& t) const {
    if (body.mass == 0) return;
    shift(m, m.R * vec(d.pose.position));
    const M3 R = m.R * rotation(d.pose.orientation), I = R * body.inertia * R.transpose();
    Matrix angular = Matrix::Zero(3, nv), linear = Matrix::Zero(3, nv);
    for (const Column& c : m.columns) {
      angular.col(c.dof) += c.angular;
      linear.col(c.dof) += c.linear + c.angular.cross(m.p - c.at);
    }
    t.mass += body.mass * linear.transpose() * linear + angular.transpose() * I * angular;
    const V3 spin = I * m.omega;
    t.bias += linear.transpose() * (body.mass * (m.acceleration - gravity)) +
              angular.transpose() * (I * m.alpha + m.omega.cross(spin));
    if ((linear * v - m.velocity).norm() > S(1e-9) * (1 + m.velocity.norm()))
      throw std::logic_error("dense dynamics: the Jacobian does not give the velocity");
    t.momentum += body.mass * m.velocity;
    t.angular_momentum += spin + m.p.cross(body.mass * m.velocity);
    t.energy += (body.mass * m.velocity.squaredNorm() + m.omega.dot(spin)) / 2 -
                body.mass * gravity.dot(m.p);
  }

  // --- joint effects ---

  static V3 log(Quat q) {
    if (q.w() < 0) q.coeffs() *= S(-1);
    const S s = q.vec().norm();
    return s == 0 ? V3(V3::Zero()) : V3(q.vec() * (2 * std::atan2(s, q.w()) / s));
  }
  static Quat exp(const V3& x) {
    const S angle = x.norm();
    return angle == 0 ? Quat::Identity() : Quat(Eigen::AngleAxis<S>(angle, x / angle));
  }
  /// J_r⁻¹ in closed form; |x| not near 0.
  static M3 inverse_right_jacobian(const V3& x) {
    const S a = x.norm();
    M3 X;
    X << 0, -x.z(), x.y(), x.z(), 0, -x.x(), -x.y(), x.x(), 0;
    return M3::Identity() + X / 2 +
           X * X * (1 / (a * a) - (1 + std::cos(a)) / (2 * a * std::sin(a)));
  }
  static S beyond(const JointEffects& e, S q) {
    if (!e.limits) return S(0);
    return q < S((*e.limits)[0])   ? S((*e.limits)[0]) - q
           : q > S((*e.limits)[1]) ? S((*e.limits)[1]) - q
                                   : S(0);
  }
  static Quat quat_at(const Vector& q, int i) { return Quat(q[i], q[i + 1], q[i + 2], q[i + 3]); }

  static void joint_forces(const JointDescription& d, const Vector& q, const Vector& v, int iq,
                           int iv, Terms& t) {
    const int n = dof_count(d.type), plain = n - (ball(d.type) ? 3 : 0);
    for (int k = 0; k < n; ++k) {
      const JointEffects& e = d.turning && dof_turns(d.type, k) ? *d.turning : d;
      t.mass(iv + k, iv + k) += S(e.armature);
      t.force[iv + k] -= S(e.damping) * v[iv + k];
      if (k >= plain) continue;
      const S rest = d.rest.empty() ? S(0) : S(d.rest[std::size_t(k)]);
      t.force[iv + k] +=
          S(e.stiffness) * (rest - q[iq + k]) + S(e.limit_stiffness) * beyond(e, q[iq + k]);
    }
    if (!ball(d.type)) return;
    const JointEffects& e = d.turning ? *d.turning : d;
    const Quat turn = quat_at(q, iq + plain);
    V3 rest = V3::Zero();
    for (int k = 0; k < 3 && !d.rest.empty(); ++k) rest[k] = S(d.rest[std::size_t(plain + k)]);
    t.force.template segment<3>(iv + plain) -= S(e.stiffness) * log(exp(rest).conjugate() * turn);
    const V3 phi = log(turn);
    const V3 f =
        S(e.limit_stiffness) * V3(beyond(e, phi.x()), beyond(e, phi.y()), beyond(e, phi.z()));
    if (f.norm() > 0)
      t.force.template segment<3>(iv + plain) += inverse_right_jacobian(phi).transpose() * f;
  }

  void motor_forces(const Vector& q, const Vector& v, const std::vector<double>& u,
                    Vector& force) const {
    std::size_t at = 0;
    for (const MotorDescription& motor : scene_.motors)
      for (std::size_t i = 0; i < scene_.links.size(); ++i) {
        const JointType type = scene_.links[i].joint.type;
        if (scene_.links[i].joint.name != motor.joint) continue;
        const auto input = [&](std::size_t control) {
          const S value = S(u[control]);
          if (!motor.maps()) return value;
          const S within = std::min(std::max(value, S(motor.u_range[0])), S(motor.u_range[1]));
          return S(motor.scale.value_or(1)) * within + S(motor.offset);
        };
        V3 way = V3::Zero();
        if (type == JointType::spherical)
          way =
              log(quat_at(q, q_[i]).conjugate() * exp(V3(input(at), input(at + 1), input(at + 2))));
        for (int k = 0; k < dof_count(type); ++k, ++at) {
          const S low = S(motor.low), high = S(motor.high), value = input(at);
          if (motor.control == MotorControl::force) {
            force[v_[i] + k] +=
                motor.scale ? std::min(std::max(value, low), high)
                            : low + (std::min(std::max(value, S(-1)), S(1)) + 1) * (high - low) / 2;
            continue;
          }
          const S error = type == JointType::spherical ? way[k] : value - q[q_[i] + k];
          force[v_[i] + k] +=
              std::min(std::max(S(motor.P) * error - S(motor.D) * v[v_[i] + k], low), high);
        }
      }
  }

  void copy_initial(const std::vector<int>& first, std::vector<double> InitialState::*member,
                    Vector& to) const {
    for (const InitialState& d : scene_.initial)
      for (std::size_t i = 0; i < scene_.links.size(); ++i)
        for (std::size_t k = 0; scene_.links[i].joint.name == d.joint && k < (d.*member).size();
             ++k)
          to[first[i] + int(k)] = S((d.*member)[k]);
  }

  const Scene scene_;
  std::vector<int> q_, v_;
  std::vector<Mass> masses_;
};

}  // namespace tangere::testing
