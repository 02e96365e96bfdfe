// SPDX-License-Identifier: Apache-2.0
// The analytic Jacobian A = ∂g/∂x = G_q J + C V_x after residual<true>() has filled the scratch.
//
// Inertial part, composites Iᶜ, Bᶜ, Fᶜ of subtrees (Fᶜ is the F of the inward sweep), for dof i and ancestor-or-self j:
//   ∂ID_j/∂q_i = S_jᵀ(Bᶜ Ψ̇_i + Iᶜ Ψ̈_i + [j ≠ i] Fᶜ ×̄* S_i)     ∂ID_i/∂q_j = S_iᵀ(Bᶜ Ψ̇_j + Iᶜ Ψ̈_j)
//   ∂ID_j/∂v_i = S_jᵀ(Bᶜ S_i + Iᶜ (Ψ̇_i + Ṡ_i))                  ∂ID_i/∂v_j = S_iᵀ(Bᶜ S_j + Iᶜ (Ψ̇_j + Ṡ_j))
//   M_ji = S_jᵀ Iᶜ S_i
// B of a rigid body acts on the angular part alone, (bias; -2 [momentum]), and stays so when moved and summed.
#pragma once

#include "kernels/residual-inl.hpp"

namespace tangere::kernels {

template <class N>
Vec6<N> bias_times(const LinkScratch<N>& o, const Vec6<N>& m) {
  return {o.bias * m.a, N(-2.0) * cross(o.momentum, m.a)};
}
/// F ×̄* m = m ×* F.
template <class N>
Vec6<N> turned(const Vec6<N>& f, const Vec6<N>& m) {
  return cross_wrench(m, f);
}

/// Own bias B = V×* I - I V× + (I V) ×̄*: upper left W J - J W - (U C + C U) - [h], W = [ω], U = [v], C = [moment].
template <class N>
void own_bias(LinkScratch<N>& o) {
  const Vec6<N> h = inertia_times(o.mass, o.moment, o.inertia, o.V);
  const Mat3<N> uc = cross_columns(o.V.l, skew(o.moment));
  o.bias = cross_columns(o.V.a, o.inertia) - times_skew(o.inertia, o.V.a) - (uc + transpose(uc)) - skew(h.a);
  o.momentum = h.l;
}

/// Adds a link's composites to its parent's.
template <class N>
void add_composites(const Link& link, const LinkScratch<N>& o, LinkScratch<N>& p) {
  p.mass += o.mass;
  Vec3<N> moment = o.moment, momentum = o.momentum;
  Mat3<N> inertia = o.inertia, bias = o.bias;
  if (link.turned) {
    const Mat3<N>& R = o.local.R;
    const Mat3<N> Rt = transpose(R);
    moment = R * moment;
    momentum = R * momentum;
    inertia = R * inertia * Rt;
    bias = R * bias * Rt;
  }
  if (link.placed) {
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

/// Own inertia and bias of each link, then sums over subtrees. Of a link that never turns only the mass is asked for.
template <class N>
void composite_sweep(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    LinkScratch<N>& o = a.links[i];
    o.mass = N(link.mass);
    o.moment = broadcast<N>(link.moment);
    o.momentum = zero3<N>();
    if (link.still) continue;
    o.inertia = broadcast<N>(link.inertia);
    if (link.massive) {
      own_bias(o);
    } else {
      o.bias = zero33<N>();
    }
  }
  for (int i = model.n_links - 1; i >= 0; --i) {
    const int parent = model.links[i].parent;
    if (parent < 0) continue;
    if (model.links[parent].still) {
      a.links[parent].mass += a.links[i].mass;
    } else {
      add_composites(model.links[i], a.links[i], a.links[parent]);
    }
  }
}

/// Ψ̇, Ψ̈, Ṡ of every dof.
template <class N>
void motion_rates(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    LinkScratch<N>& o = a.links[i];
    for (int k = 0; k < dofs(link.kind); ++k) {
      Vec6<N>&pd = o.psi_dot[k], &pdd = o.psi_ddot[k], &sd = o.s_dot[k];
      pd = pdd = sd = zero6<N>();
      if (slides(link.kind)) {
        if (link.still) continue;
        pd.l = cross_axis(link, k, o.Vp.a);
        pdd.l = cross_axis(link, k, o.Ap.a) + cross(o.Vp.a, pd.l);
        sd.l = cross_axis(link, k, o.V.a);
        continue;
      }
      sd = {cross_axis(link, k, o.V.a), cross_axis(link, k, o.V.l)};
      pd.l = cross_axis(link, k, o.Vp.l);
      pdd.l = cross_axis(link, k, o.Ap.l);
      if (link.steady) continue;
      pd.a = cross_axis(link, k, o.Vp.a);
      pdd.a = cross_axis(link, k, o.Ap.a) + cross(o.Vp.a, pd.a);
      pdd.l += cross(o.Vp.l, pd.a) + cross(o.Vp.a, pd.l);
    }
  }
}

/// Wrenches of one dof's column by q, v and a, and of its row: Bᶜᵀ S.
template <class N>
struct DofWrenches {
  Vec6<N> by_q, by_v, by_a, row;
};

/// I m of a motion without angular part.
template <class N>
Vec6<N> inertia_times_linear(const LinkScratch<N>& o, const Vec3<N>& l) {
  return {cross(o.moment, l), o.mass * l};
}

template <class N>
DofWrenches<N> dof_wrenches(const Link& link, const LinkScratch<N>& o, int k) {
  DofWrenches<N> w;
  const Vec6<N> rate = o.psi_dot[k] + o.s_dot[k];
  if (slides(link.kind)) {
    w.by_q = w.by_v = zero6<N>();
    w.by_a = {cross_axis(link, k, o.moment), o.mass * joint_axis<N>(link, k)};
    w.row = {N(2.0) * cross_axis(link, k, o.momentum), zero3<N>()};
    if (link.still) return w;
    w.by_v = inertia_times_linear(o, rate.l);
    w.by_q = inertia_times_linear(o, o.psi_ddot[k].l);
    return w;
  }
  w.by_a = {times_axis(link, k, o.inertia), -cross_axis(link, k, o.moment)};
  w.row = {times_axis(link, k, transpose(o.bias)), zero3<N>()};
  w.by_v = inertia_times(o.mass, o.moment, o.inertia, rate) +
           Vec6<N>{times_axis(link, k, o.bias), N(-2.0) * cross_axis(link, k, o.momentum)};
  if (link.steady) {
    w.by_q = inertia_times_linear(o, o.psi_ddot[k].l);
  } else {
    w.by_q = bias_times(o, o.psi_dot[k]) + inertia_times(o.mass, o.moment, o.inertia, o.psi_ddot[k]);
  }
  return w;
}

/// Row and column of dof d in the ancestors of its link.
template <class N>
void ancestor_entries(const ModelView& model, const StageArgs<N>& a, const Link& link, int d, DofWrenches<N>& w) {
  const int n = model.nv;
  const Frame<N>* x = &a.links[&link - model.links].local;
  const Link* child = &link;
  for (int up = link.parent; up >= 0; up = model.links[up].parent) {
    const Link& ancestor = model.links[up];
    const LinkScratch<N>& p = a.links[up];
    w.by_a = wrench_to_parent(*child, *x, w.by_a);
    w.by_q = wrench_to_parent(*child, *x, w.by_q);
    w.by_v = wrench_to_parent(*child, *x, w.by_v);
    w.row = wrench_to_parent(*child, *x, w.row);
    for (int j = 0; j < dofs(ancestor.kind); ++j) {
      const int e = ancestor.v + j;
      const int column = model.pattern.slot[e * n + d], row = model.pattern.slot[d * n + e];
      const N m = project(ancestor, j, w.by_a);
      a.G_q[column] = project(ancestor, j, w.by_q);
      a.C[column] = mul_add(a.c0_over_h, m, project(ancestor, j, w.by_v));
      N row_v = project(ancestor, j, w.row);
      if (!ancestor.still) {
        a.G_q[row] = dot(w.row, p.psi_dot[j]) + dot(w.by_a, p.psi_ddot[j]);
        row_v += dot(w.by_a, p.psi_dot[j] + p.s_dot[j]);
      }
      a.C[row] = mul_add(a.c0_over_h, m, row_v);
    }
    x = &p.local;
    child = &ancestor;
  }
}

/// Fills G_q and C with the inertial part, and the diagonal of M.
template <class N>
void inertial_jacobian(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    const LinkScratch<N>& o = a.links[i];
    for (int k = 0; k < dofs(link.kind); ++k) {
      const int d = link.v + k;
      DofWrenches<N> w = dof_wrenches(link, o, k);
      a.mass_diagonal[d] = project(link, k, w.by_a);
      for (int j = 0; j < dofs(link.kind); ++j) {
        const int at = model.pattern.slot[(link.v + j) * model.nv + d];
        a.G_q[at] = project(link, j, w.by_q);
        a.C[at] = mul_add(a.c0_over_h, project(link, j, w.by_a), project(link, j, w.by_v));
      }
      if (link.parent < 0) continue;
      const Vec3<N> s = joint_axis<N>(link, k);
      if (slides(link.kind)) {
        w.by_q.a += cross(s, o.F.l);
      } else {
        w.by_q += Vec6<N>{cross(s, o.F.a), cross(s, o.F.l)};
      }
      ancestor_entries(model, a, link, d, w);
    }
  }
}

