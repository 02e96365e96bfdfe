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

/// Own inertia and bias of each link, then sums over subtrees.
template <class N>
void composite_sweep(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    LinkScratch<N>& o = a.links[i];
    o.mass = N(link.mass);
    o.moment = broadcast<N>(link.moment);
    o.inertia = broadcast<N>(link.inertia);
    if (!link.massive) {
      o.bias = zero33<N>();
      o.momentum = zero3<N>();
      continue;
    }
    // B = V×* I - I V× + (I V) ×̄*: upper left W J - J W - (U C + C U) - [h], W = [ω], U = [v], C = [moment].
    const Vec6<N> h = inertia_times(o.mass, o.moment, o.inertia, o.V);
    const Mat3<N> uc = cross_columns(o.V.l, skew(o.moment));
    o.bias = cross_columns(o.V.a, o.inertia) - times_skew(o.inertia, o.V.a) - (uc + transpose(uc)) - skew(h.a);
    o.momentum = h.l;
  }
  for (int i = model.n_links - 1; i >= 0; --i) {
    const int parent = model.links[i].parent;
    if (parent < 0) continue;
    const LinkScratch<N>& o = a.links[i];
    LinkScratch<N>& p = a.links[parent];
    const Mat3<N>& R = o.local.R;
    const Mat3<N> Rt = transpose(R);
    const Vec3<N>& at = o.local.p;
    const Vec3<N> moment = R * o.moment;
    const Vec3<N> momentum = R * o.momentum;
    const Mat3<N> pm = cross_columns(at, skew(moment));  // [p][moment]
    p.mass += o.mass;
    p.moment += moment + o.mass * at;
    p.inertia += R * o.inertia * Rt - (pm + transpose(pm)) - o.mass * cross_columns(at, skew(at));
    p.bias += R * o.bias * Rt - N(2.0) * cross_columns(at, skew(momentum));
    p.momentum += momentum;
  }
}

/// Ψ̇, Ψ̈, Ṡ of every dof.
template <class N>
void motion_rates(const ModelView& model, const StageArgs<N>& a) {
  for (int i = 0; i < model.n_links; ++i) {
    LinkScratch<N>& o = a.links[i];
    for (int k = 0; k < dofs(model.links[i].kind); ++k) {
      const Vec6<N> S = motion_column<N>(model.links[i], k);
      o.psi_dot[k] = cross_motion(o.Vp, S);
      o.psi_ddot[k] = cross_motion(o.Ap, S) + cross_motion(o.Vp, o.psi_dot[k]);
      o.s_dot[k] = cross_motion(o.V, S);
    }
  }
}

/// Fills G_q and C with the inertial part, and the diagonal of M.
template <class N>
void inertial_jacobian(const ModelView& model, const StageArgs<N>& a) {
  const int n = model.nv;
  const auto slot = [&](int i, int j) { return model.pattern.slot[i * n + j]; };
  for (int i = 0; i < model.n_links; ++i) {
    const Link& link = model.links[i];
    const LinkScratch<N>& o = a.links[i];
    for (int k = 0; k < dofs(link.kind); ++k) {
      const int d = link.v + k;
      const Vec6<N> S = motion_column<N>(link, k);
      // Wrenches of column d (by q, by v, by a), and the rows of d: Iᶜ S and Bᶜᵀ S. All move up to the ancestors.
      Vec6<N> by_a = inertia_times(o.mass, o.moment, o.inertia, S);
      Vec6<N> by_q = bias_times(o, o.psi_dot[k]) + inertia_times(o.mass, o.moment, o.inertia, o.psi_ddot[k]);
      Vec6<N> by_v = bias_times(o, S) + inertia_times(o.mass, o.moment, o.inertia, o.psi_dot[k] + o.s_dot[k]);
      Vec6<N> row_b = {transposed_times(o.bias, S.a) + N(2.0) * cross(o.momentum, S.l), zero3<N>()};
      a.mass_diagonal[d] = project(link, k, by_a);
      for (int j = 0; j < dofs(link.kind); ++j) {
        const int e = link.v + j;
        const int at = slot(e, d);
        a.G_q[at] = project(link, j, by_q);
        a.C[at] = mul_add(a.c0_over_h, project(link, j, by_a), project(link, j, by_v));
      }
      by_q += turned(o.F, S);
      Frame<N> const* x = &o.local;
      for (int up = link.parent; up >= 0; up = model.links[up].parent) {
        const Link& ancestor = model.links[up];
        const LinkScratch<N>& p = a.links[up];
        by_a = wrench_to_parent(*x, by_a);
        by_q = wrench_to_parent(*x, by_q);
        by_v = wrench_to_parent(*x, by_v);
        row_b = wrench_to_parent(*x, row_b);
        for (int j = 0; j < dofs(ancestor.kind); ++j) {
          const int e = ancestor.v + j;
          const N m = project(ancestor, j, by_a);
          a.G_q[slot(e, d)] = project(ancestor, j, by_q);
          a.C[slot(e, d)] = mul_add(a.c0_over_h, m, project(ancestor, j, by_v));
          a.G_q[slot(d, e)] = dot(row_b, p.psi_dot[j]) + dot(by_a, p.psi_ddot[j]);
          const N row_v = project(ancestor, j, row_b) + dot(by_a, p.psi_dot[j] + p.s_dot[j]);
          a.C[slot(d, e)] = mul_add(a.c0_over_h, m, row_v);
        }
        x = &p.local;
      }
    }
  }
}

