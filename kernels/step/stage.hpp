// SPDX-License-Identifier: Apache-2.0
// What one evaluation of the step's residual reads and writes, over any number type.
//
// Unknown x (nv), centre c: q = c ⊕ x.  ẋ = (c₀x + r)/h;  v = J(x)ẋ;  a = (c₀v + s)/h
//   g = ID(q, v, a) - τ - Σ J_cᵀ f_c;   A = ∂g/∂x = G_q J + C V_x,   C = G_v + (c₀/h) M
//       (docs/solver.md)
#pragma once

#include "kernels/contact/pair_contact.hpp"
#include "kernels/numbers/dual.hpp"
#include "kernels/numbers/so3.hpp"
#include "kernels/step/model_view.hpp"

namespace tangere::kernels {

/// Scratch of one link: everything that the sweeps pass on.
template <class N>
struct LinkScratch {
  Frame<N> local;  ///< in the parent link
  Frame<N> world;
  Vec6<N> Vp, Ap;      ///< parent's twist and acceleration, in this link's axes
  Vec6<N> V, A;        ///< twist; acceleration, gravity included as -g at the base
  Vec6<N> F;           ///< wrench through the joint: inertial minus external, of the whole subtree
  Mat3<N> chart;       ///< spherical: J = J_r(x); Link::has_chart: p' in (0, 0)
  Mat3<N> chart_rate;  ///< spherical: V_x = (c₀/h) J + D(x, ẋ); Link::has_chart: in (0, 0)
  N mass;  ///< composite of the subtree: mass, mass · centre, inertia about this origin
  Vec3<N> moment;
  Mat3<N> inertia;
  Mat3<N> bias;  ///< composite B: B m = (bias m.a; -2 momentum × m.a)
  Vec3<N> momentum;
  N lift_mass;  ///< composite of the subtree, each part times its lift: mass, mass · centre
  Vec3<N> lift_moment;
  Vec6<N> psi_dot[3], psi_ddot[3],
      s_dot[3];  ///< per dof: Ψ̇ = Vp × S, Ψ̈ = Ap × S + Vp × Ψ̇, Ṡ = V × S
};

/// Scratch of a pair of links: relative motion and sums over all their shapes. Grounded links use
/// `sums` alone.
template <class N>
struct ContactScratch {
  Frame<N> link2_in_1;  ///< G of the links
  Vec6<N> Z;            ///< twist of body 2 in body 1's axes, at its origin
  Vec6<N> W;            ///< Z - V₁
  PairSums<N> sums;     ///< valid where `near`
  bool near;  ///< some lane has a candidate, or a point in the ground; else nothing is added
};

/// What a transmission has to do with one of its dofs.
template <class N>
struct TransmissionColumn {
  N slope;               ///< J: of the length, or of the wrench's power, by the dof's rate
  N rate;                ///< ∂(J v) by the dof's displacement; set by transmission_jacobian()
  Vec3<N> axis, origin;  ///< of the dof and of its joint, world axes; an axis that slides has none
  bool turns;
  Vec3<N> velocity[2];  ///< of the points of a piece relative to its surface, by the dof's rate
  Vec3<N> change[2];    ///< of the slopes: the piece's Hessian times these
};

/// Slopes of a polynomial follower, and its g before it is folded.
template <class N>
struct PolynomialScratch {
  N slope, second, force;
};

/// Candidate points of a pair, per lane, and the pose at which they were found, which all pairs of
/// the same links share.
template <class N>
struct CandidateList {
  const N* points;  ///< (count, 3) in body 1's axes; lanes with fewer hold far points
  int count;
  const N* reference;  ///< (12) link2_in_1 when the list was made: R row-major, then p
  double margin;       ///< a point missing from the list was at least this far away [m]
  const double* own;   ///< (3, stride) candidates of the lane that is evaluated alone, padded to
                       ///< multiples of eight with far points
  int own_count, stride;
  const N* anchors;                     ///< (count, kAnchorNumbers); null without shear springs
  const double* own_anchors;            ///< (kAnchorNumbers, stride) of `own`
  const N* weights = nullptr;           ///< (count) as PairContact::weights; null: none has any
  const double* own_weights = nullptr;  ///< (stride) of `own`
};

/// The dofs of a joint that moves a body of a pair: S and Ψ̇ of each, in body 1's axes.
template <class N>
struct JointColumns {
  Vec6<N> S[3], psi_dot[3];
  int link;
  bool rates;  ///< Ψ̇ is set; else it is zero
  bool own;    ///< the joint of body 1's own link: S_k is the unit vector k
};

template <class N>
struct StageArgs {
  const N* centre;      ///< (nq) quaternions w x y z
  const N* x;           ///< (nv)
  const N* r;           ///< (nv) history of ẋ
  const N* s;           ///< (nv) history of a
  const N* tau;         ///< (nv) actuator force
  const N* target;      ///< (nv) targets of position motors
  const N* dry_anchor;  ///< (nv) as in Stage
  N c0_over_h, inverse_h;
  N friction_tangent = N(1.0);  ///< for derivatives; see kernels/contact/contact_law.hpp
  N normal_share = N(1.0), friction_share = N(1.0);  ///< as in Stage
  const double* block;                               ///< of the batch, for parameters that vary
  int group;                                         ///< 0 or 1: which half of the block
  const CandidateList<N>* candidates;  ///< (n_pairs) those of links that are apart are not
                                       ///< set, but the margin of the first
  unsigned char* apart;                ///< (n_link_pairs) as in Stage; null: none is
  const int* considered = nullptr;     ///< as in Stage
  int n_considered = 0;
  const N *ball_starts = nullptr, *ball_slack = nullptr;  ///< as in Stage
  N* ball_moves = nullptr;
  unsigned char* coupled;   ///< as in Stage; null: not computed
  const N* ground_anchors;  ///< (points with shear springs, kAnchorNumbers)
  /// (link pairs with layers) sums of their layers' contacts, for link pairs that are not apart.
  const PairSums<N>* layer_sums = nullptr;
  const N* faces;  ///< (n_pairs, 3) faces that count in this solve (kernels/step/faces.hpp)
  int lone;  ///< the only lane whose result matters; its contacts are summed across points. -1: all
             ///< lanes matter
  // scratch
  LinkScratch<N>* links;                                  ///< (n_links)
  ContactScratch<N>* contacts;                            ///< (n_link_pairs + n_grounded + n_loops)
  JointColumns<N>* columns;                               ///< (2 n_links) motion columns of a pair
  TransmissionColumn<N>* transmission_columns = nullptr;  ///< (n_transmission_dofs)
  N* transmission_force = nullptr;   ///< (n_transmissions) force on the joint of each [N, N m]
  N* transmission_second = nullptr;  ///< (square of most_transmission_dofs) ∂J
  PolynomialScratch<N>* polynomials = nullptr;  ///< (n_polynomials)
  /// `x` and `r`, of which kinematics() sets those of transmissions (x) and polynomial followers.
  N *own_x = nullptr, *own_r = nullptr;
  std::uint64_t* low_points = nullptr;  ///< scratch of for_each_low_point(); null: it has none
  // results
  N* v;              ///< (nv)
  N* g;              ///< (nv) residual [N, N m]
  N* force_scale;    ///< (nv) sum of the magnitudes of actuator, damping and contact forces
  N* mass_diagonal;  ///< (nv)
  N* A;              ///< (entries)
  const int* block_first = nullptr;  ///< as in Stage
  int block_entries = 0;             ///< as in Stage
  N* excess;   ///< (1) how far some pair moved beyond its list's margin [m]; > 0: rebuild the
               ///< list and evaluate again
  N* between;  ///< (n_link_pairs) as in Stage
};

/// Calls f(k) for every link pair that is considered.
template <class N, class F>
void for_each_link_pair(const ModelView& model, const StageArgs<N>& a, const F& f) {
  if (a.considered == nullptr) {
    for (int k = 0; k < model.n_link_pairs; ++k) f(k);
  } else {
    for (int i = 0; i < a.n_considered; ++i) f(a.considered[i]);
  }
}

/// Entries of A from (i, k) on: (j, l) is row i + j, column k + l, of the same trees as i and k.
template <class N>
struct EntryRows {
  N* A;
  const int* slot;
  int stride;
  N& operator()(int j, int l) const { return A[slot[j * stride + l]]; }
};
template <class N>
EntryRows<N> entries_at(const ModelView& model, const StageArgs<N>& a, int i, int k) {
  const Pattern& p = model.pattern;
  if (p.slot != nullptr) return {a.A, p.slot + i * p.n + k, p.n};
  const int row = p.tree[i], column = p.tree[k], first = p.tree_dof[column],
            width = p.tree_dof[column + 1] - first;
  return {a.A + a.block_first[row * p.n_trees + column],
          p.ordinals + (i - p.tree_dof[row]) * width + (k - first), width};
}

/// Calls `f` with the kind of a joint as a template argument, so that the choice of the kind costs
/// nothing.
template <class F>
void with_kind(JointKind kind, const F& f) {
  switch (kind) {
    case JointKind::revolute: return f.template operator()<JointKind::revolute>();
    case JointKind::prismatic: return f.template operator()<JointKind::prismatic>();
    case JointKind::translational: return f.template operator()<JointKind::translational>();
    case JointKind::spherical: return f.template operator()<JointKind::spherical>();
  }
}

// Column k of a joint's motion subspace is one unit vector s_k: angular where the joint turns,
// linear where it slides.
template <JointKind K, class N>
Vec3<N> joint_axis(const Link& link, int k) {
  if constexpr (dofs(K) == 1) return broadcast<N>(link.axis);
  const N zero(0.0), one(1.0);
  return {k == 0 ? one : zero, k == 1 ? one : zero, k == 2 ? one : zero};
}
/// Returns a · s_k without multiplying by ones and zeros.
template <JointKind K, class N>
N along_axis(const Link& link, int k, const Vec3<N>& a) {
  if constexpr (dofs(K) == 1) return dot(broadcast<N>(link.axis), a);
  return k == 0 ? a.x : k == 1 ? a.y : a.z;
}
/// Returns a × s_k.
template <JointKind K, class N>
Vec3<N> cross_axis(const Link& link, int k, const Vec3<N>& a) {
  if constexpr (dofs(K) == 1) return cross(a, broadcast<N>(link.axis));
  const N zero(0.0);
  if (k == 0) return {zero, a.z, -a.y};
  if (k == 1) return {-a.z, zero, a.x};
  return {a.y, -a.x, zero};
}
/// Returns M s_k.
template <JointKind K, class N>
Vec3<N> times_axis(const Link& link, int k, const Mat3<N>& M) {
  if constexpr (dofs(K) == 1) return M * broadcast<N>(link.axis);
  return {M.m[0][k], M.m[1][k], M.m[2][k]};
}
/// Returns S_kᵀ f.
template <JointKind K, class N>
N project(const Link& link, int k, const Vec6<N>& f) {
  return along_axis<K>(link, k, slides(K) ? f.l : f.a);
}

// Transforms between a link and its parent, without components that are zero for its joint.
template <class N>
Vec6<N> motion_to_child(const Link& link, const Frame<N>& x, const Vec6<N>& v) {
  const Vec3<N> l = link.has_offset && !link.parent_never_rotates ? v.l + cross(v.a, x.p) : v.l;
  if (!link.may_rotate) return {v.a, l};
  return {link.parent_never_rotates ? zero3<N>() : transposed_times(x.R, v.a),
          transposed_times(x.R, l)};
}
template <class N>
Vec6<N> wrench_to_parent(const Link& link, const Frame<N>& x, const Vec6<N>& f) {
  const Vec6<N> r = link.may_rotate ? Vec6<N>{x.R * f.a, x.R * f.l} : f;
  return link.has_offset ? Vec6<N>{r.a + cross(x.p, r.l), r.l} : r;
}
template <class N>
Frame<N> compose(const Link& link, const Frame<N>& parent, const Frame<N>& x) {
  return {link.may_rotate ? parent.R * x.R : parent.R,
          link.has_offset ? parent.R * x.p + parent.p : parent.p};
}

/// Loads a parameter of the scene for these lanes.
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
/// In dual numbers one environment has a block to itself: values in lane 0, tangents in lane 1.
template <>
struct ParameterLoad<Dual<double>> {
  static Dual<double> load(const Parameter& p, const double* block, int group) {
    if (p.row < 0) return p.value;
    const double* row = row_of(block, p.row, group);
    return {row[0], row[1]};
  }
};
/// Loads three adjacent numbers from the block. row < 0: `value` in all lanes.
template <class N>
Vec3<N> load_vector(const Vec3<double>& value, int row, const double* block, int group) {
  if (row < 0) return broadcast<N>(value);
  const auto one = [&](int i) { return ParameterLoad<N>::load({0, row + i}, block, group); };
  return {one(0), one(1), one(2)};
}
/// Radius of a sphere on the ground; 0 for points.
template <class N>
N ground_radius(const GroundContact& ground, const double* block, int group) {
  return ParameterLoad<N>::load({ground.radius, ground.radius_row}, block, group);
}
/// Place k of a body's points. In dual numbers it may move.
template <class N>
Vec3<N> ground_point(const GroundContact& ground, int k) {
  const double* p = ground.points + 3 * k;
  if constexpr (std::is_same_v<N, Dual<double>>)
    if (const double* t = ground.point_tangents; t != nullptr)
      return {{p[0], t[3 * k]}, {p[1], t[3 * k + 1]}, {p[2], t[3 * k + 2]}};
  return {N(p[0]), N(p[1]), N(p[2])};
}
/// Mass, mass · centre and inertia of a link's own bodies.
template <class N>
struct LinkInertia {
  N mass;
  Vec3<N> moment;
  Mat3<N> inertia;
};
template <class N>
LinkInertia<N> load_inertia(const Link& link, const double* block, int group) {
  if (link.inertia_row < 0)
    return {N(link.mass), broadcast<N>(link.mass_times_com), broadcast<N>(link.inertia)};
  const auto row = [&](int i) {
    return ParameterLoad<N>::load({0, link.inertia_row + i}, block, group);
  };
  const N xy = row(5), xz = row(6), yz = row(8);
  return {
      row(0), {row(1), row(2), row(3)}, {{{row(4), xy, xz}, {xy, row(7), yz}, {xz, yz, row(9)}}}};
}
template <class N>
LawParameters<N> load_law(const ContactParameters& p, ContactLaw law, double ramp,
                          const double* block, int group) {
  const auto one = [&](const Parameter& x) { return ParameterLoad<N>::load(x, block, group); };
  return {transformed(p, one), law, ramp};
}

}  // namespace tangere::kernels
