// SPDX-License-Identifier: Apache-2.0
// The reverse sweep through one solved stage, after residual<true>() and jacobian() at its accepted
// x (docs/gradients.md).
//
//   Aᵀ λ = Jᵀ q̄ + V_xᵀ v̄;   ν = v̄ - Cᵀ λ,  C = G_v + (c₀/h) M;
//       then the history takes (∂v/∂q_k)ᵀ ν and -(∂a/∂v_k)ᵀ M λ
//
// Products with Cᵀ and M need no matrix. φ = λᵀ g is the power of all wrenches along the twists Λ =
// X Λ_p + S λ:
//   φ = Σ Λᵀ (I A + V ×* I V) + Σ_pairs Yᵀ w₁ - λᵀ τ …,   Y = Ad Λ₂ - Λ₁
// One inward sweep of Ā = I Λ, V̄ = -Λ ×* I V - I (V × Λ) + contacts gives all its derivatives
// by v at fixed q:
//   V̄ += (S q̇) ×* Ā;   (M λ)_i = Sᵀ Ā;   (Cᵀ λ)_i = Sᵀ (V̄ - V ×* Ā) + (c₀/h) Sᵀ Ā;
//       Ā_p += X* Ā, V̄_p += X* V̄
#pragma once

#include "kernels/reverse/adjoint_arguments.hpp"
#include "kernels/reverse/transmission_adjoint.hpp"
#include "kernels/step/inertial_jacobian.hpp"

namespace tangere::kernels {

/// Writes Jᵀ q̄ + V_xᵀ v̄.
template <class N>
void adjoint_rhs(const ModelView& model, const StageArgs<N>& a, const AdjointArgs<N>& d) {
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    const LinkScratch<N>& o = a.links[i];
    for (int k = link.v; k < link.v + dofs(link.kind); ++k) {
      if (link.has_chart) {
        d.rhs[k] = along_dof_chart(o, d.q_bar[k], d.v_bar[k]);
        continue;
      }
      if (link.kind != JointKind::spherical) {
        d.rhs[k] = mul_add(a.c0_over_h, d.v_bar[k], d.q_bar[k]);
        continue;
      }
      N sum(0.0);
      for (int j = 0; j < 3; ++j) {
        sum = mul_add(o.chart.m[j][k - link.v], d.q_bar[link.v + j], sum);
        sum = mul_add(o.chart_rate.m[j][k - link.v], d.v_bar[link.v + j], sum);
      }
      d.rhs[k] = sum;
    }
  }
  transmission_rhs(model, a, d);
}

/// Returns S x for one joint.
template <JointKind K, class N>
Vec6<N> along_joint(const Link& link, const N* x) {
  Vec3<N> sum = x[link.v] * joint_axis<K, N>(link, 0);
  if constexpr (dofs(K) == 3) sum = {x[link.v], x[link.v + 1], x[link.v + 2]};
  return slides(K) ? Vec6<N>{zero3<N>(), sum} : Vec6<N>{sum, zero3<N>()};
}

/// Computes Λ and the shares of inertia in Ā and V̄.
template <class N>
void adjoint_outward(const ModelView& model, const StageArgs<N>& a, const AdjointArgs<N>& d) {
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    const LinkScratch<N>& s = a.links[i];
    LinkAdjoint<N>& o = d.links[i];
    with_kind(link.kind, [&]<JointKind K>() {
      o.twist = along_joint<K>(link, d.lambda);
      o.rate = along_joint<K>(link, a.v);
    });
    if (link.parent >= 0) o.twist += motion_to_child(link, s.local, d.links[link.parent].twist);
    o.V_bar = o.A_bar = zero6<N>();
    if (!link.has_mass) continue;
    const LinkInertia<N> own = load_inertia<N>(link, a.block, a.group);
    if (link.never_rotates) {
      o.A_bar.l = own.mass * o.twist.l;
      continue;
    }
    const auto times = [&](const Vec6<N>& x) {
      return inertia_times(own.mass, own.moment, own.inertia, x);
    };
    o.A_bar = times(o.twist);
    o.V_bar = -(cross_wrench(o.twist, times(s.V)) + times(cross_motion(s.V, o.twist)));
  }
}