/// Columns of one body of a pair, in body 1's axes: S and Ψ̇ of each dof that moves it. Returns how many.
/// `in_1`: frame of the body's link in body 1, null for body 1 itself.
template <class N>
int body_columns(const ModelView& model, const StageArgs<N>& a, int body, const Frame<N>* in_1, MotionColumn<N>* out) {
  int count = 0;
  Frame<N> x;
  if (in_1 != nullptr) x = *in_1;
  bool moved = in_1 != nullptr;
  for (int i = body; i >= 0; i = model.links[i].parent) {
    const Link& link = model.links[i];
    const LinkScratch<N>& o = a.links[i];
    for (int k = 0; k < dofs(link.kind); ++k, ++count) {
      MotionColumn<N>& c = out[count];
      c.dof = link.v + k;
      c.linear = slides(link.kind);
      c.rates = !link.still;
      c.unit = moved || dofs(link.kind) == 1 ? -1 : k;
      c.S = zero6<N>();
      const Vec3<N> axis = moved ? times_axis(link, k, x.R) : joint_axis<N>(link, k);
      if (c.linear) {
        c.S.l = axis;
      } else {
        c.S.a = axis;
        if (moved) c.S.l = cross(x.p, axis);
      }
      c.psi_dot = moved && c.rates ? motion_to_parent(x, o.psi_dot[k]) : o.psi_dot[k];
    }
    if (link.parent < 0) break;
    // parent in body 1 = (link in body 1) (parent in link)
    const Frame<N> up = {transpose(o.local.R), -transposed_times(o.local.R, o.local.p)};
    x = moved ? kernels::compose(x, up) : up;
    moved = true;
  }
  return count;
}

