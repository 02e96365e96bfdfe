// SPDX-License-Identifier: Apache-2.0
// Joints without mass whose coordinate is a length ℓ of other dofs, or whose rate is the power of a
// wrench. With J = ∂ℓ/∂q, by rates:
//   q_t = ℓ(q),  v_t = J v;   g += Jᵀ g_t;   A += Jᵀ ∂g_t + g_t ∂J (transmission_jacobian.hpp)
// so every effect of a joint acts on the length. The joint's own row is left a diagonal entry.
//
// In world axes, a dof with unit vector w (it turns, about o) moves a point p at C = w × (p - o),
// and one that slides at C = w. Relative to the link of a surface, a point moves at r = C_a - C_g,
// where each counts if the dof moves that link:
//   J_k = Σ G·r_k, G as in path_piece.hpp;  of a wrench (τ, f): J_k = f·C_k + τ·w_k if k turns
#pragma once

#include "kernels/step/path_piece.hpp"
#include "kernels/step/stage.hpp"

namespace tangere::kernels {

/// One transmission with its scratch.
template <class N>
struct TransmissionPart {
  const Transmission& transmission;
  const TransmissionPiece* pieces;
  const TransmissionDof* dofs;
  TransmissionColumn<N>* columns;
  N* force;
};
template <class N, class F>
void for_each_transmission(const ModelView& model, const StageArgs<N>& a, const F& f) {
  for (int t = 0; t < model.n_transmissions; ++t) {
    const Transmission& of = model.transmissions[t];
    f(TransmissionPart<N>{of, model.pieces + of.first_piece, model.transmission_dofs + of.first_dof,
                          a.transmission_columns + of.first_dof, a.transmission_force + t});
  }
}

inline bool moves(std::uint64_t dofs, int i) { return ((dofs >> i) & 1U) != 0; }

template <class N>
Frame<N> world_of(const StageArgs<N>& a, int link) {
  return link < 0 ? Frame<N>{diagonal(N(1.0)), zero3<N>()} : a.links[link].world;
}

/// Returns C, the velocity of a point by the rate of a dof that moves it.
template <class N>
Vec3<N> velocity_at(const TransmissionColumn<N>& c, const Vec3<N>& point) {
  return c.turns ? cross(c.axis, point - c.origin) : c.axis;
}

/// A piece in world axes at the present poses.
template <class N>
struct PosedPiece {
  int points;  ///< 2, 1 or, of a wrench, 0
  Vec3<N> point[2];
  std::uint64_t moved[2];  ///< the dofs that move each point's link
  PieceLength<N> length;   ///< times the piece's share
  Vec3<N> force, torque;   ///< of a wrench, at point[0]
};

template <class N>
PosedPiece<N> posed_piece(const StageArgs<N>& a, const TransmissionPiece& piece) {
  PosedPiece<N> p;
  const Frame<N> first = world_of(a, piece.first), round = world_of(a, piece.round);
  p.point[0] = first.R * broadcast<N>(piece.first_point) + first.p;
  p.moved[0] = piece.moves_first;
  p.points = 0;
  if (piece.kind == PieceKind::wrench) {
    p.length.length = N(0.0);
    p.force = first.R * broadcast<N>(piece.force);
    p.torque = first.R * broadcast<N>(piece.torque);
    return p;
  }
  const Vec3<N> centre = round.R * broadcast<N>(piece.centre) + round.p;
  p.points = 1;
  if (piece.kind == PieceKind::offset) {
    p.length.slope[0] = round.R * broadcast<N>(piece.force);
    p.length.length = dot(p.length.slope[0], p.point[0] - centre);
    p.length.second[0][0] = zero33<N>();
    return p;
  }
  const Frame<N> second = world_of(a, piece.second);
  p.points = 2;
  p.point[1] = second.R * broadcast<N>(piece.second_point) + second.p;
  p.moved[1] = piece.moves_second;
  PieceLength<N>& l = p.length;
  l = piece_length(piece, p.point[0] - centre, p.point[1] - centre,
                   round.R * broadcast<N>(piece.axis), round.R * broadcast<N>(piece.side));
  const N share(piece.share);
  l.length = share * l.length;
  for (int i = 0; i < 2; ++i) {
    l.slope[i] = share * l.slope[i];
    for (int j = 0; j < 2; ++j) l.second[i][j] = share * l.second[i][j];
  }
  return p;
}

/// Sets r of every dof for the points of a piece.
template <class N>
void set_velocities(const TransmissionPart<N>& part, const TransmissionPiece& piece,
                    const PosedPiece<N>& p) {
  for (int k = 0; k < part.transmission.dofs; ++k) {
    TransmissionColumn<N>& c = part.columns[k];
    for (int i = 0; i < p.points; ++i) {
      const bool moves_point = moves(p.moved[i], k), moves_surface = moves(piece.moves_round, k);
      c.velocity[i] = moves_point == moves_surface ? zero3<N>()
                      : moves_point                ? velocity_at(c, p.point[i])
                                                   : -velocity_at(c, p.point[i]);
    }
  }
}

/// Adds J of one piece.
template <class N>
void add_slopes(const TransmissionPart<N>& part, const PosedPiece<N>& p) {
  for (int k = 0; k < part.transmission.dofs; ++k) {
    TransmissionColumn<N>& c = part.columns[k];
    for (int i = 0; i < p.points; ++i) c.slope += dot(p.length.slope[i], c.velocity[i]);
    if (p.points > 0 || !moves(p.moved[0], k)) continue;
    c.slope += dot(p.force, velocity_at(c, p.point[0]));
    if (c.turns) c.slope += dot(p.torque, c.axis);
  }
}

/// Sets the world axes of a transmission's dofs.
template <class N>
void set_columns(const ModelView& model, const StageArgs<N>& a, const TransmissionPart<N>& part) {
  for (int k = 0; k < part.transmission.dofs; ++k) {
    const TransmissionDof& dof = part.dofs[k];
    const Link& link = model.links[dof.link];
    const Frame<N>& world = a.links[dof.link].world;
    TransmissionColumn<N>& c = part.columns[k];
    c.turns = !slides(link.kind);
    c.origin = world.p;
    c.slope = N(0.0);
    with_kind(link.kind,
              [&]<JointKind K>() { c.axis = world.R * joint_axis<K, N>(link, dof.component); });
  }
}

/// Computes J, and writes the coordinates and rates of all transmissions, at the poses and rates of
/// the outward sweep.
template <class N>
void transmission_motions(const ModelView& model, const StageArgs<N>& a) {
  for_each_transmission(model, a, [&](const TransmissionPart<N>& part) {
    const Transmission& t = part.transmission;
    set_columns(model, a, part);
    N length(0.0), rate(0.0);
    for (int i = 0; i < t.pieces; ++i) {
      const PosedPiece<N> p = posed_piece(a, part.pieces[i]);
      length += p.length.length;
      set_velocities(part, part.pieces[i], p);
      add_slopes(part, p);
    }
    for (int k = 0; k < t.dofs; ++k)
      rate = mul_add(part.columns[k].slope, a.v[part.dofs[k].v], rate);
    a.own_x[t.v] = length - a.centre[t.q];
    a.v[t.v] = rate;
  });
}

/// g += Jᵀ g_t, and the same of the magnitudes of forces.
template <class N>
void fold_transmissions(const ModelView& model, const StageArgs<N>& a) {
  for_each_transmission(model, a, [&](const TransmissionPart<N>& part) {
    const int own = part.transmission.v;
    *part.force = a.g[own];
    for (int k = 0; k < part.transmission.dofs; ++k) {
      const N& J = part.columns[k].slope;
      const int v = part.dofs[k].v;
      a.g[v] = mul_add(J, a.g[own], a.g[v]);
      a.force_scale[v] = mul_add(abs(J), a.force_scale[own], a.force_scale[v]);
    }
    a.g[own] = a.force_scale[own] = N(0.0);
  });
}

}  // namespace tangere::kernels