/// 𝐃ᵀ Y.
template <class N>
Vec6<N> transposed_damping(const PairSums<N>& s, const Vec6<N>& y) {
  return {transposed_times(s.d[0][0], y.a) + transposed_times(s.d[1][0], y.l),
          transposed_times(s.d[0][1], y.a) + transposed_times(s.d[1][1], y.l)};
}

/// Returns Y of a pair of links or a loop: the rate at which body 2 moves against body 1 along λ,
/// in body 1's axes at its origin.
template <class Pair, class N>
Vec6<N> adjoint_slip(const Pair& pair, const ContactScratch<N>& o, const LinkAdjoint<N>* links) {
  Vec6<N> y = pair.link2 < 0 ? zero6<N>() : motion_to_parent(o.link2_in_1, links[pair.link2].twist);
  if (pair.link1 >= 0) y -= links[pair.link1].twist;
  return y;
}

/// Adds the share of contacts to V̄: w₁ depends on W = Ad V₂ - V₁.
template <class N>
void adjoint_contacts(const ModelView& model, const StageArgs<N>& a, const AdjointArgs<N>& d) {
  const auto add = [&](const auto& pair, const ContactScratch<N>& o) {
    const Vec6<N> w = transposed_damping(o.sums, adjoint_slip(pair, o, d.links));
    if (pair.link1 >= 0) d.links[pair.link1].V_bar -= w;
    if (pair.link2 >= 0) d.links[pair.link2].V_bar += wrench_to_child(o.link2_in_1, w);
  };
  for_each_link_pair(model, a, [&](int k) {
    if (a.contacts[k].near) add(model.link_pairs[k], a.contacts[k]);
  });
  for (int k = 0; k < model.n_loops; ++k) add(model.loops[k], loop_scratch(model, a, k));
  for (int k = 0; k < model.n_grounded; ++k) {
    const ContactScratch<N>& o = a.contacts[model.n_link_pairs + k];
    if (!o.near) continue;
    LinkAdjoint<N>& link = d.links[model.grounded[k].link];
    link.V_bar += transposed_damping(o.sums, link.twist);
  }
}

/// Computes cotangents of the targets of one joint's motors: (∂force/∂u)ᵀ λ.
template <JointKind K, class N>
void adjoint_targets(const ModelView& model, const StageArgs<N>& a, const Link& link,
                     const N* lambda, N* target) {
  const DofEffects* e = model.effects + link.v;
  const N *c = a.centre + link.q, *x = a.x + link.v, *u = a.target + link.v, *v = a.v + link.v;
  N pull[3];
  const auto pulled = [&](int k, const N& error) {
    const N P = load_parameter(a, e[k].P);
    N inside;
    motor_force(e[k], P, load_parameter(a, e[k].D), error, v[k], inside);
    pull[k] = inside * P * lambda[link.v + k];
  };
  if constexpr (K != JointKind::spherical) {
    for (int k = 0; k < dofs(K); ++k) {
      pulled(k, motor_error(e[k], u[k], N(c[k] + x[k])));
      target[link.v + k] = pull[k];
    }
  } else {  // ψ = log(q⁻¹ exp u): δψ = J_r⁻¹(ψ) J_r(u) δu
    const Quat<N> q = Quat<N>{c[0], c[1], c[2], c[3]} * quaternion_exp(Vec3<N>{x[0], x[1], x[2]});
    const Vec3<N> goal = {u[0], u[1], u[2]};
    const RotationVector<N> error = rotation_vector<false>(conjugate(q) * quaternion_exp(goal));
    pulled(0, error.phi.x), pulled(1, error.phi.y), pulled(2, error.phi.z);
    const Vec3<N> psi_bar =
        transposed_times(inverse_right_jacobian(error), Vec3<N>{pull[0], pull[1], pull[2]});
    const Vec3<N> u_bar = transposed_times(right_jacobian(goal, rotation_series(goal)), psi_bar);
    target[link.v] = u_bar.x, target[link.v + 1] = u_bar.y, target[link.v + 2] = u_bar.z;
  }
}

