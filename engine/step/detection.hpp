// SPDX-License-Identifier: Apache-2.0
// Finds the contact points that may touch during this step: once, at the predicted pose, with a
// margin.
#pragma once

#include "engine/step/workspace.hpp"

namespace tangere {

/// Rebuilds the candidate lists of the lanes in `lanes` at the poses of kinematics(). Other lanes
/// keep theirs. Membership never changes a result: points that do not touch add exact zeros. If a
/// lane moves farther than its margin, the next kinematics() finds out and its lists are rebuilt.
template <int L>
void find_candidates(const CompiledModel& model, const kernels::KernelTable& kernels,
                     BasicWorkspace<L>& w, LaneBits lanes);

/// Prepares detection for the solve of `lanes` which starts at q0: finds the link pairs that are
/// considered (broad_phase.hpp), and the faces that count (kernels/step/faces.hpp). Call it before
/// the first stage. Overwrites the stage's v.
template <int L>
void start_solve(const CompiledModel& model, const kernels::KernelTable& kernels,
                 BasicWorkspace<L>& w, LaneBits lanes);

/// Calls f(g) for the numbers of the link pairs that are considered.
template <int L, class F>
void for_each_considered(const CompiledModel& model, const BasicWorkspace<L>& w, const F& f) {
  if (w.stage.considered == nullptr) {
    for (std::size_t g = 0; g < model.link_pairs.size(); ++g) f(g);
  } else {
    for (int i = 0; i < w.stage.n_considered; ++i) f(std::size_t(w.stage.considered[i]));
  }
}

/// Copies the lists of `lanes` into rows, for evaluations of more than one lane.
void lists_to_rows(const CompiledModel& model, const kernels::KernelTable& kernels, Workspace& w,
                   LaneBits lanes);

/// Empties every list. Call before the first stage of a group.
template <int L>
void clear_candidates(const CompiledModel& model, BasicWorkspace<L>& w);

}  // namespace tangere
