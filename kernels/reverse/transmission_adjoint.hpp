// SPDX-License-Identifier: Apache-2.0
// Transmissions in the reverse sweep (kernels/step/transmissions.hpp). With λ_t = J λ, the power
// of all forces along λ has the transmission's as that of a joint. What comes back for its
// coordinate and rate goes to the dofs:
//   rhs += Jᵀ q̄_t + (∂(J v))ᵀ v̄_t by x;   ν += Jᵀ ν_t, ν_t = v̄_t - ∂g_t/∂v_t λ_t
// By a displacement of places, with α = q̄_t - ∂g_t/∂q_t λ_t, a share ν_t v_k - g_t λ_k of ∂J_k:
//   ∂L = α ∂ℓ + Σ_k (ν_t v_k - g_t λ_k) ∂J_k
#pragma once

#include "kernels/reverse/adjoint_arguments.hpp"
#include "kernels/step/transmission_jacobian.hpp"

namespace tangere::kernels {

/// Adds the cotangents of transmissions to the right-hand side. Their own are 0 then.
template <class N>
void transmission_rhs(const ModelView& model, const StageArgs<N>& a, const AdjointArgs<N>& d) {
  for_each_transmission(model, a, [&](const TransmissionPart<N>& part) {
    const int own = part.transmission.v;
    combine_dofs(
        model, a, part,
        [&](int l, N& d_dq, N& d_dv) {
          const TransmissionColumn<N>& c = part.columns[l];
          d_dq = d.v_bar[own] * c.rate;
          if (part.transmission.has_length) d_dq += d.q_bar[own] * c.slope;
          d_dv = d.v_bar[own] * c.slope;
        },
        [&](int l, const N& d_dx) { d.rhs[part.dofs[l].v] += d_dx; });
    d.rhs[own] = N(0.0);
  });
}

/// Sets λ_t = J λ.
template <class N>
void expand_transmissions(const ModelView& model, const StageArgs<N>& a, N* lambda) {
  for_each_transmission(model, a, [&](const TransmissionPart<N>& part) {
    N sum(0.0);
    for (int k = 0; k < part.transmission.dofs; ++k)
      sum = mul_add(part.columns[k].slope, lambda[part.dofs[k].v], sum);
    lambda[part.transmission.v] = sum;
  });
}

/// ν += Jᵀ ν_t; then ν_t = 0: the rates of transmissions have no history.
template <class N>
void hand_on_rates(const ModelView& model, const StageArgs<N>& a, N* nu) {
  for_each_transmission(model, a, [&](const TransmissionPart<N>& part) {
    N& own = nu[part.transmission.v];
    for (int k = 0; k < part.transmission.dofs; ++k)
      nu[part.dofs[k].v] = mul_add(part.columns[k].slope, own, nu[part.dofs[k].v]);
    own = N(0.0);
  });
}

/// Weights of ∂ℓ and of ∂J_k = ∂J by the places of links.
template <class N>
struct PlaceWeights {
  N length, rate;   ///< of ∂ℓ, and of v_k ∂J_k
  N force;          ///< of -λ_k ∂J_k
  const N* v;       ///< (nv)
  const N* lambda;  ///< (nv)
};

/// Adds to `out`, (n_links, 3) in the axes of each link, the derivatives by moving it alone.
template <class N>
void add_piece_places(const StageArgs<N>& a, const TransmissionPart<N>& part,
                      const TransmissionPiece& piece, const PlaceWeights<N>& weights, N* out) {
  const PosedPiece<N> p = posed_piece(a, piece);
  set_velocities(part, piece, p);
  const auto add = [&](int link, const Vec3<N>& x) {
    if (link < 0) return;
    const Vec3<N> own = transposed_times(a.links[link].world.R, x);
    N* const to = out + kPlaceNumbers * link;
    to[0] += own.x, to[1] += own.y, to[2] += own.z;
  };
  const int n = part.transmission.dofs, points = p.points == 0 ? 1 : p.points;
  const auto weight = [&](int k) {
    const int v = part.dofs[k].v;
    return weights.rate * weights.v[v] - weights.force * weights.lambda[v];
  };
  Vec3<N> change[2] = {zero3<N>(), zero3<N>()};
  for (int k = 0; k < n; ++k)
    for (int i = 0; i < p.points; ++i) change[i] += weight(k) * part.columns[k].velocity[i];
  for (int i = 0; i < points; ++i) {
    const Vec3<N>& slope = p.points == 0 ? p.force : p.length.slope[i];
    Vec3<N> point_bar = zero3<N>();
    if (p.points > 0) {
      point_bar = weights.length * slope + p.length.second[i][0] * change[0];
      if (p.points == 2) point_bar += p.length.second[i][1] * change[1];
      add(piece.round, -point_bar);
    }
    for (int k = 0; k < n; ++k) {
      const int times =
          int(moves(p.moved[i], k)) - int(p.points > 0 && moves(piece.moves_round, k));
      if (times == 0 || !part.columns[k].turns) continue;
      const Vec3<N> turned = (N(double(times)) * weight(k)) * cross(slope, part.columns[k].axis);
      point_bar += turned;
      add(part.dofs[k].link, -turned);
    }
    add(i == 0 ? piece.first : piece.second, point_bar);
  }
}

/// Adds the derivatives by moving each link alone, without turning it, to `out`, (n_links, 3).
template <class N>
void transmission_places(const ModelView& model, const StageArgs<N>& a, const AdjointArgs<N>& d,
                         N* out) {
  for_each_transmission(model, a, [&](const TransmissionPart<N>& part) {
    const Transmission& t = part.transmission;
    const OwnSlopes<N> own = own_slopes(model, a, t);
    const N& lambda = d.lambda[t.v];
    const PlaceWeights<N> weights = {d.q_bar[t.v] - own.q_slope * lambda,
                                     d.v_bar[t.v] - own.v_slope * lambda, *part.force, a.v,
                                     d.lambda};
    for (int i = 0; i < t.pieces; ++i) add_piece_places(a, part, part.pieces[i], weights, out);
  });
}

}  // namespace tangere::kernels
