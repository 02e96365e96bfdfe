// SPDX-License-Identifier: Apache-2.0
// The joints of a scene: elementary links, coordinates, what acts on them, where they start. Steps
// of compile().
#pragma once

#include "engine/model/compiled_model.hpp"
#include "engine/model/name_index.hpp"

namespace tangere {

/// Appends a joint's elementary links. `parent`: the link it hangs on, -1 the world; `frame`: its
/// rest pose there.
CompiledJoint add_joint(CompiledModel& m, const JointDescription& d, int parent,
                        const kernels::Frame<double>& frame);

/// Damping, springs, armature and limits per dof, and the flags of the links.
void compile_joint_effects(CompiledModel& m);

/// One motor per dof of every driven joint.
void compile_motors(CompiledModel& m, const NameIndex& joints);

void compile_initial_state(CompiledModel& m, const NameIndex& joints);

/// Lets a number of a joint or of its motor come from a row of the block.
void vary_joint(CompiledModel& m, const NameIndex& joints, const RandomizationDescription& d,
                int row);

/// Throws where nothing with mass moves with a joint: its mass matrix would be singular.
void check_masses(const CompiledModel& m);

}  // namespace tangere
