// SPDX-License-Identifier: Apache-2.0
// The inertial part of the Jacobian A = ∂g/∂x, after residual<true>() has filled the scratch. The
// wrenches of a joint's columns by q and by v are combined into wrenches by x before anything is
// projected:
//   A = G_q J + C V_x,  C = G_v + (c₀/h) M;
//       J = 1, V_x = c₀/h except for links with a chart (kernels/step/stage.hpp)
//
// Iᶜ, Bᶜ and Fᶜ are composites of subtrees (Fᶜ is the F of the inward sweep). For dof i and
// ancestor-or-self j:
//   ∂ID_j/∂q_i = S_jᵀ(Bᶜ Ψ̇_i + Iᶜ Ψ̈_i + [j ≠ i] Fᶜ ×̄* S_i)
//       ∂ID_i/∂q_j = S_iᵀ(Bᶜ Ψ̇_j + Iᶜ Ψ̈_j)
//   ∂ID_j/∂v_i = S_jᵀ(Bᶜ S_i + Iᶜ (Ψ̇_i + Ṡ_i))
//       ∂ID_i/∂v_j = S_iᵀ(Bᶜ S_j + Iᶜ (Ψ̇_j + Ṡ_j))
//   M_ji = S_jᵀ Iᶜ S_i
// Lifts: with the composites m', c' of lift times mass and moment, and a gravity in a joint's axes,
//   ∂ID_j/∂q_i += S_jᵀ (c' × l; m' l),  l = a × s_i;  ∂ID_i/∂q_j += (s_i × c' + m' S_i)·(a × s_j)
// where s is the angular part of S.
//
// B of a rigid body acts on the angular part alone, as (bias; -2 [momentum]). It keeps this form
// when moved and summed.
#pragma once

#include "kernels/step/dof_chart.hpp"
#include "kernels/step/residual.hpp"

namespace tangere::kernels {

template <class N>
Vec6<N> bias_times(const LinkScratch<N>& o, const Vec6<N>& m) {
  return {o.bias * m.a, N(-2.0) * cross(o.momentum, m.a)};
}
/// Returns F ×̄* m = m ×* F.
template <class N>
Vec6<N> turned(const Vec6<N>& f, const Vec6<N>& m) {
  return cross_wrench(m, f);
}

/// A body's own bias B = V×* I - I V× + (I V) ×̄*. Its upper left is W J - J W - (U C + C U) - [h],
/// with W = [ω], U = [v], C = [moment].
template <class N>
void own_bias(LinkScratch<N>& o) {
  const Vec6<N> h = inertia_times(o.mass, o.moment, o.inertia, o.V);
  const Mat3<N> uc = cross_columns(o.V.l, skew(o.moment));
  o.bias = cross_columns(o.V.a, o.inertia) - times_skew(o.inertia, o.V.a) - (uc + transpose(uc)) -
           skew(h.a);
  o.momentum = h.l;
}

/// Adds a link's composites to its parent's.
template <class N>
void add_composites(const Link& link, const LinkScratch<N>& o, LinkScratch<N>& p) {
  p.mass += o.mass;
  Vec3<N> moment = o.moment, momentum = o.momentum;
  Mat3<N> inertia = o.inertia, bias = o.bias;
  if (link.may_rotate) {
    const Mat3<N>& R = o.local.R;
    const Mat3<N> Rt = transpose(R);
    moment = R * moment;
    momentum = R * momentum;
    inertia = R * inertia * Rt;
    bias = R * bias * Rt;
  }
  if (link.has_offset) {
    const Vec3<N>& at = o.local.p;
    const Mat3<N> pm = cross_columns(at, skew(moment));  // [p][moment]
    inertia += -(pm + transpose(pm)) - o.mass * cross_columns(at, skew(at));
    bias += N(-2.0) * cross_columns(at, skew(momentum));
    p.moment += o.mass * at;
  }
  p.moment += moment;
  p.momentum += momentum;
  p.inertia += inertia;
  p.bias += bias;
}

/// Sums lifts over subtrees, after the masses of single links are set.
template <class N>
void composite_lifts(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_links; ++i) {
    const N lift(model.links[i].lift);
    a.links[i].lift_mass = lift * a.links[i].mass;
    a.links[i].lift_moment = lift * a.links[i].moment;
  }
  for (int i = model.n_links - 1; i >= 0; --i) {
    if (model.links[i].parent < 0) continue;
    const LinkScratch<N>& o = a.links[i];
    LinkScratch<N>& p = a.links[model.links[i].parent];
    p.lift_mass += o.lift_mass;
    p.lift_moment += o.local.R * o.lift_moment + o.lift_mass * o.local.p;
  }
}

