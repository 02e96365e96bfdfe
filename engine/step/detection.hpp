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

/// Chooses the faces that count in the solve which starts at q0 (kernels/step/faces.hpp). Call it
/// before the first stage. Overwrites the stage's v.
template <int L>
void choose_faces(const CompiledModel& model, const kernels::KernelTable& kernels,
                  BasicWorkspace<L>& w);

/// Copies the lists of `lanes` into rows, for evaluations of more than one lane.
void lists_to_rows(const CompiledModel& model, const kernels::KernelTable& kernels, Workspace& w,
                   LaneBits lanes);

/// Empties every list. Call before the first stage of a group.
template <int L>
void clear_candidates(BasicWorkspace<L>& w);

}  // namespace tangere
