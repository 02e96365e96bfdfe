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

#include "engine/model/model_part.hpp"
#include "engine/step/detection.hpp"
#include "engine/step/lane_energy.hpp"
#include "engine/step/rotation_defect.hpp"
#include "engine/step/shear_lane.hpp"

namespace tangere {

using kernels::Row;

namespace {

constexpr double kJump = 0.05;
/// The share of the moving energy that a step may create.
constexpr double kMayCreate = 1e-3;

/// Returns the lanes in which the only face at the end of the solve is opposite to that at its
/// start.
template <int L>
LaneBits passed_pair(const BasicWorkspace<L>& w, std::size_t pair) {
  LaneBits passed = 0;
  for (int l = 0; l < L; ++l) {
    double along = 0, all = 0;
    for (std::size_t i = 3 * pair; i < 3 * pair + 3; ++i) {
      const double before = w.stage.faces[i][l], after = w.faces_after[i][l];
      along += before * after;
      all += std::abs(before) + std::abs(after);
    }
    if (along == -1 && all == 2) passed |= 1U << l;
  }
  return passed;
}

/// Returns the lanes in which a body passed through a cuboid that it touches: its only face at the
/// start of the solve is opposite to its only face at the end.
template <int L>
LaneBits passed_faces(const CompiledModel& model, const kernels::KernelTable& table,
                      BasicWorkspace<L>& w, LaneBits lanes) {
  if (!model.view.faced) return kNoLane;
  LaneBits passed = 0;
  table.stage<L>().choose_faces(model.view, w.stage, w.faces_after);
  for_each_considered(model, w, [&](std::size_t g) {
    const kernels::LinkPair& links = model.link_pairs[g];
    for (int member = links.first; member < links.first + links.count; ++member) {
      const std::size_t k = std::size_t(model.pair_order[std::size_t(member)]);
      if (can_exert_force(model.pairs[k].parameters)) passed |= lanes & passed_pair(w, k);
    }
  });
  return passed;
}

/// Computes the poses of links where the present solve began and ended.
template <int L>
void find_poses(const CompiledModel& model, const kernels::KernelTable& table,
                BasicWorkspace<L>& w) {
  const auto at = [&](const Row<L>* q, const Row<L>* v, auto& poses) {
    table.stage<L>().poses_at(model.view, w.stage, q, v, w.zero, poses.data());
  };
  at(w.q0, w.v0, w.poses_before);
  at(w.q1, w.v1, w.poses_after);
}

/// Returns the lanes in which a body passed through one of its contact partners.
template <int L>
LaneBits tunnelled(const CompiledModel& model, const TunnellingCheck& check,
                   const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes) {
  LaneBits found = passed_faces(model, table, w, lanes);
  const LaneBits near = lanes & ~check.out_of_reach<L>(w, lanes);
  if (near == 0) return found;
  const LaneBits far = near & check.far_movers<L>(w.stage.x, w.test);
  if (far == 0) return found;
  find_poses(model, table, w);
  for (int l = 0; l < L; ++l)
    if (has(far, l) && check.tunnelled<L>(w.poses_before, w.poses_after, l)) found |= 1U << l;
  return found;
}

/// Returns the lanes whose velocities jumped.
template <int L>
LaneBits velocity_jumps(const CompiledModel& model, const std::vector<double>& component_mass,
                        const BasicWorkspace<L>& w, LaneBits lanes, const Row<L>& h) {
  const double gravity = dot(model.view.gravity, model.view.gravity);  // its square
  LaneBits found = 0;
  for (int c = 0; c < model.components(); ++c) {
    Row<L> jump{}, before{}, after{};
    for (const int i : dofs_of_component(model, c))
      for (int l = 0; l < L; ++l) {
        const double D = w.stage.weight[i][l] * w.stage.weight[i][l];
        const double v0 = w.v0[i][l], v1 = w.v1[i][l];
        jump[l] += D * (v1 - v0) * (v1 - v0);
        before[l] += D * v0 * v0;
        after[l] += D * v1 * v1;
      }
    for (int l = 0; l < L; ++l)
      if (jump[l] > kJump * kJump * std::max(before[l], after[l]) &&
          jump[l] > 3 * (gravity * h[l] * h[l]) * component_mass[std::size_t(c)])
        found |= 1U << l;
  }
  return found & lanes;
}

/// Returns the largest work that force motors with D do in a step of one lane [J]: by the force at
/// its start or at its end.
template <int L>
double servo_work(const CompiledModel& model, const BasicWorkspace<L>& w, int lane) {
  double work = 0;
  for (const CompiledMotor& motor : model.motors) {
    if (motor.control != MotorControl::force || !motor.at_end) continue;
    const auto work_at = [&](double v) {
      const double force =
          w.stage.target[motor.dof][lane] - number_of<L>(motor.D, w.stage, lane) * v;
      return std::clamp(force, motor.low, motor.high) * w.stage.x[motor.dof][lane];
    };
    work += std::max(work_at(w.v0[motor.dof][lane]), work_at(w.v1[motor.dof][lane]));
  }
  return work;
}

/// Returns the lanes whose solve created energy.
template <int L>
LaneBits energy_gains(const CompiledModel& model, const std::vector<double>& component_mass,
                      const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                      const Row<L>& h) {
  const LaneBits jumped = velocity_jumps(model, component_mass, w, lanes, h);
  if (jumped == 0) return kNoLane;
  find_poses(model, table, w);
  LaneBits found = 0;
  for (int l = 0; l < L; ++l) {
    if (!has(jumped, l)) continue;
    const LaneEnergy before = energy_of_bodies(model, w, w.poses_before, w.q0, w.v0, l),
                     after = energy_of_bodies(model, w, w.poses_after, w.q1, w.v1, l);
    double gain = after.total - before.total;
    for (int i = 0; i < model.nv; ++i) gain -= w.stage.tau[i][l] * w.stage.x[i][l];
    gain -= servo_work(model, w, l);
    const ShearLanes<L>& memory = w.shear;
    const double held = energy_of_contacts(model, table, w, w.poses_before, l) +
                        energy_of_friction(model, w, w.poses_before, memory.now[std::size_t(l)], l),
                 holds =
                     energy_of_contacts(model, table, w, w.poses_after, l) +
                     energy_of_friction(model, w, w.poses_after, memory.after[std::size_t(l)], l);
    if (gain + holds - held > kMayCreate * std::max(before.moving + held, after.moving + holds))
      found |= 1U << l;
  }
  return found;
}

/// Returns the lanes in which a body rotated too far for the scheme. Bodies in contact are not
/// checked, because the scheme may damp them.
template <int L>
LaneBits over_rotations(const CompiledModel& model, const Scheme& scheme,
                        const kernels::KernelTable& table, BasicWorkspace<L>& w, LaneBits lanes,
                        const Row<L>& h) {
  LaneBits found = over_rotated(model, scheme, w, lanes, h);
  if (found == 0) return kNoLane;
  find_poses(model, table, w);
  for (int l = 0; l < L; ++l)
    if (has(found, l) && (energy_of_contacts(model, table, w, w.poses_before, l) > 0 ||
                          energy_of_contacts(model, table, w, w.poses_after, l) > 0))
      found &= ~(1U << l);
  return found;
}

}  // namespace

StepChecks::StepChecks(const CompiledModel& model, const StepSettings& settings)
    : model_(model),
      bounded_energy_(settings.bounded_energy),
      cut_(settings.accuracy > 0),
      tunnelling_(model) {
  std::vector<double> dof_mass(std::size_t(model.nv));  // a link's mass counts at its first dof
  for (const kernels::Link& link : model.links) dof_mass[std::size_t(link.v)] = link.mass;
  for (int c = 0; c < model.components(); ++c) {
    double sum = 0;
    for (const int i : dofs_of_component(model, c)) sum += dof_mass[std::size_t(i)];
    component_mass_.push_back(sum);
  }
}

template <int L>
std::array<unsigned, L> StepChecks::failures(const Scheme& scheme,
                                             const kernels::KernelTable& table,
                                             BasicWorkspace<L>& w, LaneBits found,
                                             LaneBits softened, const Row<L>& h) const {
  LaneBits sound = found;
  if (scheme.order > 1 && softened != 0)
    sound &= ~velocity_jumps(model_, component_mass_, w, found & softened, h);
  std::array<unsigned, L> failures;
  for (int l = 0; l < L; ++l) failures[l] = has(sound, l) ? 0U : kNoRoot;
  const auto reject = [&](LaneBits lanes, Failure failure) {
    for (int l = 0; l < L; ++l)
      if (has(lanes, l)) failures[l] = failure;
    sound &= ~lanes;
  };
  reject(tunnelled(model_, tunnelling_, table, w, sound), kTunnelled);
  if (bounded_energy_ && !cut_)
    reject(energy_gains(model_, component_mass_, table, w, sound, h), kEnergyCreated);
  if (bounded_energy_) reject(over_rotations(model_, scheme, table, w, sound, h), kOverRotated);
  return failures;
}

template std::array<unsigned, kernels::kGroup> StepChecks::failures<kernels::kGroup>(
    const Scheme&, const kernels::KernelTable&, Workspace&, LaneBits, LaneBits,
    const Row<kernels::kGroup>&) const;
template std::array<unsigned, 1> StepChecks::failures<1>(const Scheme&, const kernels::KernelTable&,
                                                         SingleWorkspace&, LaneBits, LaneBits,
                                                         const Row<1>&) const;

}  // namespace tangere
