// SPDX-License-Identifier: Apache-2.0
// What transmissions add to the Jacobian (transmissions.hpp). By dof l, where ω_l = w_l if l turns
// and else 0:
//   ∂C_k = ω_l × C_k where l is k's joint or above it, ω_k × C_l where it is below
//   in the axes of the surface  ∂r_k = ∂C_k^a - ∂C_k^g - ω_k^g × r_l - ω_l^g × r_k
//   ∂J_k = Σ r_kᵀ H r_l + Σ G·∂r_k
//   of a wrench that turns with its link: ∂J_k = 0 unless l is below k, else
//       f·(ω_k × C_l - ω_l × C_k) + τ·(ω_k × ω_l)
#pragma once

#include "kernels/step/inertial_jacobian.hpp"
#include "kernels/step/transmissions.hpp"

namespace tangere::kernels {

/// Adds to ∂J what G·∂r of one point of a piece is, for dofs k and l.
template <class N>
N second_of_point(const TransmissionPart<N>& part, const TransmissionPiece& piece,
                  const PosedPiece<N>& p, int point, int k, int l) {
  const TransmissionColumn<N>&ck = part.columns[k], &cl = part.columns[l];
  const auto both = [&](std::uint64_t dofs) { return int(moves(dofs, k) && moves(dofs, l)); };
  Vec3<N> sum = zero3<N>();
  if (const int times = both(p.moved[point]) - both(piece.moves_round); times != 0) {
    const bool above = part.dofs[l].link <= part.dofs[k].link;
    const TransmissionColumn<N>&upper = above ? cl : ck, &lower = above ? ck : cl;
    if (upper.turns) sum = N(double(times)) * cross(upper.axis, velocity_at(lower, p.point[point]));
  }
  if (moves(piece.moves_round, k) && ck.turns) sum -= cross(ck.axis, cl.velocity[point]);
  if (moves(piece.moves_round, l) && cl.turns) sum -= cross(cl.axis, ck.velocity[point]);
  return dot(p.length.slope[point], sum);
}

/// Returns ∂J of a wrench, for dofs k and l.
template <class N>
N second_of_wrench(const TransmissionPart<N>& part, const PosedPiece<N>& p, int k, int l) {
  if (part.dofs[l].link <= part.dofs[k].link) return N(0.0);
  const TransmissionColumn<N>&upper = part.columns[k], &lower = part.columns[l];
  Vec3<N> velocity = zero3<N>();
  if (upper.turns) velocity += cross(upper.axis, velocity_at(lower, p.point[0]));
  if (lower.turns) velocity -= cross(lower.axis, velocity_at(upper, p.point[0]));
  N sum = dot(p.force, velocity);
  if (upper.turns && lower.turns) sum += dot(p.torque, cross(upper.axis, lower.axis));
  return sum;
}

/// Sets ∂J, (dofs, dofs), and of each dof the rate of J v.
template <class N>
void transmission_second(const StageArgs<N>& a, const TransmissionPart<N>& part) {
  const int n = part.transmission.dofs;
  N* const second = a.transmission_second;
  for (int e = 0; e < n * n; ++e) second[e] = N(0.0);
  for (int piece = 0; piece < part.transmission.pieces; ++piece) {
    const PosedPiece<N> p = posed_piece(a, part.pieces[piece]);
    set_velocities(part, part.pieces[piece], p);
    for (int l = 0; l < n; ++l)
      for (int i = 0; i < p.points; ++i) {
        TransmissionColumn<N>& c = part.columns[l];
        c.change[i] = p.length.second[i][0] * c.velocity[0];
        if (p.points == 2) c.change[i] += p.length.second[i][1] * c.velocity[1];
      }
    for (int k = 0; k < n; ++k)
      for (int l = 0; l < n; ++l) {
        N& to = second[k * n + l];
        for (int i = 0; i < p.points; ++i)
          to += dot(part.columns[k].velocity[i], part.columns[l].change[i]) +
                second_of_point(part, part.pieces[piece], p, i, k, l);
        if (p.points == 0 && moves(p.moved[0], k) && moves(p.moved[0], l))
          to += second_of_wrench(part, p, k, l);
      }
  }
  for (int l = 0; l < n; ++l) {
    N& rate = part.columns[l].rate;
    rate = N(0.0);
    for (int k = 0; k < n; ++k) rate = mul_add(second[k * n + l], a.v[part.dofs[k].v], rate);
  }
}

/// Derivatives of g of a transmission's joint.
template <class N>
struct OwnSlopes {
  N q_slope, v_slope, armature;
};
template <class N>
OwnSlopes<N> own_slopes(const ModelView& model, const StageArgs<N>& a, const Transmission& t) {
  const Link& link = model.links[t.link];
  OwnSlopes<N> s = {N(0.0), N(0.0), N(0.0)};
  if (link.effects & kDamping) s.v_slope = load_parameter(a, model.effects[t.v].damping);
  if (!(link.effects & kBeyondDamping)) return s;
  JointLoad<N> load;
  joint_load<JointKind::prismatic, true>(model, a, link, load);
  return {t.has_length ? load.d_dq[0] : N(0.0), s.v_slope + load.d_dv[0], load.armature[0]};
}

/// Turns derivatives of a number by displacements and by rates into those by x, joint by joint:
/// f(l, d_dq, d_dv) sets those of dof l, and add(l, d_dx) takes the result.
template <class N, class F, class Add>
void combine_dofs(const ModelView& model, const StageArgs<N>& a, const TransmissionPart<N>& part,
                  const F& f, const Add& add) {
  for (int l = 0; l < part.transmission.dofs;) {
    const TransmissionDof& dof = part.dofs[l];
    with_kind(model.links[dof.link].kind, [&]<JointKind K>() {
      N d_dq[3], d_dv[3], d_dx[3];
      for (int i = 0; i < dofs(K); ++i) f(l + i, d_dq[i], d_dv[i]);
      combine<K>(model.links[dof.link], a.links[dof.link], a.c0_over_h, d_dq, d_dv, d_dx);
      for (int i = 0; i < dofs(K); ++i) add(l + i, d_dx[i]);
      l += dofs(K);
    });
  }
}

/// Adds the entries of all transmissions to A and to the diagonal of M.
template <class N>
void transmission_jacobian(const ModelView& model, const StageArgs<N>& a) {
  for_each_transmission(model, a, [&](const TransmissionPart<N>& part) {
    const Transmission& t = part.transmission;
    transmission_second(a, part);
    const OwnSlopes<N> own = own_slopes(model, a, t);
    for (int k = 0; k < t.dofs; ++k) {
      const N &J = part.columns[k].slope, *second = a.transmission_second + k * t.dofs;
      const int v = part.dofs[k].v;
      a.mass_diagonal[v] = mul_add(J * J, own.armature, a.mass_diagonal[v]);
      combine_dofs(
          model, a, part,
          [&](int l, N& d_dq, N& d_dv) {
            const TransmissionColumn<N>& c = part.columns[l];
            d_dq = J * (own.q_slope * c.slope + own.v_slope * c.rate) + *part.force * second[l];
            d_dv = J * own.v_slope * c.slope;
          },
          [&](int l, const N& d_dx) {
            N& entry = entries_at(model, a, v, part.dofs[l].v)(0, 0);
            entry = entry + d_dx;
          });
    }
    a.mass_diagonal[t.v] = N(kFollowerMass);
    a.A[model.pattern.diagonal_entry[t.v]] = a.c0_over_h * a.c0_over_h * N(kFollowerMass);
  });
}

}  // namespace tangere::kernels
