// SPDX-License-Identifier: Apache-2.0
// What one evaluation of the step's residual reads and writes, over any number type.
//
// Unknown x (nv), centre c: q = c ⊕ x.  ẋ = (c₀x + r)/h;  v = J(x)ẋ;  a = (c₀v + s)/h
//   g = ID(q, v, a) - τ - Σ J_cᵀ f_c;   A = ∂g/∂x = G_q J + C V_x,   C = G_v + (c₀/h) M     (docs/solver.md)
#pragma once

#include "kernels/model_view.hpp"
#include "kernels/pair_contact.hpp"
#include "kernels/so3.hpp"

namespace tangere::kernels {

/// Scratch of one link: everything the sweeps pass on.
template <class N>
struct LinkScratch {
  Frame<N> local;     ///< in the parent link
  Frame<N> world;
  Vec6<N> Vp, Ap;     ///< parent's twist and acceleration, in this link's axes
  Vec6<N> V, A;       ///< twist; acceleration, gravity included as -g at the base
  Vec6<N> F;          ///< wrench through the joint: inertial minus external, of the whole subtree
  Mat3<N> chart;      ///< spherical: J = J_r(x)
  Mat3<N> chart_rate; ///< spherical: V_x = (c₀/h) J + D(x, ẋ)
  N mass;             ///< composite inertia of the subtree: mass, moment, inertia about this origin
  Vec3<N> moment;
  Mat3<N> inertia;
  Mat3<N> bias;       ///< composite B: B m = (bias m.a; -2 momentum × m.a)
  Vec3<N> momentum;
  Vec6<N> psi_dot[3], psi_ddot[3], s_dot[3];  ///< per dof: Ψ̇ = Vp × S, Ψ̈ = Ap × S + Vp × Ψ̇, Ṡ = V × S
};

/// Scratch of one contact pair: relative motion and sums. Ground contacts use `sums` alone.
template <class N>
struct ContactScratch {
  Frame<N> link2_in_1;  ///< G of the links
  Frame<N> shape_in_1;  ///< G of the shape
  Vec6<N> Z;            ///< twist of body 2 in body 1's axes, at its origin
  Vec6<N> W;            ///< Z - V₁
  PairSums<N> sums;
};

/// Candidate points of a pair, per lane, and the pose they were found at.
template <class N>
struct CandidateList {
  const N* points;    ///< (count, 3) in body 1's axes; lanes with fewer hold far points
  int count;
  const N* reference; ///< (12) shape_in_1 when the list was made: R row-major, then p
  double margin;      ///< a point missing from the list was at least this far away [m]
};

template <class N>
struct StageArgs {
  const N* centre;   ///< (nq) quaternions w x y z
  const N* x;        ///< (nv)
  const N* r;        ///< (nv) history of ẋ
  const N* s;        ///< (nv) history of a
  const N* tau;      ///< (nv) actuator force
  N c0_over_h, inverse_h;
  const double* block;  ///< of the batch, for parameters that vary
  int group;            ///< 0 or 1: which half of the block
  const CandidateList<N>* candidates;  ///< (n_pairs)
  // scratch
  LinkScratch<N>* links;        ///< (n_links)
  ContactScratch<N>* contacts;  ///< (n_pairs + n_grounds)
  Vec6<N>* columns;             ///< (4 nv) motion columns of a pair
  // results
  N* v;              ///< (nv)
  N* g;              ///< (nv) residual [N, N m]
  N* force_scale;    ///< (nv) sum of the magnitudes of actuator, damping and contact forces
  N* mass_diagonal;  ///< (nv)
  N* G_q;            ///< (entries)
  N* C;              ///< (entries)
  N* A;              ///< (entries)
  N* excess;         ///< (1) how far some pair moved beyond its list's margin [m]; > 0: rebuild and evaluate again
};

/// Column k of a joint's motion subspace.
template <class N>
Vec6<N> motion_column(const Link& link, int k) {
  const N zero(0.0), one(1.0);
  const Vec3<N> unit = {k == 0 ? one : zero, k == 1 ? one : zero, k == 2 ? one : zero};
  switch (link.kind) {
    case JointKind::revolute: return {broadcast<N>(link.axis), zero3<N>()};
    case JointKind::prismatic: return {zero3<N>(), broadcast<N>(link.axis)};
    case JointKind::translational: return {zero3<N>(), unit};
    case JointKind::spherical: break;
  }
  return {unit, zero3<N>()};
}

/// S_kᵀ f.
template <class N>
N project(const Link& link, int k, const Vec6<N>& f) {
  const auto component = [k](const Vec3<N>& a) { return k == 0 ? a.x : k == 1 ? a.y : a.z; };
  switch (link.kind) {
    case JointKind::revolute: return dot(broadcast<N>(link.axis), f.a);
    case JointKind::prismatic: return dot(broadcast<N>(link.axis), f.l);
    case JointKind::translational: return component(f.l);
    case JointKind::spherical: break;
  }
  return component(f.a);
}

/// A parameter of the scene in these lanes.
template <class N>
struct ParameterLoad {
  static N load(const Parameter& p, const double* block, int group) {
    return p.row < 0 ? N(p.value) : N(*row_of(block, p.row, group));
  }
};
template <class Arch>
struct ParameterLoad<Lanes<Arch>> {
  static Lanes<Arch> load(const Parameter& p, const double* block, int group) {
    return p.row < 0 ? Lanes<Arch>(p.value) : load_lanes<Arch>(row_of(block, p.row, group));
  }
};
template <class N>
LawParameters<N> load_law(const ContactParameters& p, ContactLaw law, double ramp, const double* block, int group) {
  const auto one = [&](const Parameter& x) { return ParameterLoad<N>::load(x, block, group); };
  return {one(p.kn), one(p.kt), one(p.mu), one(p.damping), law, ramp};
}

}  // namespace tangere::kernels
