// SPDX-License-Identifier: Apache-2.0
// Forces on the dofs of a joint: damping, armature, springs, limits, dry friction and position
// motors, with their derivatives. Per dof
//
//   f = -c v - I_a a - k (q - rest) + k_l max(0, lo - q) - k_l max(0, q - hi)
//       - τ clip((q - z + t_f v)/θ_b, ±1) + clip(P (u - q) - D v, range)
//
// where a force motor with D has P = 1, and q does not enter.
//
// A spherical joint has rotation vectors in place of q: φ = log q, φ_s = log(rest⁻¹ q),
// ψ = log(q⁻¹ exp u). Torques in body axes: spring -k φ_s (the gradient of k|φ_s|²/2, as
// J_r⁻ᵀ(φ) φ = φ); limits J_r⁻ᵀ(φ) f(φ), f per component; motor clip(P ψ - D ω). By the right
// tangent θ: ∂φ/∂θ = J_r⁻¹(φ), ∂ψ/∂θ = -J_r⁻ᵀ(ψ).
//
// Flags of the link select, outside the lanes, the terms that are evaluated. At a bound of a limit
// the derivative is that of its inside. At a bound of a motor's range it is that of the unclipped
// force.
#pragma once

#include "kernels/numbers/rotation_vector.hpp"
#include "kernels/step/dof_chart.hpp"
#include "kernels/step/dry_friction.hpp"
#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// Forces on the dofs of one joint [N, N m] without damping, and derivatives of -force in the form
/// that the Jacobian needs.
template <class N>
struct JointLoad {
  N force[3];
  N magnitude[3];    ///< sum of the magnitudes of its parts, without inertia
  N d_dq[3];         ///< diagonal; joints that do not turn freely
  Mat3<N> d_dtheta;  ///< by the right tangent; spherical joints
  N d_dv[3];         ///< diagonal; includes c₀/h times the armature
  N armature[3];
};

template <class N>
N load_parameter(const StageArgs<N>& a, const Parameter& p) {
  return ParameterLoad<N>::load(p, a.block, a.group);
}

template <class N>
void add_force(JointLoad<N>& out, int k, const N& force) {
  out.force[k] += force;
  out.magnitude[k] += abs(force);
}

/// Returns the force of a limit at q. `slope`: derivative of -force.
template <class N>
N limit_force(const DofEffects& e, const N& stiffness, const N& q, N& slope) {
  const N low(e.low), high(e.high), zero(0.0);
  slope = select(q < low, stiffness, select(q > high, stiffness, zero));
  return select(q < low, stiffness * (low - q), select(q > high, stiffness * (high - q), zero));
}

/// Returns what P of a motor multiplies, for joints that do not turn freely.
template <class N>
N motor_error(const DofEffects& e, const N& target, const N& q) {
  return target - N(1 - e.q_apart) * q;
}

/// Returns the force of a position motor at the distance `error` from its target. `inside` is 1
/// where the force is not clipped.
template <class N>
N motor_force(const DofEffects& e, const N& P, const N& D, const N& error, const N& v, N& inside) {
  const N low(e.force_low), high(e.force_high);
  const N force = P * error - D * v;
  inside = select(force < low, N(0.0), select(force > high, N(0.0), N(1.0)));
  return select(force < low, low, select(force > high, high, force));
}

template <class N>
void add_plain_effects(const StageArgs<N>& a, const Link& link, const DofEffects& e, int k,
                       JointLoad<N>& out) {
  const N q = a.centre[link.q + k] + a.x[link.v + k];
  if (link.effects & kSpring) {
    const N stiffness = load_parameter(a, e.stiffness);
    add_force(out, k, stiffness * (N(e.rest) - q));
    out.d_dq[k] += stiffness;
  }
  if (link.effects & kLimit) {
    N slope;
    add_force(out, k, limit_force(e, load_parameter(a, e.limit_stiffness), q, slope));
    out.d_dq[k] += slope;
  }
  if (link.effects & kDryFriction) {
    const int d = link.v + k;
    const N bound = load_parameter(a, e.friction);
    const DryFriction<N> at = dry_friction(e, q, a.v[d], a.dry_anchor[d]);
    add_force(out, k, -(bound * at.share));
    // By the secant where it slips: of friction_tangent 0.
    const N slope = bound * N(e.friction_rate) *
                    (at.rigid + (N(1.0) - at.rigid) * (N(1.0) - a.friction_tangent) * at.hold);
    out.d_dq[k] += slope;
    out.d_dv[k] += slope * N(e.friction_time);
  }
  if (link.effects & kPositionServo) {
    const N P = load_parameter(a, e.P), D = load_parameter(a, e.D);
    N inside;
    const N error = motor_error(e, a.target[link.v + k], q);
    add_force(out, k, motor_force(e, P, D, error, a.v[link.v + k], inside));
    out.d_dq[k] += inside * P * N(1 - e.q_apart);
    out.d_dv[k] += inside * D;
  }
}