template <class N>
Vec6<N> times(const Mat3<N> (&m)[2][2], const Vec6<N>& v, bool linear) {
  if (linear) return {m[0][1] * v.l, m[1][1] * v.l};
  return {m[0][0] * v.a + m[0][1] * v.l, m[1][0] * v.a + m[1][1] * v.l};
}
template <class N>
Vec6<N> times(const Mat3<N> (&m)[2][2], const MotionColumn<N>& c) {
  if (c.unit < 0) return times(m, c.S, c.linear);
  const int part = c.linear ? 1 : 0, k = c.unit;
  return {{m[0][part].m[0][k], m[0][part].m[1][k], m[0][part].m[2][k]},
          {m[1][part].m[0][k], m[1][part].m[1][k], m[1][part].m[2][k]}};
}
/// Sᵀ f.
template <class N>
N power(const MotionColumn<N>& c, const Vec6<N>& f) {
  if (c.unit < 0) return c.linear ? dot(c.S.l, f.l) : dot(c.S, f);
  const Vec3<N>& part = c.linear ? f.l : f.a;
  return c.unit == 0 ? part.x : c.unit == 1 ? part.y : part.z;
}

/// Contact part of G_q and C: δw₁ = K ε + D δW per column, ε = S for dofs of body 2 and -S for dofs of body 1; rows of
/// body 1 take -δw₁, rows of body 2 the reaction. Dofs that move both bodies alike have ε = 0 and only appear as rows.
/// `Z`: twist of body 2 in body 1's axes, null when it is fixed in the world.
template <class N>
void contact_jacobian(const ModelView& model, const StageArgs<N>& a, int body1, int body2, const ContactScratch<N>& o,
                      const Vec6<N>* Z) {
  const int n = model.nv;
  MotionColumn<N>* columns = a.columns;
  const int n1 = body_columns<N>(model, a, body1, nullptr, columns);
  const int total = n1 + (body2 < 0 ? 0 : body_columns<N>(model, a, body2, &o.link2_in_1, columns + n1));
  const auto shared = [&](int c) {
    for (int k = c < n1 ? n1 : 0, end = c < n1 ? total : n1; k < end; ++k)
      if (columns[k].dof == columns[c].dof) return true;
    return false;
  };
  for (int i = 0; i < total; ++i) {
    if (shared(i)) continue;
    const MotionColumn<N>& c = columns[i];
    const Vec6<N> by_v = times(o.sums.d, c);
    Vec6<N> by_q = times(o.sums.k, c);
    if (Z != nullptr || c.rates) {
      Vec6<N> rate = c.psi_dot;
      if (Z != nullptr) {
        rate.l -= cross(Z->a, c.S.l);
        if (!c.linear) rate -= {cross(Z->a, c.S.a), cross(Z->l, c.S.a)};
      }
      by_q += times(o.sums.d, rate, c.linear);
    }
    const Vec6<N> turn = c.linear ? Vec6<N>{cross(c.S.l, o.sums.wrench.l), zero3<N>()} : turned(o.sums.wrench, c.S);
    const Vec6<N> reaction = by_q - turn;
    for (int r = 0; r < total; ++r) {
      const int at = model.pattern.slot[columns[r].dof * n + c.dof];
      const N q = power(columns[r], r < n1 ? by_q : reaction), v = power(columns[r], by_v);
      if ((r < n1) == (i < n1)) {
        a.G_q[at] += q;
        a.C[at] += v;
      } else {
        a.G_q[at] -= q;
        a.C[at] -= v;
      }
    }
  }
}

