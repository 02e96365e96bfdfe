// SPDX-License-Identifier: Apache-2.0
// Checks of converged steps: tunnelling, created energy, and rotations too large for the scheme
// (rotation_defect.hpp).
//
// Schemes of order two or three assume smooth forces. Across an impact, a release or a joint limit
// forces are not smooth, and kinetic energy can grow. The energy after a step (lane_energy.hpp) is
// compared with that before it if the velocities of some component changed by a large share:
//   ‖D^½ (v₁ - v₀)‖ > kJump max(‖D^½ v₀‖, ‖D^½ v₁‖)   and   > h |gravity| √(3 mass)
// The test is cheap, and false in smooth motion for short steps, so orders of convergence are kept.
#include "engine/step/step_checks.hpp"

#include <algorithm>
#include <cmath>

#include "engine/step/lane_energy.hpp"
#include "engine/step/rotation_defect.hpp"

namespace tangere {

using kernels::Row;

namespace {

constexpr double kJump = 0.05;
/// The share of the moving energy that a step may create.
constexpr double kMayCreate = 1e-3;

}  // namespace

StepChecks::StepChecks(const CompiledModel& model, const StepSettings& settings)
    : model_(model),
      bounded_energy_(settings.bounded_energy),
      cut_(settings.accuracy > 0),
      tunnelling_(model) {
  std::vector<double> of_dof(std::size_t(model.nv));  // a link's mass counts at its first dof
  for (const kernels::Link& link : model.links) of_dof[std::size_t(link.v)] = link.mass;
  for (int c = 0; c < model.components(); ++c) {
    double sum = 0;
    for (int k = model.component_begin[std::size_t(c)];
         k < model.component_begin[std::size_t(c) + 1]; ++k)
      sum += of_dof[std::size_t(model.component_dofs[std::size_t(k)])];
    component_mass_.push_back(sum);
  }
}

/// Computes the poses of links where the present solve began and ended.
template <int L>
void StepChecks::find_poses(const kernels::KernelTable& table, BasicWorkspace<L>& w) const {
  const auto at = [&](const Row<L>* q, const Row<L>* v, auto& poses) {
    table.stage<L>().poses_at(model_.view, w.stage, q, v, w.zero, poses.data());
  };
  at(w.q0, w.v0, w.poses_before);
  at(w.q1, w.v1, w.poses_after);
}

template <int L>
void StepChecks::find_tunnelling(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                                 LaneBits lanes, NewtonReport& report) const {
  const LaneBits near = lanes & ~tunnelling_.out_of_reach<L>(w, lanes);
  if (near == 0) return;
  const LaneBits far = near & tunnelling_.far_movers<L>(w.stage.x, w.test);
  if (far == 0) return;
  find_poses(table, w);
  for (int l = 0; l < L; ++l)
    if (has(far, l) && tunnelling_.tunnelled<L>(w.poses_before, w.poses_after, l))
      report.tunnelled |= 1U << l;
}

template <int L>
LaneBits StepChecks::velocity_jumps(const BasicWorkspace<L>& w, LaneBits lanes, double h) const {
  const double fall = dot(model_.view.gravity, model_.view.gravity) * h * h;
  LaneBits found = 0;
  for (int c = 0; c < model_.components(); ++c) {
    Row<L> jump{}, before{}, after{};
    const std::size_t begin = std::size_t(model_.component_begin[std::size_t(c)]),
                      end = std::size_t(model_.component_begin[std::size_t(c) + 1]);
    for (std::size_t k = begin; k < end; ++k) {
      const int i = model_.component_dofs[k];
      for (int l = 0; l < L; ++l) {
        const double D = w.stage.weight[i][l] * w.stage.weight[i][l];
        const double v0 = w.v0[i][l], v1 = w.v1[i][l];
        jump[l] += D * (v1 - v0) * (v1 - v0);
        before[l] += D * v0 * v0;
        after[l] += D * v1 * v1;
      }
    }
    const double by_gravity = 3 * fall * component_mass_[std::size_t(c)];
    for (int l = 0; l < L; ++l)
      if (jump[l] > kJump * kJump * std::max(before[l], after[l]) && jump[l] > by_gravity)
        found |= 1U << l;
  }
  return found & lanes;
}

template <int L>
LaneBits StepChecks::energy_gains(const kernels::KernelTable& table, BasicWorkspace<L>& w,
                                  LaneBits lanes, double h) const {
  if (!bounded_energy_ || cut_) return kNoLane;
  const LaneBits looked_at = velocity_jumps(w, lanes, h);
  if (looked_at == 0) return kNoLane;
  find_poses(table, w);
  LaneBits found = 0;
  for (int l = 0; l < L; ++l) {
    if (!has(looked_at, l)) continue;
    const LaneEnergy before = energy_of_bodies(model_, w, w.poses_before, w.q0, w.v0, l),
                     after = energy_of_bodies(model_, w, w.poses_after, w.q1, w.v1, l);
    double gain = after.total - before.total;
    for (int i = 0; i < model_.nv; ++i) gain -= w.stage.tau[i][l] * w.stage.x[i][l];
    const ShearLanes<L>& memory = w.remembered;
    const double held = energy_of_contacts(model_, table, w, w.poses_before, l) +
                        energy_of_friction(model_, w, memory.now[std::size_t(l)], l),
                 holds = energy_of_contacts(model_, table, w, w.poses_after, l) +
                         energy_of_friction(model_, w, memory.after[std::size_t(l)], l);
    if (gain + holds - held > kMayCreate * std::max(before.moving + held, after.moving + holds))
      found |= 1U << l;
  }
  return found;
}

template <int L>
LaneBits StepChecks::over_rotations(const Scheme& scheme, const kernels::KernelTable& table,
                                    BasicWorkspace<L>& w, LaneBits lanes, double h) const {
  if (!bounded_energy_) return kNoLane;
  const LaneBits far = far_turners(model_, scheme, w, lanes, h);
  LaneBits found = 0;
  for (int l = 0; l < L; ++l)
    if (has(far, l) && turned_too_far(model_, scheme, w, h, l)) found |= 1U << l;
  if (found == 0) return kNoLane;
  find_poses(table, w);
  for (int l = 0; l < L; ++l)
    if (has(found, l) && (energy_of_contacts(model_, table, w, w.poses_before, l) > 0 ||
                          energy_of_contacts(model_, table, w, w.poses_after, l) > 0))
      found &= ~(1U << l);
  return found;
}

#define TANGERE_FOR_LANES(L)                                                                      \
  template void StepChecks::find_tunnelling(const kernels::KernelTable&, BasicWorkspace<L>&,      \
                                            LaneBits, NewtonReport&) const;                       \
  template LaneBits StepChecks::velocity_jumps(const BasicWorkspace<L>&, LaneBits, double) const; \
  template LaneBits StepChecks::energy_gains(const kernels::KernelTable&, BasicWorkspace<L>&,     \
                                             LaneBits, double) const;                             \
  template LaneBits StepChecks::over_rotations(const Scheme&, const kernels::KernelTable&,        \
                                               BasicWorkspace<L>&, LaneBits, double) const;
TANGERE_FOR_LANES(kernels::kGroup)
TANGERE_FOR_LANES(1)
#undef TANGERE_FOR_LANES

}  // namespace tangere
