// SPDX-License-Identifier: Apache-2.0
// Motor forces that are known when a step begins: force motors, and position motors timed at the
// start.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "engine/model/compiled_model.hpp"
#include "engine/step/rotation_log.hpp"
#include "engine/step/workspace.hpp"

namespace tangere {

/// Returns the target of a position motor at the control u [m or rad], or the force of a force
/// motor that maps, before its range [N or N m].
inline double motor_input(const CompiledMotor& motor, double u) {
  if (!motor.maps) return u;
  return motor.scale * std::clamp(u, motor.u_low, motor.u_high) + motor.offset;
}
/// Its derivative by u. At a bound of u it is that of the inside.
inline double motor_input_slope(const CompiledMotor& motor, double u) {
  if (!motor.maps) return 1;
  return u >= motor.u_low && u <= motor.u_high ? motor.scale : 0;
}

/// Returns the force of a motor [N or N m]. `state`: one environment's column of its block. `u`:
/// controls of the motor's joint, from the first dof of its elementary link on.
inline double force_at_start(const CompiledModel& m, const CompiledMotor& motor,
                             const double* state, const double* u) {
  const auto input = [&](int component) { return motor_input(motor, u[component]); };
  if (motor.control == MotorControl::force && motor.maps)
    return std::clamp(input(motor.component), motor.low, motor.high);
  if (motor.control == MotorControl::force)
    return motor.low +
           (std::clamp(u[motor.component], -1.0, 1.0) + 1) * (0.5 * (motor.high - motor.low));
  const auto row = [&](int r) { return state[r * kernels::kBlock]; };
  const auto number = [&](const kernels::Parameter& p) { return p.row < 0 ? p.value : row(p.row); };
  const kernels::Link& link = m.links[std::size_t(motor.link)];
  const int q = m.layout.q + link.q;
  const auto to_target = [&] {
    if (link.kind != kernels::JointKind::spherical)
      return input(motor.component) - row(q + motor.component);
    const kernels::Quat<double> here = {row(q), row(q + 1), row(q + 2), row(q + 3)};
    const kernels::Quat<double> there =
        kernels::quaternion_exp(kernels::Vec3<double>{input(0), input(1), input(2)});
    const kernels::Vec3<double> way = rotation_log(conjugate(here) * there);  // in body axes
    return motor.component == 0 ? way.x : motor.component == 1 ? way.y : way.z;
  };
  return std::clamp(number(motor.P) * to_target() - number(motor.D) * row(m.layout.v + motor.dof),
                    motor.low, motor.high);
}

/// Sets the motors of one lane: the sum of the forces of those that are evaluated at the start of
/// the step, targets of the others. `state`: the lane's column of its block. Returns false if a
/// control is not finite.
template <int L>
bool set_motors(const CompiledModel& m, BasicWorkspace<L>& w, int lane, const double* state,
                std::span<const double> u) {
  for (int i = 0; i < m.nv; ++i) w.stage.tau[i][lane] = 0;
  for (std::size_t k = 0; k < std::size_t(m.nu); ++k) {
    if (!std::isfinite(u[k])) return false;
    const CompiledMotor& motor = m.motors[k];
    if (motor.at_end) {
      w.stage.target[motor.dof][lane] = motor_input(motor, u[k]);
    } else {
      w.stage.tau[motor.dof][lane] +=
          force_at_start(m, motor, state, u.data() + (k - std::size_t(motor.component)));
    }
  }
  return true;
}

}  // namespace tangere