/// A = G_q J + C V_x, one joint's columns at a time.
template <class N>
void assemble(const ModelView& model, const StageArgs<N>& a) {
  const int n = model.nv;
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    const LinkScratch<N>& o = a.links[i];
    for (int row = 0; row < n; ++row) {
      const int at = model.pattern.slot[row * n + link.v];
      if (at < 0) continue;
      if (link.kind != JointKind::spherical) {
        for (int k = 0; k < dofs(link.kind); ++k) {
          const int e = model.pattern.slot[row * n + link.v + k];
          a.A[e] = mul_add(a.c0_over_h, a.C[e], a.G_q[e]);
        }
        continue;
      }
      const int e[3] = {at, model.pattern.slot[row * n + link.v + 1], model.pattern.slot[row * n + link.v + 2]};
      const Vec3<N> q = {a.G_q[e[0]], a.G_q[e[1]], a.G_q[e[2]]};
      const Vec3<N> v = {a.C[e[0]], a.C[e[1]], a.C[e[2]]};
      const Vec3<N> sum = transposed_times(o.chart, q) + transposed_times(o.chart_rate, v);
      a.A[e[0]] = sum.x;
      a.A[e[1]] = sum.y;
      a.A[e[2]] = sum.z;
    }
  }
}

/// G_q, C, A at the x that residual<true>() has just been evaluated at.
template <class N>
void jacobian(const ModelView& model, const StageArgs<N>& a) {
  for (int e = 0; e < model.pattern.entries; ++e) a.G_q[e] = a.C[e] = N(0.0);
  composite_sweep(model, a);
  motion_rates(model, a);
  inertial_jacobian(model, a);
  for (int d = 0; d < model.nv; ++d) {
    N& c = a.C[model.pattern.slot[d * model.nv + d]];
    c = c + N(model.damping[d]);
  }
  for (int k = 0; k < model.n_pairs; ++k) {
    const PairContact& pair = model.pairs[k];
    contact_jacobian(model, a, pair.link1, pair.link2, a.contacts[k], pair.link2 < 0 ? nullptr : &a.contacts[k].Z);
  }
  for (int k = 0; k < model.n_grounds; ++k)
    contact_jacobian<N>(model, a, model.grounds[k].link, -1, a.contacts[model.n_pairs + k], nullptr);
  assemble(model, a);
}

}  // namespace tangere::kernels