/// Sets the own inertia and bias of each link, then sums them over subtrees. A link that never
/// turns needs only its mass.
template <class N>
void composite_sweep(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    LinkScratch<N>& o = a.links[i];
    const LinkInertia<N> own = load_inertia<N>(link, a.block, a.group);
    o.mass = own.mass;
    o.moment = own.moment;
    o.momentum = zero3<N>();
    if (link.never_rotates) continue;
    o.inertia = own.inertia;
    if (link.has_mass) {
      own_bias(o);
    } else {
      o.bias = zero33<N>();
    }
  }
  if (model.lifted) composite_lifts(model, a);
  for (int i = model.n_links - 1; i >= 0; --i) {
    const int parent = model.links[i].parent;
    if (parent < 0) continue;
    if (model.links[parent].never_rotates) {
      a.links[parent].mass += a.links[i].mass;
    } else {
      add_composites(model.links[i], a.links[i], a.links[parent]);
    }
  }
}

/// Computes Ψ̇, Ψ̈ and Ṡ of a joint's dofs.
template <JointKind K, class N>
void joint_rates(const Link& link, LinkScratch<N>& o) {
  for (int k = 0; k < dofs(K); ++k) {
    Vec6<N>&pd = o.psi_dot[k], &pdd = o.psi_ddot[k], &sd = o.s_dot[k];
    if constexpr (slides(K)) {
      pd.a = pdd.a = sd.a = zero3<N>();
      pd.l = cross_axis<K>(link, k, o.Vp.a);
      pdd.l = cross_axis<K>(link, k, o.Ap.a) + cross(o.Vp.a, pd.l);
      sd.l = cross_axis<K>(link, k, o.V.a);
    } else {
      sd = {cross_axis<K>(link, k, o.V.a), cross_axis<K>(link, k, o.V.l)};
      pd.l = cross_axis<K>(link, k, o.Vp.l);
      pdd.l = cross_axis<K>(link, k, o.Ap.l);
      pd.a = pdd.a = zero3<N>();
      if (link.parent_never_rotates) continue;
      pd.a = cross_axis<K>(link, k, o.Vp.a);
      pdd.a = cross_axis<K>(link, k, o.Ap.a) + cross(o.Vp.a, pd.a);
      pdd.l += cross(o.Vp.l, pd.a) + cross(o.Vp.a, pd.l);
    }
  }
}

/// Combines a joint's columns by q and v into its columns by x. T is a number or a wrench.
template <JointKind K, class T, class N>
void combine(const Link& link, const LinkScratch<N>& o, const N& c0_over_h, const T* d_dq,
             const T* d_dv, T* d_dx) {
  if constexpr (K != JointKind::spherical) {
    if (has_dof_chart<K>(link)) {
      d_dx[0] = along_dof_chart(o, d_dq[0], d_dv[0]);
      return;
    }
    for (int k = 0; k < dofs(K); ++k) d_dx[k] = mul_add(c0_over_h, d_dv[k], d_dq[k]);
  } else {
    for (int k = 0; k < 3; ++k) {
      T sum = o.chart.m[0][k] * d_dq[0];
      for (int j = 1; j < 3; ++j) sum = mul_add(o.chart.m[j][k], d_dq[j], sum);
      for (int j = 0; j < 3; ++j) sum = mul_add(o.chart_rate.m[j][k], d_dv[j], sum);
      d_dx[k] = sum;
    }
  }
}