template <class N>
void add_torque(JointLoad<N>& out, const Vec3<N>& torque) {
  add_force(out, 0, torque.x);
  add_force(out, 1, torque.y);
  add_force(out, 2, torque.z);
}

template <bool Derivatives, class N>
void add_turning_limits(const StageArgs<N>& a, const DofEffects* e, const Quat<N>& q,
                        JointLoad<N>& out) {
  const RotationVector<N> at = rotation_vector<Derivatives>(q);
  const N phi[3] = {at.phi.x, at.phi.y, at.phi.z};
  N f[3], slope[3];
  for (int k = 0; k < 3; ++k)
    f[k] = limit_force(e[k], load_parameter(a, e[k].limit_stiffness), phi[k], slope[k]);
  const Vec3<N> force = {f[0], f[1], f[2]};
  const Mat3<N> inverse = inverse_left_jacobian(at);
  add_torque(out, inverse * force);
  if constexpr (Derivatives) {
    Mat3<N> d_dphi = -inverse_left_jacobian_derivative(at, force);
    for (int i = 0; i < 3; ++i)
      for (int k = 0; k < 3; ++k)
        d_dphi.m[i][k] = mul_add(inverse.m[i][k], slope[k], d_dphi.m[i][k]);
    out.d_dtheta += d_dphi * inverse_right_jacobian(at);
  }
}

template <bool Derivatives, class N>
void add_turning_motor(const StageArgs<N>& a, const Link& link, const DofEffects* e,
                       const Quat<N>& q, JointLoad<N>& out) {
  const N* u = a.target + link.v;
  const RotationVector<N> error =
      rotation_vector<false>(conjugate(q) * quaternion_exp(Vec3<N>{u[0], u[1], u[2]}));
  const N psi[3] = {error.phi.x, error.phi.y, error.phi.z};
  const Mat3<N> slope = inverse_left_jacobian(error);
  for (int i = 0; i < 3; ++i) {
    const N P = load_parameter(a, e[i].P), D = load_parameter(a, e[i].D);
    N inside;
    add_force(out, i, motor_force(e[i], P, D, psi[i], a.v[link.v + i], inside));
    out.d_dv[i] += inside * D;
    if constexpr (Derivatives)
      for (int k = 0; k < 3; ++k)
        out.d_dtheta.m[i][k] = mul_add(inside * P, slope.m[i][k], out.d_dtheta.m[i][k]);
  }
}

template <bool Derivatives, class N>
void add_turning_effects(const StageArgs<N>& a, const Link& link, const DofEffects* e,
                         JointLoad<N>& out) {
  out.d_dtheta = zero33<N>();
  const N *c = a.centre + link.q, *x = a.x + link.v;
  const Quat<N> q = Quat<N>{c[0], c[1], c[2], c[3]} * quaternion_exp(Vec3<N>{x[0], x[1], x[2]});
  if (link.effects & kSpring) {
    const Quat<N> rest = quaternion_exp(Vec3<N>{N(e[0].rest), N(e[1].rest), N(e[2].rest)});
    const RotationVector<N> turn = rotation_vector<false>(conjugate(rest) * q);
    const N stiffness = load_parameter(a, e[0].stiffness);
    add_torque(out, -(stiffness * turn.phi));
    if constexpr (Derivatives) out.d_dtheta += stiffness * inverse_right_jacobian(turn);
  }
  if (link.effects & kLimit) add_turning_limits<Derivatives>(a, e, q, out);
  if (link.effects & kPositionServo) add_turning_motor<Derivatives>(a, link, e, q, out);
}

