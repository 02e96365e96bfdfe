// SPDX-License-Identifier: Apache-2.0
// Mechanical energy of one environment, for the check that a step creates none.
//
//   E = Σ (m v² + 2 ω·(c × v) + ω·Jω)/2 + I_a v²/2 - Σ gravity·(m p + R c)
//       + Σ k (q - rest)²/2 + Σ k_l (q beyond a limit)²/2 + Σ f (e - f/2P) + Σ k_n d²/2
//       + Σ k_s |s|²/2 + Σ k |gap|²/2 + Σ k_t |turn|²/2
// with c the mass times centre of mass and J the inertia of a link about its origin, e the distance
// of a position motor from its target, f = clip(P e, range), s the elastic displacement of a point
// with a shear spring, gap and turn of a loop. Damping and slip only dissipate energy; gravity,
// springs, limits, motors with constant target and contacts with constant faces are conservative.
// So E can rise only by the work of forces that are known at the start of the step.
#pragma once

#include "engine/step/workspace.hpp"

namespace tangere {

struct LaneEnergy {
  double total = 0;   ///< [J]
  double moving = 0;  ///< the part of it that cannot be negative: all but height [J]
};

/// Computes E without contacts of one lane at (q, v). `poses`: those of its links there. Targets
/// and parameters are those in the workspace.
template <int L>
LaneEnergy energy_of_bodies(const CompiledModel& model, const BasicWorkspace<L>& w,
                            const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& poses,
                            const kernels::Row<L>* q, const kernels::Row<L>* v, int lane);

/// Computes the normal energy of the contacts of one lane [J], with the faces in the workspace.
/// Overwrites its `search`.
template <int L>
double energy_of_contacts(const CompiledModel& model, const kernels::KernelTable& table,
                          BasicWorkspace<L>& w,
                          const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& poses, int lane);

/// Computes the energy of the shear springs of contacts in one lane [J]: Σ k_s |s|²/2 over the
/// points of `memory`, on a layer times the load that friction has there over the normal force of
/// the point's spring (engine/layer/layer_force.hpp). Sensors act on no body, so their springs are
/// left out. `poses`: of the links, at which layers are solved.
template <int L>
double energy_of_friction(const CompiledModel& model, const BasicWorkspace<L>& w,
                          const AlignedVector<kernels::LinkPose<kernels::Row<L>>>& poses,
                          const ShearState& memory, int lane);

/// Energy balance of one environment: stored energy, and power of motors and damping.
struct EnergyTerms {
  double motion = 0;  ///< energy of moving bodies and armatures [J]
  double height = 0;  ///< -Σ gravity·(m p + R c) [J]
  double held = 0;    ///< by springs, limits and contacts [J]
  double motors = 0;  ///< power of the motors [W]
  double taken = 0;   ///< power that damping and friction take [W]
};

/// Computes the energy balance at q0, v0 of a workspace whose poses_before, faces and motor forces
/// are set. Shear springs are ignored. Overwrites its `search`.
EnergyTerms energy_terms(const CompiledModel& model, const kernels::KernelTable& table,
                         SingleWorkspace& w);

/// Frame and body twist of a link in one lane.
template <int L>
kernels::Frame<double> frame_in_lane(const kernels::LinkPose<kernels::Row<L>>& pose, int lane) {
  kernels::Frame<double> f;
  for (int i = 0; i < 9; ++i) f.R.m[i / 3][i % 3] = pose.world.R.m[i / 3][i % 3][lane];
  f.p = {pose.world.p.x[lane], pose.world.p.y[lane], pose.world.p.z[lane]};
  return f;
}

}  // namespace tangere