/// Columns of one body of a pair, in body 1's axes: S and Ψ̇ of each dof that moves it. Returns how many.
template <class N>
int body_columns(const ModelView& model, const StageArgs<N>& a, int body, const Frame<N>& in_1, Vec6<N>* S,
                 Vec6<N>* psi_dot, int* dof) {
  int count = 0;
  Frame<N> x = in_1;  // frame of the current link in body 1
  for (int i = body; i >= 0; i = model.links[i].parent) {
    const Link& link = model.links[i];
    const LinkScratch<N>& o = a.links[i];
    for (int k = 0; k < dofs(link.kind); ++k, ++count) {
      S[count] = motion_to_parent(x, motion_column<N>(link, k));
      psi_dot[count] = motion_to_parent(x, o.psi_dot[k]);
      dof[count] = link.v + k;
    }
    // parent in body 1 = (link in body 1) (parent in link)
    const Frame<N> up = {transpose(o.local.R), -transposed_times(o.local.R, o.local.p)};
    x = compose(x, up);
  }
  return count;
}

template <class N>
Vec6<N> times(const Mat3<N> (&m)[2][2], const Vec6<N>& v) {
  return {m[0][0] * v.a + m[0][1] * v.l, m[1][0] * v.a + m[1][1] * v.l};
}

/// Contact part of G_q and C: δw₁ = K ε + D δW per column; rows of body 1 take -δw₁, rows of body 2 the reaction.
/// Dofs that move both bodies alike have ε = 0 and only appear as rows.
template <class N>
void contact_jacobian(const ModelView& model, const StageArgs<N>& a, int body1, int body2, const ContactScratch<N>& o,
                      const Vec6<N>& Z, int* dof) {
  const int n = model.nv;
  Vec6<N>* S = a.columns;
  Vec6<N>* psi = a.columns + 2 * n;
  const Frame<N> self = {diagonal(N(1.0)), zero3<N>()};
  const int n1 = body_columns(model, a, body1, self, S, psi, dof);
  const int n2 = body2 < 0 ? 0 : body_columns(model, a, body2, o.link2_in_1, S + n1, psi + n1, dof + n1);
  const auto shared = [&](int c) {
    const int begin = c < n1 ? n1 : 0, end = c < n1 ? n1 + n2 : n1;
    for (int k = begin; k < end; ++k)
      if (dof[k] == dof[c]) return true;
    return false;
  };
  for (int c = 0; c < n1 + n2; ++c) {
    if (shared(c)) continue;
    const Vec6<N> epsilon = c < n1 ? -S[c] : S[c];
    const Vec6<N> rate = (c < n1 ? -psi[c] : psi[c]) - cross_motion(Z, epsilon);
    const Vec6<N> by_v = times(o.sums.d, epsilon);
    const Vec6<N> by_q = times(o.sums.k, epsilon) + times(o.sums.d, rate);
    const Vec6<N> reaction = by_q - turned(o.sums.wrench, epsilon);
    for (int r = 0; r < n1 + n2; ++r) {
      const int at = model.pattern.slot[dof[r] * n + dof[c]];
      if (r < n1) {
        a.G_q[at] -= dot(S[r], by_q);
        a.C[at] -= dot(S[r], by_v);
      } else {
        a.G_q[at] += dot(S[r], reaction);
        a.C[at] += dot(S[r], by_v);
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

/// G_q, C, A at the x that residual<true>() has just been evaluated at. `dof`: scratch of 2 nv integers.
template <class N>
void jacobian(const ModelView& model, const StageArgs<N>& a, int* dof) {
  for (int e = 0; e < model.pattern.entries; ++e) a.G_q[e] = a.C[e] = N(0.0);
  composite_sweep(model, a);
  motion_rates(model, a);
  inertial_jacobian(model, a);
  for (int d = 0; d < model.nv; ++d) {
    N& c = a.C[model.pattern.slot[d * model.nv + d]];
    c = c + N(model.damping[d]);
  }
  for (int k = 0; k < model.n_pairs; ++k)
    contact_jacobian(model, a, model.pairs[k].link1, model.pairs[k].link2, a.contacts[k], a.contacts[k].Z, dof);
  for (int k = 0; k < model.n_grounds; ++k)
    contact_jacobian(model, a, model.grounds[k].link, -1, a.contacts[model.n_pairs + k], zero6<N>(), dof);
  assemble(model, a);
}

}  // namespace tangere::kernels