/// Computes cotangents of the anchors of one joint's dry friction: (∂force/∂z)ᵀ λ.
template <JointKind K, class N>
void adjoint_dry_friction(const ModelView& model, const StageArgs<N>& a, const Link& link,
                          const N* lambda, N* anchor) {
  for (int k = 0; k < dofs(K); ++k) {
    const int d = link.v + k;
    const DofEffects& e = model.effects[d];
    const DryFriction<N> at =
        dry_friction(e, a.centre[link.q + k] + a.x[d], a.v[d], a.dry_anchor[d]);
    anchor[d] = at.rigid * load_parameter(a, e.friction) * N(e.friction_rate) * lambda[d];
  }
}

/// Adds the joint effects of one joint to the sweep's Cᵀ λ and M λ.
template <JointKind K, class N>
void adjoint_effects(const ModelView& model, const StageArgs<N>& a, const AdjointArgs<N>& d,
                     const Link& link, N* Ct_lambda) {
  if (link.effects & kDamping)
    for (int k = 0; k < dofs(K); ++k)
      Ct_lambda[k] = mul_add(load_parameter(a, model.effects[link.v + k].damping),
                             d.lambda[link.v + k], Ct_lambda[k]);
  if (!(link.effects & kBeyondDamping)) return;
  JointLoad<N> load;
  joint_load<K, true>(model, a, link, load);
  for (int k = 0; k < dofs(K); ++k) {
    const N& lambda = d.lambda[link.v + k];
    Ct_lambda[k] = mul_add(load.d_dv[k], lambda, Ct_lambda[k]);
    d.mass_lambda[link.v + k] = mul_add(load.armature[k], lambda, d.mass_lambda[link.v + k]);
  }
  if (link.effects & kPositionServo) adjoint_targets<K>(model, a, link, d.lambda, d.target);
  if (link.effects & kDryFriction) adjoint_dry_friction<K>(model, a, link, d.lambda, d.dry_anchor);
}

/// Computes M λ, ν and the targets' cotangents, leaves first.
template <class N>
void adjoint_inward(const ModelView& model, const StageArgs<N>& a, const AdjointArgs<N>& d) {
  for (int i = 0; i < model.nv; ++i) d.target[i] = d.dry_anchor[i] = N(0.0);
  for (int i = model.n_links - 1; i >= 0; --i) {
    const Link& link = model.links[i];
    const LinkScratch<N>& s = a.links[i];
    LinkAdjoint<N>& o = d.links[i];
    Vec6<N> projected = o.V_bar;
    if (!link.never_rotates) {
      o.V_bar += cross_wrench(o.rate, o.A_bar);
      projected = o.V_bar - cross_wrench(s.V, o.A_bar);
    }
    with_kind(link.kind, [&]<JointKind K>() {
      N Ct_lambda[3];
      for (int k = 0; k < dofs(K); ++k) {
        const N mass = project<K>(link, k, o.A_bar);
        d.mass_lambda[link.v + k] = mass;
        Ct_lambda[k] = mul_add(a.c0_over_h, mass, project<K>(link, k, projected));
      }
      adjoint_effects<K>(model, a, d, link, Ct_lambda);
      for (int k = 0; k < dofs(K); ++k) d.nu[link.v + k] = d.v_bar[link.v + k] - Ct_lambda[k];
    });
    if (link.parent < 0) continue;
    LinkAdjoint<N>& parent = d.links[link.parent];
    parent.V_bar += wrench_to_parent(link, s.local, o.V_bar);
    parent.A_bar += wrench_to_parent(link, s.local, o.A_bar);
  }
}

