// SPDX-License-Identifier: Apache-2.0
// Finds the contact points that may touch: with a margin, so that a list is valid until bodies have
// moved farther.
#pragma once

#include "engine/step/workspace.hpp"

namespace tangere {

/// Lists the candidates of `lanes` at the poses of kinematics(), where a lane has no lists or has
/// moved farther than their margin. Other lists stay. Membership never changes a result: points
/// that do not touch add exact zeros. In scenes that do not keep lists, all lists of `lanes` are
/// made. New lists have no anchors (shear_anchors.hpp).
template <int L>
void find_candidates(const CompiledModel& model, const kernels::KernelTable& kernels,
                     BasicWorkspace<L>& w, LaneBits lanes);

/// Prepares detection for the solve of `lanes` which starts at q0: finds the link pairs that are
/// considered (broad_phase.hpp), and the faces that count (kernels/step/faces.hpp). Drops the lists
/// of lanes whose sizes or faces have changed. Call it before the first stage. Overwrites the
/// stage's v.
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

/// Copies the lists of `lanes` and their anchors into rows, for evaluations of more than one lane.
void lists_to_rows(const CompiledModel& model, const kernels::KernelTable& kernels, Workspace& w,
                   LaneBits lanes);

/// Whether lists are kept from one step to the next: not those of scenes of many pairs or trees,
/// which take much memory.
bool keeps_lists(const CompiledModel& model);

/// Empties every list.
template <int L>
void clear_candidates(const CompiledModel& model, BasicWorkspace<L>& w);

}  // namespace tangere
