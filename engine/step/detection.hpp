// SPDX-License-Identifier: Apache-2.0
// Which contact points may touch during this step: found once, at the predicted pose, with a
// margin.
#pragma once

#include "engine/step/workspace.hpp"

namespace tangere {

/// Rebuilds the candidate lists of the lanes in `lanes` at the poses that kinematics() left. Other
/// lanes keep theirs. Membership never changes a result: points that do not touch add exact zeros,
/// and a lane that moves further than its margin is found by the next kinematics() and rebuilt.
template <int L>
void find_candidates(const CompiledModel& model, const kernels::KernelTable& kernels,
                     BasicWorkspace<L>& w, LaneBits lanes);

/// Puts the lists of `lanes` into rows, for evaluations of more than one lane.
void lists_to_rows(const kernels::KernelTable& kernels, Workspace& w, LaneBits lanes);

/// Empties every list: before the first stage of a group.
template <int L>
void clear_candidates(BasicWorkspace<L>& w);

}  // namespace tangere