template <class N>
void add3(N* to, const Vec3<N>& x) {
  to[0] += x.x, to[1] += x.y, to[2] += x.z;
}
/// A rotation vector x, |x| < π, with what its inverse Jacobians need.
template <class N>
RotationVector<N> with_inverse_jacobians(const N* x) {
  RotationVector<N> r = rotation_vector<false>(quaternion_exp(Vec3<N>{x[0], x[1], x[2]}));
  r.phi = {x[0], x[1], x[2]};
  return r;
}

/// ∂v/∂q_k at a fixed newest pose. For the centre it is -V_x J_l⁻¹(x) - Σ (ρ/h) J_r(x) J_l⁻¹(y).
/// For an older state it is (ρ/h) J_r(x) J_r⁻¹(y), y = q ⊖ q_centre.
template <class N>
void adjoint_turning_history(const StageArgs<N>& a, const AdjointArgs<N>& d, const Link& link,
                             const LinkScratch<N>& o) {
  const int v = link.v;
  const Vec3<N> nu = {d.nu[v], d.nu[v + 1], d.nu[v + 2]};
  const RotationVector<N> x = with_inverse_jacobians(a.x + v);
  add3(d.q_centre + v, -(inverse_right_jacobian(x) * transposed_times(o.chart_rate, nu)));
  for (int k = 0; k < d.history.count; ++k) {
    const OlderState<N>& older = d.history.older[k];
    if (older.rho == 0) continue;
    const RotationVector<N> y = with_inverse_jacobians(older.difference + v);
    const Vec3<N> z = N(older.rho) * a.inverse_h * transposed_times(o.chart, nu);
    add3(d.q_centre + v, -(inverse_right_jacobian(y) * z));
    add3(older.q + v, inverse_left_jacobian(y) * z);
  }
}

/// Adds the contributions of ν and M λ to the cotangents of the states that the stage depends on.
template <class N>
void adjoint_history(const ModelView& model, const StageArgs<N>& a, const AdjointArgs<N>& d) {
  const StageHistory<N>& h = d.history;
  N from_centre = a.c0_over_h;
  for (int i = 0; i < h.count; ++i) from_centre = from_centre + N(h.older[i].rho) * a.inverse_h;
  from_centre = -from_centre;
  const N centre_factor = N(-h.s_centre) * a.inverse_h;
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    const bool turning = link.kind == JointKind::spherical;
    if (turning) adjoint_turning_history(a, d, link, a.links[i]);
    for (int k = link.v; k < link.v + dofs(link.kind); ++k) {
      if (!turning) d.q_centre[k] = mul_add(from_centre, d.nu[k], d.q_centre[k]);
      d.v_centre[k] = mul_add(centre_factor, d.mass_lambda[k], d.v_centre[k]);
      for (int j = 0; j < h.count; ++j) {
        const OlderState<N>& o = h.older[j];
        if (!turning && o.rho != 0) o.q[k] = mul_add(N(o.rho) * a.inverse_h, d.nu[k], o.q[k]);
        if (o.s != 0) o.v[k] = mul_add(N(-o.s) * a.inverse_h, d.mass_lambda[k], o.v[k]);
      }
    }
  }
}

/// Computes from λ: ν, M λ, the cotangents of the motors' targets and those of the history.
template <class N>
void adjoint_products(const ModelView& model, const StageArgs<N>& a, const AdjointArgs<N>& d) {
  expand_transmissions(model, a, d.lambda);
  adjoint_outward(model, a, d);
  adjoint_contacts(model, a, d);
  adjoint_inward(model, a, d);
  hand_on_rates(model, a, d.nu);
  hand_on_polynomial_rates(model, a, d.nu);
  without_negative_zeros(d.nu, model.nv);
  without_negative_zeros(d.mass_lambda, model.nv);
  adjoint_history(model, a, d);
}

}  // namespace tangere::kernels