/// Wrenches of a joint's columns by x and by a, and of its rows, Bᶜᵀ S, which have no force.
template <class N>
struct JointWrenches {
  Vec6<N> d_dx[3], d_da[3];
  Vec3<N> row[3];
  Vec3<N> lift_row[3];  ///< set in models with lifts alone
};

/// Returns I m for a motion without angular part.
template <class N>
Vec6<N> inertia_times_linear(const LinkScratch<N>& o, const Vec3<N>& l) {
  return {cross(o.moment, l), o.mass * l};
}

template <JointKind K, class N>
void joint_wrenches(const ModelView& model, const Link& link, const LinkScratch<N>& o,
                    const N& c0_over_h, JointWrenches<N>& w) {
  if (slides(K) && link.never_rotates) {  // only the force by a matters
    for (int k = 0; k < dofs(K); ++k) {
      w.d_da[k] = {zero3<N>(), o.mass * joint_axis<K, N>(link, k)};
      w.d_dx[k] = {zero3<N>(), (c0_over_h * rate_by_x<K>(link, o, c0_over_h)) * w.d_da[k].l};
      w.row[k] = w.lift_row[k] = zero3<N>();
    }
    return;
  }
  Vec6<N> d_dq[3], d_dv[3];
  for (int k = 0; k < dofs(K); ++k) {
    const Vec6<N> rate = o.psi_dot[k] + o.s_dot[k];
    if constexpr (slides(K)) {
      w.d_da[k] = {cross_axis<K>(link, k, o.moment), o.mass * joint_axis<K, N>(link, k)};
      w.row[k] = N(2.0) * cross_axis<K>(link, k, o.momentum);
      d_dv[k] = inertia_times_linear(o, rate.l);
      d_dq[k] = inertia_times_linear(o, o.psi_ddot[k].l);
    } else {
      w.d_da[k] = {times_axis<K>(link, k, o.inertia), -cross_axis<K>(link, k, o.moment)};
      w.row[k] = times_axis<K>(link, k, transpose(o.bias));
      d_dv[k] =
          inertia_times(o.mass, o.moment, o.inertia, rate) +
          Vec6<N>{times_axis<K>(link, k, o.bias), N(-2.0) * cross_axis<K>(link, k, o.momentum)};
      if (link.parent_never_rotates) {
        d_dq[k] = inertia_times_linear(o, o.psi_ddot[k].l);
      } else {
        d_dq[k] =
            bias_times(o, o.psi_dot[k]) + inertia_times(o.mass, o.moment, o.inertia, o.psi_ddot[k]);
      }
    }
    d_dv[k] = mul_add(c0_over_h, w.d_da[k], d_dv[k]);
    if (!model.lifted) continue;
    if constexpr (slides(K)) {
      w.lift_row[k] = o.lift_mass * joint_axis<K, N>(link, k);
    } else {
      w.lift_row[k] = -cross_axis<K>(link, k, o.lift_moment);
      const Vec3<N> l = cross_axis<K>(link, k, gravity_in(model, o));
      d_dq[k] += Vec6<N>{cross(o.lift_moment, l), o.lift_mass * l};
    }
  }
  combine<K>(link, o, c0_over_h, d_dq, d_dv, w.d_dx);
}

