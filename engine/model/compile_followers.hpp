// SPDX-License-Identifier: Apache-2.0
// Joints that follow others (kernels::Follower). Steps of compile().
#pragma once

#include "engine/model/compiled_model.hpp"
#include "engine/model/name_index.hpp"

namespace tangere {

/// Fills CompiledModel::followers. Chains are resolved: of a follower of a follower, ratios
/// multiply. Throws InputError (file:line) for a leader that is unknown, of several dofs, or in a
/// circle.
void compile_followers(CompiledModel& m, const NameIndex& joints);

/// Sets the initial state of followers from their leaders'. Throws InputError where the scene gives
/// another one.
void place_followers(CompiledModel& m);

/// Sets a follower's coordinate and rate from its leader's. `q`(i), `v`(i): references.
template <class Q, class V>
void place_follower(const kernels::Follower& f, const Q& q, const V& v) {
  q(f.q) = f.ratio * q(f.leader_q) + f.offset;
  v(f.v) = f.ratio * v(f.leader_v);
}

}  // namespace tangere
