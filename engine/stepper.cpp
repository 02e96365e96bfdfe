// SPDX-License-Identifier: Apache-2.0
// Between the batch and the group: gathers eight lanes, steps them, scatters what succeeded.
#include "engine/stepper.hpp"

#include <algorithm>
#include <cmath>

#include "engine/group_step.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::kGroup;
using kernels::LaneRow;

namespace {

StepSettings settings_of(const Model& model, const StepperOptions& o) {
  const StepSettings s = {o.integrator.value_or(model.integrator()), o.timestep.value_or(model.timestep()),
                          o.tolerance.value_or(model.solver().tolerance), model.solver().max_iterations};
  if (!(s.timestep > 0) || !std::isfinite(s.timestep))
    throw InputError("timestep " + std::to_string(s.timestep) + " s; expected a positive number");
  if (!(s.tolerance > 0) || !std::isfinite(s.tolerance))
    throw InputError("solver tolerance " + std::to_string(s.tolerance) + "; expected a positive number");
  return s;
}

}  // namespace

struct Stepper::Impl {
  Model model;
  StepSettings settings;
  GroupStep step;
  Workspace work;

  Impl(const Model& m, const StepSettings& s)
      : model(m), settings(s), step(model.compiled(), settings), work(model.compiled()) {}

  /// Motor forces of one lane. Returns false when a control is not finite.
  bool set_forces(int lane, std::span<const double> u) {
    const CompiledModel& m = model.compiled();
    for (int i = 0; i < m.nv; ++i) work.stage.tau[i][lane] = 0;
    for (int k = 0; k < m.nu; ++k) {
      if (!std::isfinite(u[k])) return false;
      const CompiledMotor& motor = m.motors[k];
      const double clipped = std::clamp(u[k], -1.0, 1.0);
      work.stage.tau[motor.dof][lane] += motor.low + (clipped + 1) * (0.5 * (motor.high - motor.low));
    }
    return true;
  }
};

Stepper::Stepper(const Model& model, const StepperOptions& options)
    : impl_(std::make_unique<Impl>(model, settings_of(model, options))) {}
Stepper::~Stepper() = default;
Stepper::Stepper(Stepper&&) noexcept = default;
Stepper& Stepper::operator=(Stepper&&) noexcept = default;

double Stepper::timestep() const { return impl_->settings.timestep; }
Integrator Stepper::integrator() const { return impl_->settings.integrator; }
double Stepper::tolerance() const { return impl_->settings.tolerance; }

void Stepper::step(Batch& batch, std::span<const double> controls) {
  for (int b = 0; b < batch.blocks(); ++b) step_block(batch, b, controls);
}

void Stepper::step_block(Batch& batch, int block, std::span<const double> controls) {
  const CompiledModel& m = impl_->model.compiled();
  Workspace& w = impl_->work;
  double* data = batch.block(block);
  for (int group = 0; group < kBlock / kGroup; ++group) {
    const int first = block * kBlock + group * kGroup;
    NewtonReport report;
    LaneBits live = 0, history = 0;
    for (int l = 0; l < kGroup; ++l) {
      const std::size_t lane = std::size_t(first + l);
      if (first + l >= batch.environments() || failed(batch.status_[lane])) continue;
      if (!impl_->set_forces(l, controls.subspan(lane * std::size_t(m.nu), std::size_t(m.nu)))) {
        batch.status_[lane] = StepStatus::non_finite;
        batch.iterations_[lane] = 0;
        continue;
      }
      live |= 1U << l;
      if (batch.has_history_[lane] != 0) history |= 1U << l;
    }
    if (live == 0) continue;
    const auto rows = [&](int row) { return reinterpret_cast<LaneRow*>(data + row * kBlock + group * kGroup); };
    constexpr int kStride = kBlock / kGroup;  // LaneRows between consecutive rows of a block
    const auto gather = [&](LaneRow* to, int row, int count) {
      for (int i = 0; i < count; ++i) to[i] = rows(row)[i * kStride];
    };
    gather(w.q0, m.layout.q, m.nq);
    gather(w.v0, m.layout.v, m.nv);
    gather(w.q_before, m.layout.previous_q, m.nq);
    gather(w.v_before, m.layout.previous_v, m.nv);
    w.stage.block = data;
    w.stage.group = group;
    impl_->step.advance(kernels::active_kernels(), w, live, history, report);
    for (int l = 0; l < kGroup; ++l) {
      if (!has(live, l)) continue;
      const std::size_t lane = std::size_t(first + l);
      batch.status_[lane] = report.status[l];
      batch.iterations_[lane] = report.iterations[l];
      batch.residual_[lane] = report.residual[l];
      if (failed(report.status[l])) continue;
      batch.has_history_[lane] = 1;
      const auto shift = [&](int now, int before, const LaneRow* from, int count) {
        for (int i = 0; i < count; ++i) {
          rows(before)[i * kStride][l] = rows(now)[i * kStride][l];
          rows(now)[i * kStride][l] = from[i][l];
        }
      };
      shift(m.layout.q, m.layout.previous_q, w.q0, m.nq);
      shift(m.layout.v, m.layout.previous_v, w.v0, m.nv);
    }
  }
}

}  // namespace tangere
