// SPDX-License-Identifier: Apache-2.0
// Which contact points may touch during this step: found once, at the predicted pose, with a margin.
#pragma once

#include "engine/workspace.hpp"

namespace tangere {

/// Rebuilds the candidate lists of the lanes in `lanes` at the stage's x. Other lanes keep theirs.
/// Membership never changes a result: points that do not touch add exact zeros, and a lane that moves further than its
/// margin is found by the evaluation and rebuilt.
void find_candidates(const CompiledModel& model, const kernels::KernelTable& kernels, Workspace& w, LaneBits lanes);

/// Empties every list: before the first stage of a group.
void clear_candidates(Workspace& w);

}  // namespace tangere