/// Adds the entries of dof d with the dofs of one ancestor's joint. Everything is in the ancestor's
/// axes.
template <JointKind K, class N>
void ancestor_entries(const ModelView& model, const StageArgs<N>& a, int up, int d,
                      const Vec6<N>& d_dx, const Vec6<N>& d_da, const Vec3<N>& row,
                      const Vec3<N>& lift_row) {
  const Link& ancestor = model.links[up];
  const LinkScratch<N>& p = a.links[up];
  const EntryRows<N> column = entries_at(model, a, ancestor.v, d),
                     row_of_dof = entries_at(model, a, d, ancestor.v);
  N q[3], v[3], x[3];
  for (int j = 0; j < dofs(K); ++j) {
    column(j, 0) = project<K>(ancestor, j, d_dx);
    v[j] = a.c0_over_h * project<K>(ancestor, j, d_da);
    q[j] = N(0.0);
    if (slides(K) && ancestor.never_rotates) continue;
    if constexpr (!slides(K)) v[j] += along_axis<K>(ancestor, j, row);
    v[j] += dot(d_da, p.psi_dot[j] + p.s_dot[j]);
    q[j] = dot(row, p.psi_dot[j].a) + dot(d_da, p.psi_ddot[j]);
    if constexpr (!slides(K))
      if (model.lifted) q[j] += dot(lift_row, cross_axis<K>(ancestor, j, gravity_in(model, p)));
  }
  combine<K>(ancestor, p, a.c0_over_h, q, v, x);
  for (int j = 0; j < dofs(K); ++j) row_of_dof(0, j) = x[j];
}

/// Adds the rows and columns that a joint's dofs have with the ancestors of its link.
template <class N>
void walk_ancestors(const ModelView& model, const StageArgs<N>& a, int i, JointWrenches<N>& w) {
  const int first = model.links[i].v, count = dofs(model.links[i].kind);
  for (int up = model.links[i].parent; up >= 0; i = up, up = model.links[up].parent) {
    const Link& link = model.links[i];
    const Frame<N>& local = a.links[i].local;
    for (int k = 0; k < count; ++k) {
      if (!model.links[up].never_rotates) {
        w.d_dx[k] = wrench_to_parent(link, local, w.d_dx[k]);
        w.d_da[k] = wrench_to_parent(link, local, w.d_da[k]);
        if (link.may_rotate) w.row[k] = local.R * w.row[k];
        if (model.lifted && link.may_rotate) w.lift_row[k] = local.R * w.lift_row[k];
      } else if (link.may_rotate) {  // nothing above turns, so torques no longer matter
        w.d_dx[k].l = local.R * w.d_dx[k].l;
        w.d_da[k].l = local.R * w.d_da[k].l;
      }
    }
    with_kind(model.links[up].kind, [&]<JointKind K>() {
      for (int k = 0; k < count; ++k)
        ancestor_entries<K>(model, a, up, first + k, w.d_dx[k], w.d_da[k], w.row[k], w.lift_row[k]);
    });
  }
}

/// Writes the inertial part and the effects of one joint's rows and columns of A, and its diagonal
/// of M.
template <JointKind K, class N>
void joint_jacobian(const ModelView& model, const StageArgs<N>& a, int i) {
  const Link& link = model.links[i];
  LinkScratch<N>& o = a.links[i];
  const EntryRows<N> entry = entries_at(model, a, link.v, link.v);
  if (!link.never_rotates) joint_rates<K>(link, o);
  JointWrenches<N> w;
  joint_wrenches<K>(model, link, o, a.c0_over_h, w);
  for (int j = 0; j < dofs(K); ++j) {
    const int d = link.v + j;
    a.mass_diagonal[d] = project<K>(link, j, w.d_da[j]);
    for (int k = 0; k < dofs(K); ++k) entry(j, k) = project<K>(link, j, w.d_dx[k]);
  }
  if (link.effects != 0) add_effect_entries<K>(model, a, link);
  if (link.parent < 0) return;
  // Moving the joint turns the subtree's wrench as well: S × F, by x.
  for (int k = 0; k < dofs(K); ++k) {
    if constexpr (slides(K)) {
      if (!link.never_rotates) w.d_dx[k].a -= along_x<K>(link, o, cross_axis<K>(link, k, o.F.l));
    } else {
      const Vec3<N> s = K == JointKind::spherical
                            ? Vec3<N>{o.chart.m[0][k], o.chart.m[1][k], o.chart.m[2][k]}
                            : along_x<K>(link, o, joint_axis<K, N>(link, k));
      w.d_dx[k] += Vec6<N>{cross(s, o.F.a), cross(s, o.F.l)};
    }
  }
  walk_ancestors(model, a, i, w);
}

}  // namespace tangere::kernels