/// Adds damping alone: most joints have nothing else.
template <JointKind K, class N>
void add_damping(const ModelView& model, const StageArgs<N>& a, const Link& link) {
  for (int k = 0; k < dofs(K); ++k) {
    const int d = link.v + k;
    const N damping = load_parameter(a, model.effects[d].damping) * a.v[d];
    a.g[d] += damping;
    a.force_scale[d] += abs(damping);
  }
}

/// Adds all other effects of one joint at the stage's x. a.v of its dofs must be set.
template <JointKind K, bool Derivatives, class N>
void joint_load(const ModelView& model, const StageArgs<N>& a, const Link& link,
                JointLoad<N>& out) {
  const DofEffects* e = model.effects + link.v;
  for (int k = 0; k < dofs(K); ++k) {
    const int d = link.v + k;
    out.force[k] = out.magnitude[k] = out.d_dq[k] = out.d_dv[k] = out.armature[k] = N(0.0);
    if (link.effects & kArmature) {
      out.armature[k] = load_parameter(a, e[k].armature);
      out.force[k] -= out.armature[k] * mul_add(a.c0_over_h, a.v[d], a.inverse_h * a.s[d]);
      out.d_dv[k] = a.c0_over_h * out.armature[k];
    }
    if constexpr (K != JointKind::spherical)
      if (link.effects & kPositionDependent) add_plain_effects(a, link, e[k], k, out);
  }
  if constexpr (K == JointKind::spherical)
    if (link.effects & kPositionDependent) add_turning_effects<Derivatives>(a, link, e, out);
}

// Not inlined: its frame would cost time in joints that have no such effects.
template <JointKind K, class N>
[[gnu::noinline]] void add_joint_load(const ModelView& model, const StageArgs<N>& a,
                                      const Link& link) {
  JointLoad<N> load;
  joint_load<K, false>(model, a, link, load);
  for (int k = 0; k < dofs(K); ++k) {
    a.g[link.v + k] -= load.force[k];
    a.force_scale[link.v + k] += load.magnitude[k];
  }
}

/// Adds the derivatives of a force by v, which are diagonal, to the joint's block of A.
template <JointKind K, class N>
void add_v_derivative(const ModelView& model, const StageArgs<N>& a, const Link& link, int j,
                      const N& d_dv) {
  const EntryRows<N> entry = entries_at(model, a, link.v + j, link.v);
  const LinkScratch<N>& o = a.links[&link - model.links];
  if constexpr (K != JointKind::spherical) {
    entry(0, j) = mul_add(rate_by_x<K>(link, o, a.c0_over_h), d_dv, entry(0, j));
  } else {
    for (int k = 0; k < 3; ++k) entry(0, k) = mul_add(o.chart_rate.m[j][k], d_dv, entry(0, k));
  }
}

template <JointKind K, class N>
[[gnu::noinline]] void add_load_entries(const ModelView& model, const StageArgs<N>& a,
                                        const Link& link) {
  JointLoad<N> load;
  joint_load<K, true>(model, a, link, load);
  for (int j = 0; j < dofs(K); ++j) {
    a.mass_diagonal[link.v + j] += load.armature[j];
    add_v_derivative<K>(model, a, link, j, load.d_dv[j]);
    if (!(link.effects & kPositionDependent)) continue;
    const EntryRows<N> entry = entries_at(model, a, link.v + j, link.v);
    const LinkScratch<N>& o = a.links[&link - model.links];
    if constexpr (K != JointKind::spherical) {
      entry(0, j) += along_x<K>(link, o, load.d_dq[j]);
    } else {
      for (int k = 0; k < 3; ++k)
        for (int i = 0; i < 3; ++i)
          entry(0, k) = mul_add(load.d_dtheta.m[j][i], o.chart.m[i][k], entry(0, k));
    }
  }
}

/// Adds a joint's effects to its diagonal block of A and to the diagonal of M.
template <JointKind K, class N>
void add_effect_entries(const ModelView& model, const StageArgs<N>& a, const Link& link) {
  if (link.effects & kDamping)
    for (int j = 0; j < dofs(K); ++j)
      add_v_derivative<K>(model, a, link, j, load_parameter(a, model.effects[link.v + j].damping));
  if (link.effects & kBeyondDamping) add_load_entries<K>(model, a, link);
}

}  // namespace tangere::kernels
