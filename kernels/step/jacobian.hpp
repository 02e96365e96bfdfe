// SPDX-License-Identifier: Apache-2.0
// The analytic Jacobian A = ∂g/∂x: the terms of inertia and damping, then those of every contact.
//
// Contacts: δw₁ = K ε + D δW per column of the two bodies' joints, in body 1's axes. ε = S for dofs
// of body 2 and -S for dofs of body 1. Rows of body 1 take -δw₁. Rows of body 2 take the reaction
// δw₁ - w₁ × S. Dofs that move both bodies alike have ε = 0 and only appear as rows.
#pragma once

#include "kernels/step/transmission_jacobian.hpp"

namespace tangere::kernels {

/// Writes the columns of one body of a pair, in body 1's axes, joint by joint from the body to the
/// root. Returns the number of joints. `in_1`: frame of the body's link in body 1, null for body 1
/// itself.
template <class N>
int body_columns(const ModelView& model, const StageArgs<N>& a, int body, const Frame<N>* in_1,
                 JointColumns<N>* out) {
  int count = 0;
  Frame<N> x;
  bool moved = in_1 != nullptr;
  if (moved) x = *in_1;
  for (int i = body; i >= 0; i = model.links[i].parent, ++count) {
    const Link& link = model.links[i];
    const LinkScratch<N>& o = a.links[i];
    JointColumns<N>& c = out[count];
    c.link = i;
    c.rates = !link.never_rotates;
    c.own = !moved;
    with_kind(link.kind, [&]<JointKind K>() {
      for (int k = 0; k < dofs(K); ++k) {
        const Vec3<N> axis = moved ? times_axis<K>(link, k, x.R) : joint_axis<K, N>(link, k);
        if constexpr (slides(K)) {
          c.S[k].l = axis;
        } else {
          c.S[k] = {axis, moved ? cross(x.p, axis) : zero3<N>()};
        }
        if (c.rates) c.psi_dot[k] = moved ? motion_to_parent(x, o.psi_dot[k]) : o.psi_dot[k];
      }
    });
    if (link.parent < 0) return count + 1;
    // parent in body 1 = (link in body 1) (parent in link)
    const Frame<N> up = {transpose(o.local.R), -transposed_times(o.local.R, o.local.p)};
    x = moved ? compose(x, up) : up;
    moved = true;
  }
  return count;
}

/// Returns M m. Leaves out the angular part of m where it is zero.
template <bool Linear, class N>
Vec6<N> times(const Mat3<N> (&m)[2][2], const Vec6<N>& v) {
  if constexpr (Linear) return {m[0][1] * v.l, m[1][1] * v.l};
  return {m[0][0] * v.a + m[0][1] * v.l, m[1][0] * v.a + m[1][1] * v.l};
}
/// Returns M S_k.
template <JointKind K, class N>
Vec6<N> times_column(const Mat3<N> (&m)[2][2], const JointColumns<N>& c, int k) {
  if (dofs(K) == 1 || !c.own) return times<slides(K)>(m, c.S[k]);
  constexpr int part = slides(K) ? 1 : 0;
  return {{m[0][part].m[0][k], m[0][part].m[1][k], m[0][part].m[2][k]},
          {m[1][part].m[0][k], m[1][part].m[1][k], m[1][part].m[2][k]}};
}

/// Computes δw₁ and the reaction by x of one joint's columns, without sign. `Z`: twist of body 2 in
/// body 1's axes, null when it is fixed in the world.
template <JointKind K, class N>
void column_wrenches(const Link& link, const LinkScratch<N>& scratch, const ContactScratch<N>& o,
                     const JointColumns<N>& c, const Vec6<N>* Z, const N& c0_over_h, Vec6<N>* d_dx,
                     Vec6<N>* reaction) {
  Vec6<N> d_dq[3], d_dv[3], turn[3];
  for (int k = 0; k < dofs(K); ++k) {
    d_dv[k] = times_column<K>(o.sums.d, c, k);
    d_dq[k] = times_column<K>(o.sums.k, c, k);
    const Vec6<N>& S = c.S[k];
    if (Z != nullptr || c.rates) {
      Vec6<N> rate = c.rates ? c.psi_dot[k] : zero6<N>();
      if (Z != nullptr) {
        rate.l -= cross(Z->a, S.l);
        if constexpr (!slides(K)) rate -= {cross(Z->a, S.a), cross(Z->l, S.a)};
      }
      d_dq[k] += times<slides(K)>(o.sums.d, rate);
    }
    if (Z != nullptr)
      turn[k] =
          slides(K) ? Vec6<N>{cross(S.l, o.sums.wrench.l), zero3<N>()} : turned(o.sums.wrench, S);
  }
  combine<K>(link, scratch, c0_over_h, d_dq, d_dv, d_dx);
  if (Z == nullptr) return;
  const Vec6<N> none[3] = {zero6<N>(), zero6<N>(), zero6<N>()};
  combine<K>(link, scratch, c0_over_h, turn, none, reaction);
  for (int k = 0; k < dofs(K); ++k) reaction[k] = d_dx[k] - reaction[k];
}

/// Adds ± Sᵀ w for every row of one joint and every column of another.
template <JointKind K, class N>
void add_block(const ModelView& model, const StageArgs<N>& a, const JointColumns<N>& row,
               const Link& column, const Vec6<N>* wrench, bool positive) {
  const int first = model.links[row.link].v;
  const N sign(positive ? 1.0 : -1.0);
  const EntryRows<N> entries = entries_at(model, a, first, column.v);
  for (int k = 0; k < dofs(column.kind); ++k) {
    for (int j = 0; j < dofs(K); ++j) {
      const Vec6<N>& S = row.S[j];
      const Vec6<N>& w = wrench[k];
      N x;
      if (dofs(K) == 3 && row.own) {
        const Vec3<N>& part = slides(K) ? w.l : w.a;
        x = j == 0 ? part.x : j == 1 ? part.y : part.z;
      } else {
        x = slides(K) ? dot(S.l, w.l) : dot(S, w);
      }
      N& entry = entries(j, k);
      entry = mul_add(sign, x, entry);
    }
  }
}

template <class N>
void contact_jacobian(const ModelView& model, const StageArgs<N>& a, int body1, int body2,
                      const ContactScratch<N>& o, const Vec6<N>* Z) {
  JointColumns<N>* joints = a.columns;
  const int n1 = body_columns<N>(model, a, body1, nullptr, joints);
  const int total =
      n1 + (body2 < 0 ? 0 : body_columns<N>(model, a, body2, &o.link2_in_1, joints + n1));
  const auto shared = [&](int c) {
    for (int k = c < n1 ? n1 : 0, end = c < n1 ? total : n1; k < end; ++k)
      if (joints[k].link == joints[c].link) return true;
    return false;
  };
  for (int c = 0; c < total; ++c) {
    if (shared(c)) continue;
    const Link& column = model.links[joints[c].link];
    Vec6<N> d_dx[3], reaction[3];
    with_kind(column.kind, [&]<JointKind K>() {
      column_wrenches<K>(column, a.links[joints[c].link], o, joints[c], Z, a.c0_over_h, d_dx,
                         reaction);
    });
    for (int r = 0; r < total; ++r) {
      const bool first_body = r < n1;
      with_kind(model.links[joints[r].link].kind, [&]<JointKind K>() {
        add_block<K>(model, a, joints[r], column, first_body || Z == nullptr ? d_dx : reaction,
                     first_body == (c < n1));
      });
    }
  }
}

/// Computes A at the x of the last residual<true>().
template <class N>
void jacobian(const ModelView& model, const StageArgs<N>& a) {
  const int entries = a.block_first != nullptr ? a.block_entries : model.pattern.assembled;
  for (int e = 0; e < entries; ++e) a.A[e] = N(0.0);
  composite_sweep(model, a);
  for (int i = 0; i < model.n_links; ++i)
    with_kind(model.links[i].kind, [&]<JointKind K>() { joint_jacobian<K>(model, a, i); });
  bool coupled = false;
  for_each_link_pair(model, a, [&](int k) {
    const LinkPair& pair = model.link_pairs[k];
    if (!a.contacts[k].near) return;
    coupled = coupled || (pair.link1 >= 0 && pair.link2 >= 0);
    contact_jacobian(model, a, pair.link1, pair.link2, a.contacts[k],
                     pair.link2 < 0 ? nullptr : &a.contacts[k].Z);
  });
  if (a.coupled != nullptr) *a.coupled = coupled ? 1 : 0;
  for (int k = 0; k < model.n_grounded; ++k) {
    const ContactScratch<N>& o = a.contacts[model.n_link_pairs + k];
    if (o.near) contact_jacobian<N>(model, a, model.grounded[k].link, -1, o, nullptr);
  }
  for (int k = 0; k < model.n_loops; ++k) {  // the pattern counts them as part of their trees
    const ContactScratch<N>& o = loop_scratch(model, a, k);
    contact_jacobian(model, a, model.loops[k].link1, model.loops[k].link2, o,
                     model.loops[k].link2 < 0 ? nullptr : &o.Z);
  }
  transmission_jacobian(model, a);
  fold_jacobian(model, a);
  without_negative_zeros(a.A, entries);
}

}  // namespace tangere::kernels
