// SPDX-License-Identifier: Apache-2.0
// Error of a scheme in angular momentum, for bodies that rotate far in a step.
//
// A scheme integrates angular velocities in body axes. Its change of the momentum P = R J ω of a
// body, in fixed axes, follows from its equations (engine/scene/scheme.hpp): with T = J a + ω × Jω
// the torque of a stage, and ΔR its rotation since the start of the step,
//   (c₀ ΔP + (s_before ΔP_before + Σ s_inner ΔP_j)/s_divisor)/h - ΔR T,  ΔP = ΔR Jω - Jω₀
// should be zero. Solved for ΔP stage by stage, it is the error of momentum of the step. It is zero
// for a constant axis of rotation, and of the scheme's order in the angle of rotation.
#pragma once

#include "engine/scene/scheme.hpp"
#include "engine/step/workspace.hpp"

namespace tangere {

/// Returns the lanes in which a step of length h made more momentum, of some ball joint that turned
/// far, than 3e-5 of the body's per radian, and more than half a percent of what its torque made.
/// The step ended in the workspace's v1.
template <int L>
LaneBits over_rotated(const CompiledModel& model, const Scheme& scheme, const BasicWorkspace<L>& w,
                      LaneBits lanes, const kernels::Row<L>& h);

}  // namespace tangere
