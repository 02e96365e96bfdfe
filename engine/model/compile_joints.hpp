// SPDX-License-Identifier: Apache-2.0
// The joints of a scene: elementary links, coordinates, effects and starting state. Steps of
// compile().
#pragma once

#include "engine/model/compiled_model.hpp"
#include "engine/model/name_index.hpp"

namespace tangere {

/// Appends a joint's elementary links. `parent`: the link that it is attached to, -1 for the world.
/// `frame`: its rest pose there.
CompiledJoint add_joint(CompiledModel& m, const JointDescription& d, int parent,
                        const kernels::Frame<double>& frame);

/// Returns the elementary link of a dof.
int link_of_dof(const CompiledModel& m, int dof);

/// Sets damping, springs, armature and limits per dof, and the flags of the links.
void compile_joint_effects(CompiledModel& m);

/// Fills CompiledModel::dry_dofs, after the contacts with shear springs.
void compile_dry_friction(CompiledModel& m);

/// Makes one motor per dof of every driven joint.
void compile_motors(CompiledModel& m, const NameIndex& joints);

void compile_initial_state(CompiledModel& m, const NameIndex& joints);

/// Makes row `row` of the block the source of a number of a joint or of its motor. Throws
/// InputError where that is not possible.
void vary_joint(CompiledModel& m, int joint, const RandomizationDescription& d, int row);

/// Throws InputError where a joint moves nothing with mass, or turns points of mass about
/// themselves: its mass matrix would be singular. Joints are at rest in this check.
void check_masses(const CompiledModel& m);

}  // namespace tangere
