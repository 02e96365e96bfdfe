// SPDX-License-Identifier: Apache-2.0
// The kernels' effects of a joint (kernels/step/joint_effects.hpp) in doubles: a state is a stage
// at x = 0.
#include "engine/sense/transmission_forces.hpp"

#include <fmt/format.h>

#include "engine/base/as_size.hpp"
#include "engine/base/checks.hpp"
#include "engine/model/compiled_model.hpp"
#include "engine/step/batch.hpp"
#include "engine/step/dry_friction_state.hpp"
#include "engine/step/motor_force.hpp"
#include "kernels/step/joint_effects.hpp"

namespace tangere {

using kernels::kBlock;

namespace {

/// An environment's state as a stage, with its motors.
class TransmissionStage {
 public:
  TransmissionStage(const CompiledModel& m, const double* column,
                    std::span<const ShearEntry> memory, std::span<const double> u)
      : m_(m),
        q_(as_size(m.nq)),
        v_(as_size(m.nv)),
        zero_(as_size(m.nv)),
        force_(as_size(m.nv)),
        target_(as_size(m.nv)),
        anchor_(as_size(m.nv)) {
    for (int i = 0; i < m.nq; ++i) q_[as_size(i)] = column[(m.layout.q + i) * kBlock];
    for (int i = 0; i < m.nv; ++i) v_[as_size(i)] = column[(m.layout.v + i) * kBlock];
    for (std::size_t k = 0; k < u.size(); ++k) {
      const CompiledMotor& motor = m.motors[k];
      if (motor.at_end)
        target_[as_size(motor.dof)] = motor_input(motor, u[k]);
      else
        force_[as_size(motor.dof)] +=
            force_at_start(m, motor, column, u.data() + (k - as_size(motor.component)));
    }
    for (const DryDof& dof : m.dry_dofs) anchor_[as_size(dof.v)] = q_[as_size(dof.q)];
    for (const ShearEntry& entry : dry_entries(m, memory))
      anchor_[as_size(dry_dof_of(m, entry).v)] -= entry.s[0];
    a_.centre = q_.data();
    a_.x = a_.s = zero_.data();
    a_.v = v_.data();
    a_.target = target_.data();
    a_.dry_anchor = anchor_.data();
    a_.c0_over_h = a_.inverse_h = 0;  // no acceleration
    a_.block = column;
    a_.group = 0;
  }

  [[nodiscard]] double force(const kernels::Transmission& t) const {
    const kernels::Link& link = m_.links[as_size(t.link)];
    const auto dof = as_size(t.v);
    double sum = force_[dof];
    if ((link.effects & kernels::kDamping) != 0)
      sum -= kernels::load_parameter(a_, m_.dof_effects[dof].damping) * v_[dof];
    if ((link.effects & kernels::kBeyondDamping) == 0) return sum;
    kernels::JointLoad<double> load;
    kernels::joint_load<kernels::JointKind::prismatic, false>(m_.view, a_, link, load);
    return sum + load.force[0];
  }

 private:
  const CompiledModel& m_;
  std::vector<double> q_, v_, zero_, force_, target_, anchor_;
  kernels::StageArgs<double> a_{};
};

}  // namespace

std::vector<double> transmission_forces(const Model& model, const Batch& batch, int environment,
                                        std::span<const double> u) {
  if (environment < 0 || environment >= batch.environments())
    throw InputError(
        fmt::format("environment {}; expected 0 to {}", environment, batch.environments() - 1));
  check_size("u", u.size(), as_size(model.nu()));
  const CompiledModel& m = compiled(model);
  std::vector<double> out;
  if (m.transmissions.empty()) return out;
  const TransmissionStage stage(m, batch.block(environment / kBlock) + environment % kBlock,
                                batch.shear_state(environment), u);
  for (const kernels::Transmission& t : m.transmissions) out.push_back(stage.force(t));
  return out;
}

}  // namespace tangere
