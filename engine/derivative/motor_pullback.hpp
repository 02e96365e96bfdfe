// SPDX-License-Identifier: Apache-2.0
// Motors in reverse: turns cotangents of forces and targets into those of the controls and of the
// state at the beginning of a step.
//
// Force motors: u ↦ low + (u + 1)/2 (high - low), constant beyond |u| = 1, or clip(t). Position
// motors timed at the start: clip(P ψ - D v), ψ = t - q or log(q⁻¹ exp t), with ∂ψ/∂q = -J_l⁻¹(ψ)
// and ∂ψ/∂t = J_r⁻¹(ψ) J_r(t). t is the input of the motor, u or scale clip(u) + offset. At a bound
// of a range the derivative is that of its inside.
#pragma once

#include "engine/derivative/group_adjoint.hpp"
#include "engine/step/motor_force.hpp"
#include "kernels/numbers/rotation_vector.hpp"

namespace tangere {

/// The motors of one lane.
template <int L>
struct MotorPullback {
  const CompiledModel& m;
  const double* state;        ///< the lane's column of the block that the step began with
  std::span<const double> u;  ///< (nu)
  int lane;

  /// Adds to the cotangents of u, which are kBlock apart, and to those of the state before the
  /// step.
  void run(LossRows<L>& o, double* u_bar) const {
    for (int k = 0; k < m.nu; ++k) {
      const CompiledMotor& motor = m.motors[std::size_t(k)];
      double& out = u_bar[k * kernels::kBlock];
      if (motor.at_end) {
        out += motor_input_slope(motor, u[std::size_t(k)]) * o.target[motor.dof][lane];
      } else if (motor.control == MotorControl::force) {
        out += force_slope(motor, u[std::size_t(k)]) * o.tau[motor.dof][lane];
      } else {
        at_start(motor, k, o, u_bar);
      }
    }
  }

 private:
  [[nodiscard]] double row(int r) const { return state[r * kernels::kBlock]; }
  [[nodiscard]] double number(const kernels::Parameter& p) const {
    return p.row < 0 ? p.value : row(p.row);
  }

  /// Of a force motor: the derivative of its force by u.
  static double force_slope(const CompiledMotor& motor, double u) {
    if (!motor.maps) return std::abs(u) <= 1 ? 0.5 * (motor.high - motor.low) : 0;
    const double force = motor_input(motor, u);
    return force >= motor.low && force <= motor.high ? motor_input_slope(motor, u) : 0;
  }

  void at_start(const CompiledMotor& motor, int k, LossRows<L>& o, double* u_bar) const {
    const double force = unclipped(motor, k);
    if (force < motor.low || force > motor.high) return;
    const double lambda = o.tau[motor.dof][lane], P = number(motor.P);
    o.v_centre[motor.dof][lane] -= number(motor.D) * lambda;
    const kernels::Link& link = m.links[std::size_t(motor.link)];
    if (o.parameters != nullptr) pull_back_gains(motor, k, lambda, o);
    if (link.kind != kernels::JointKind::spherical) {
      o.q_centre[motor.dof][lane] -= P * lambda;
      u_bar[k * kernels::kBlock] += motor_input_slope(motor, u[std::size_t(k)]) * P * lambda;
      return;
    }
    const int first = k - motor.component;
    const auto input = [&](int i) { return motor_input(motor, u[std::size_t(first + i)]); };
    const kernels::Vec3<double> goal = {input(0), input(1), input(2)};
    const kernels::RotationVector<double> psi = way(link, goal);
    kernels::Vec3<double> pull = {0, 0, 0};
    (&pull.x)[motor.component] = P * lambda;
    const kernels::Vec3<double> q_bar = transposed_times(inverse_left_jacobian(psi), pull);
    const kernels::Vec3<double> goal_bar =
        transposed_times(right_jacobian(goal, kernels::rotation_series(goal)),
                         transposed_times(inverse_right_jacobian(psi), pull));
    const double q_parts[3] = {q_bar.x, q_bar.y, q_bar.z},
                 goal_parts[3] = {goal_bar.x, goal_bar.y, goal_bar.z};
    for (int i = 0; i < 3; ++i) {
      o.q_centre[link.v + i][lane] -= q_parts[i];
      u_bar[(first + i) * kernels::kBlock] +=
          motor_input_slope(motor, u[std::size_t(first + i)]) * goal_parts[i];
    }
  }

  void pull_back_gains(const CompiledMotor& motor, int k, double lambda, LossRows<L>& o) const {
    CompiledMotor unit = motor;  // P = 1, D = 0: the error alone
    unit.P = {1, -1}, unit.D = {0, -1}, unit.low = -HUGE_VAL, unit.high = HUGE_VAL;
    const auto by = [&](kernels::DofNumber which) -> double& {
      return o.parameters[m.view.rows.dof(motor.dof, which)][lane];
    };
    by(kernels::kDofP) += lambda * force_at_start(m, unit, state, u.data() + (k - motor.component));
    by(kernels::kDofD) -= lambda * row(m.layout.v + motor.dof);
  }

  [[nodiscard]] kernels::RotationVector<double> way(const kernels::Link& link,
                                                    const kernels::Vec3<double>& goal) const {
    const int q = m.layout.q + link.q;
    const kernels::Quat<double> here = {row(q), row(q + 1), row(q + 2), row(q + 3)};
    return kernels::rotation_vector<false>(conjugate(here) * kernels::quaternion_exp(goal));
  }
  /// The motor's force before its range is applied.
  [[nodiscard]] double unclipped(const CompiledMotor& motor, int k) const {
    CompiledMotor free = motor;
    free.low = -HUGE_VAL, free.high = HUGE_VAL;
    return force_at_start(m, free, state, u.data() + (k - motor.component));
  }
};

}  // namespace tangere
