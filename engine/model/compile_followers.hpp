// SPDX-License-Identifier: Apache-2.0
// Joints that follow others (kernels::Follower). Steps of compile().
#pragma once

#include "engine/model/compiled_model.hpp"
#include "engine/model/name_index.hpp"

namespace tangere {

/// Fills CompiledModel::followers, ties and polynomials. Chains are resolved: of a follower of a
/// follower, the ratios multiply. Throws InputError (file:line) for a leader that is unknown, of
/// several dofs, or in a circle, and for a chain that is no polynomial of degree four of one joint.
void compile_followers(CompiledModel& m, const NameIndex& joints);

/// Sets the initial state of followers from their leaders'. Throws InputError where the scene gives
/// another one.
void place_initial_followers(CompiledModel& m);

/// A dof and its coordinate.
struct DofPlace {
  int v, q;
};
/// Returns the dofs that follow others, not by a transmission.
std::vector<DofPlace> following_dofs(const CompiledModel& m);

/// Sets the coordinates and rates of followers from their leaders'. `q`(i), `v`(i): references.
template <class Q, class V>
void place_followers(const CompiledModel& m, const Q& q, const V& v) {
  for (const kernels::Follower& f : m.followers) q(f.q) = f.offset, v(f.v) = 0;
  for (const kernels::FollowerTie& t : m.ties) {
    q(t.q) += t.ratio * q(t.leader_q);
    v(t.v) += t.ratio * v(t.leader_v);
  }
  for (const kernels::PolynomialFollower& f : m.polynomials) {
    const auto p = kernels::polynomial_at<double>(f.coefficients, q(f.leader_q));
    q(f.q) = p.value;
    v(f.v) = p.slope * v(f.leader_v);
  }
}

}  // namespace tangere
