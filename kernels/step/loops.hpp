// SPDX-License-Identifier: Apache-2.0
// Springs that close loops: a point of link 1 and one of link 2 are held together, and in a weld
// the axes of two frames as well. Everything is in the axes of link 1, about its origin. With the
// point ξ of link 1, the point x₂ of link 2, the twist W = (ω; v) of link 2 relative to link 1, and
// r = ξ - x₂, u = -(v + ω × x₂),
//
//   f = -k r - c u on link 1, at x₂;  in a weld also the torque k_t φ + c_t ω,
//       φ = log(Q F₂ F₁ᵀ), F₁ and F₂ the axes of the frames in their links, Q link 2 in link 1
//
// By the displacement ε = (θ; ρ) of link 2 relative to link 1, and by δW, with Γ = (-[x₂], 1):
//   δx₂ = Γ ε,  δf = (k + c [ω]) Γ ε + c Γ δW,  δφ = J_l⁻¹(φ) θ
// So a loop is a contact without a law, and its sums are those of a pair.
#pragma once

#include "kernels/numbers/rotation_vector.hpp"
#include "kernels/step/pair_motion.hpp"

namespace tangere::kernels {

/// Returns a quaternion of a rotation, by the largest of 4 w², 4 x², 4 y² and 4 z².
template <class N>
Quat<N> quaternion_of(const Mat3<N>& R) {
  const N one(1.0), x = R.m[0][0], y = R.m[1][1], z = R.m[2][2];
  const N wx = R.m[2][1] - R.m[1][2], wy = R.m[0][2] - R.m[2][0], wz = R.m[1][0] - R.m[0][1];
  const N xy = R.m[1][0] + R.m[0][1], xz = R.m[0][2] + R.m[2][0], yz = R.m[2][1] + R.m[1][2];
  N most = one + ((x + y) + z);
  Quat<N> q{most, wx, wy, wz};  // times 2 √most
  const auto larger = [&](const N& square, const Quat<N>& other) {
    const auto is_larger = square > most;
    most = select(is_larger, square, most);
    q = {select(is_larger, other.w, q.w), select(is_larger, other.x, q.x),
         select(is_larger, other.y, q.y), select(is_larger, other.z, q.z)};
  };
  const N xx = one + (x - (y + z)), yy = one + (y - (x + z)), zz = one + (z - (x + y));
  larger(xx, {wx, xx, xy, xz});
  larger(yy, {wy, xy, yy, yz});
  larger(zz, {wz, xz, yz, zz});
  const N scale = N(0.5) / sqrt(most);
  return {scale * q.w, scale * q.x, scale * q.y, scale * q.z};
}

/// What holds a loop together at the present poses, link 1's axes.
template <class N>
struct LoopState {
  Vec3<N> x2;                ///< the point of link 2 [m]
  Vec3<N> gap;               ///< r = ξ - x₂ [m]
  Vec3<N> u;                 ///< velocity of link 1 relative to link 2 at x₂ [m/s]
  RotationVector<N> turned;  ///< φ [rad]; welds only
};

template <class N>
LoopState<N> loop_state(const Loop& loop, const Frame<N>& link2_in_1, const Vec6<N>& W) {
  LoopState<N> s;
  s.x2 = link2_in_1.R * broadcast<N>(loop.frame2.p) + link2_in_1.p;
  s.gap = broadcast<N>(loop.frame1.p) - s.x2;
  s.u = -(W.l + cross(W.a, s.x2));
  if (loop.weld)
    s.turned = rotation_vector<false>(quaternion_of(
        link2_in_1.R * (broadcast<N>(loop.frame2.R) * transpose(broadcast<N>(loop.frame1.R)))));
  return s;
}

/// Computes the wrench of a loop on link 1 and, with derivatives, its stiffness and damping.
template <bool Derivatives, class N>
void sum_loop(const Loop& loop, const StageArgs<N>& a, ContactScratch<N>& o) {
  const auto number = [&](const Parameter& p) {
    return ParameterLoad<N>::load(p, a.block, a.group);
  };
  const N k = number(loop.stiffness), c = number(loop.damping);
  const LoopState<N> s = loop_state(loop, o.link2_in_1, o.W);
  const Vec3<N> f = -(k * s.gap + c * s.u);
  PairSums<N>& sums = o.sums;
  sums.wrench = {cross(s.x2, f), f};
  if constexpr (Derivatives) {
    const Mat3<N> stiff = diagonal(k) + c * skew(o.W.a), damp = diagonal(c);
    sums.k[1][1] = stiff;
    sums.k[1][0] = -times_skew(stiff, s.x2);
    sums.k[0][1] = cross_columns(s.x2, stiff) - skew(f);
    sums.k[0][0] = cross_columns(s.x2, sums.k[1][0]) + cross_columns(f, skew(s.x2));
    sums.d[1][1] = damp;
    sums.d[1][0] = -(c * skew(s.x2));
    sums.d[0][1] = c * skew(s.x2);
    sums.d[0][0] = cross_columns(s.x2, sums.d[1][0]);
  }
  if (!loop.weld) return;
  const N turning_k = number(loop.turning_stiffness), turning_c = number(loop.turning_damping);
  sums.wrench.a += turning_k * s.turned.phi + turning_c * o.W.a;
  if constexpr (Derivatives) {
    sums.k[0][0] += turning_k * inverse_left_jacobian(s.turned);
    sums.d[0][0] += diagonal(turning_c);
  }
}

/// The scratch of loop k, after that of contacts.
template <class N>
ContactScratch<N>& loop_scratch(const ModelView& model, const StageArgs<N>& a, int k) {
  return a.contacts[model.n_link_pairs + model.n_grounded + k];
}

/// Computes the sums of every loop at the x of kinematics(). Subtracts their wrenches from the
/// links' F.
template <bool Derivatives, class N>
void loop_sweep(const ModelView& model, const StageArgs<N>& a) {
  for (int k = 0; k < model.n_loops; ++k) {
    const Loop& loop = model.loops[k];
    ContactScratch<N>& o = loop_scratch(model, a, k);
    pair_motion(loop, a, o);
    o.near = true;
    sum_loop<Derivatives>(loop, a, o);
    if (loop.link1 >= 0) a.links[loop.link1].F -= o.sums.wrench;
    if (loop.link2 >= 0) a.links[loop.link2].F += wrench_to_child(o.link2_in_1, o.sums.wrench);
  }
}

/// Adds the magnitudes of the loops' forces to the scale of every dof that moves one.
template <class N>
void add_loop_scales(const ModelView& model, const StageArgs<N>& a) {
  for (int k = 0; k < model.n_loops; ++k) {
    const ContactScratch<N>& o = loop_scratch(model, a, k);
    const Loop& loop = model.loops[k];
    add_force_scale(model, a, loop.link1, o.sums.wrench);
    if (loop.link2 >= 0)
      add_force_scale(model, a, loop.link2, wrench_to_child(o.link2_in_1, o.sums.wrench));
  }
}

}  // namespace tangere::kernels
