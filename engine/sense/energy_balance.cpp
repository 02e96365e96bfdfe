// SPDX-License-Identifier: Apache-2.0
// Energies are those of the step checks (engine/step/lane_energy.hpp).
#include "engine/sense/energy_balance.hpp"

#include "engine/step/dry_friction_state.hpp"
#include "engine/step/lane_energy.hpp"
#include "engine/step/motor_force.hpp"
#include "kernels/step/stage.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::Vec3;

struct EnergyBalanceReader::Impl {
  Model model;
  SingleWorkspace w;

  explicit Impl(const Model& m) : model(m), w(compiled(m)) {}

  /// Linear momentum, and angular about the world's origin.
  [[nodiscard]] std::array<double, 6> momentum(const double* block) const {
    const CompiledModel& m = compiled(model);
    Vec3<double> linear = {0, 0, 0}, angular = {0, 0, 0};
    for (std::size_t i = 0; i < m.links.size(); ++i) {
      if (!m.links[i].has_mass) continue;
      const auto [mass, c, J] = kernels::load_inertia<double>(m.links[i], block, 0);
      const kernels::Frame<double> at = frame_in_lane<1>(w.poses_before[i], 0);
      const auto& V = w.poses_before[i].V;
      const Vec3<double> turn = {V.a.x[0], V.a.y[0], V.a.z[0]},
                         slide = {V.l.x[0], V.l.y[0], V.l.z[0]};
      const Vec3<double> p = at.R * (mass * slide + cross(turn, c));
      linear = linear + p;
      angular = angular + at.R * (J * turn + cross(c, slide)) + cross(m.in_world(at.p), p);
    }
    return {linear.x, linear.y, linear.z, angular.x, angular.y, angular.z};
  }

  EnergyBalance audit(const Batch& batch, int environment, std::span<const double> u) {
    const CompiledModel& m = compiled(model);
    const double* column = batch.block(environment / kBlock) + environment % kBlock;
    for (int i = 0; i < m.nq; ++i) w.q0[i][0] = column[(m.layout.q + i) * kBlock];
    for (int i = 0; i < m.nv; ++i) w.v0[i][0] = column[(m.layout.v + i) * kBlock];
    w.stage.block = column;
    w.stage.group = 0;
    set_motors(m, w, 0, column, u);
    const std::span<const ShearEntry> memory = batch.shear_state(environment);
    w.shear.now[0].assign(memory.begin(), memory.end());
    set_dry_anchors(m, w);
    const kernels::KernelTable& table = kernels::active_kernels();
    const auto& stage = table.stage<1>();
    if (m.view.faced) stage.choose_faces_at(m.view, w.stage, w.q0, w.zero, w.stage.faces);
    stage.poses_at(m.view, w.stage, w.q0, w.v0, w.zero, w.poses_before.data());
    const EnergyTerms terms = energy_terms(m, table, w);
    return {terms.motion, terms.height, terms.held, terms.motors, terms.taken, momentum(column)};
  }
};

StepEnergyBalance between(const EnergyBalance& start, const EnergyBalance& end, double h) {
  StepEnergyBalance step;
  step.motor_work = 0.5 * h * (start.motor_power + end.motor_power);
  step.dissipated = 0.5 * h * (start.dissipation + end.dissipation);
  step.integrator_error = end.energy() - start.energy() - step.motor_work + step.dissipated;
  return step;
}

EnergyBalanceReader::EnergyBalanceReader(const Model& model)
    : impl_(std::make_unique<Impl>(model)) {}
EnergyBalanceReader::~EnergyBalanceReader() = default;
EnergyBalanceReader::EnergyBalanceReader(EnergyBalanceReader&&) noexcept = default;
EnergyBalanceReader& EnergyBalanceReader::operator=(EnergyBalanceReader&&) noexcept = default;

EnergyBalance EnergyBalanceReader::read(const Batch& batch, int environment,
                                        std::span<const double> u) {
  return impl_->audit(batch, environment, u);
}

}  // namespace tangere
