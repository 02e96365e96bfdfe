// SPDX-License-Identifier: Apache-2.0
// Connects the batch with the group: gathers eight lanes, steps them, scatters those that
// succeeded.
#include "engine/step/stepper.hpp"

#include <algorithm>
#include <cmath>

#include "engine/step/motor_force.hpp"
#include "engine/step/step_settings.hpp"
#include "engine/step/tape.hpp"

namespace tangere {

using kernels::kBlock;
using kernels::kGroup;

namespace {

/// Parts that keep an accuracy are solved to this share of it, so that what is measured is the
/// error of the scheme. What solves leave adds up over the steps, and no estimate sees it. So they
/// are at most `kLooser` times as loose as those of plain steps.
constexpr double kShareOfAccuracy = 0.01, kTightest = 1e-9, kLoosest = 1e-4, kLooser = 10;

void check_accuracy(const StepperOptions& o, double accuracy) {
  if (!(accuracy >= 0 && accuracy < 1))
    throw InputError("accuracy " + std::to_string(accuracy) +
                     "; expected a share below 1 (0.01 is one percent), or 0 for plain steps");
  if (accuracy > 0 && o.integrator && o.integrator->scheme().estimate.empty())
    throw InputError(std::string(to_string(*o.integrator)) +
                     " has no estimate of its error, so it cannot keep an accuracy; expected "
                     "another scheme, or none");
}

}  // namespace

StepSettings step_settings(const Model& model, const StepperOptions& o) {
  const double accuracy = o.accuracy.value_or(model.solver().accuracy.value_or(0));
  check_accuracy(o, accuracy);
  StepSettings s = {
      .integrator = o.integrator.value_or(keeping_accuracy(model.scene().integrator, accuracy)),
      .timestep = o.timestep.value_or(model.timestep()),
      .tolerance = 0,
      .max_iterations = model.solver().max_iterations,
      .accuracy = accuracy,
      .spare = false,
      .bounded_energy = model.solver().bounded_energy};
  if (!(s.timestep > 0) || !std::isfinite(s.timestep))
    throw InputError("timestep " + std::to_string(s.timestep) + " s; expected a positive number");
  double following = model.following_tolerance(s.integrator, s.timestep);
  if (accuracy > 0)
    following =
        std::min(kLooser * following, std::clamp(kShareOfAccuracy * accuracy, kTightest, kLoosest));
  s.tolerance = o.tolerance.value_or(model.solver().tolerance.value_or(following));
  s.spare = !o.tolerance && !model.solver().tolerance;
  if (!(s.tolerance > 0) || !std::isfinite(s.tolerance))
    throw InputError("solver tolerance " + std::to_string(s.tolerance) +
                     "; expected a positive number");
  return s;
}

Integrator integrator_in_force(const Model& model, const StepperOptions& options) {
  return step_settings(model, options).integrator;
}

StepperOptions for_gradients(const Model& model, StepperOptions options) {
  if (!options.tolerance && !model.solver().tolerance) options.tolerance = kGradientTolerance;
  return options;
}

/// Keeps a lane's state, which a step is about to replace, for sensors with memory.
static void remember(const BlockLayout& layout, double* column, std::int64_t steps) {
  const int numbers = layout.previous_q - layout.q;
  const int place = layout.past + numbers * static_cast<int>(steps % layout.past_states);
  for (int k = 0; k < numbers; ++k) column[(place + k) * kBlock] = column[(layout.q + k) * kBlock];
}

/// Lanes of one group of a block. Environment `first` + l is in lane l.
struct GroupOfBlock {
  double* rows;  ///< row r of lane l: rows[r * kBlock + l]
  int first;
  LaneBits live = 0, history = 0;
};

struct Stepper::Impl {
  Model model;
  StepSettings settings;
  GroupStep step;
  Workspace work;
  SingleWorkspace single;

  Impl(const Model& m, const StepSettings& s)
      : model(m),
        settings(s),
        step(compiled(model), settings),
        work(compiled(model), s.integrator.scheme().most_inner_stages()),
        single(compiled(model), s.integrator.scheme().most_inner_stages()) {}

  /// Steps the live lanes of a group. `lane`: the one that is in lane 0 of a workspace of one.
  template <int L>
  void step_lanes(Batch& batch, BasicWorkspace<L>& w, const GroupOfBlock& g, int lane,
                  BlockTape* tape) {
    const CompiledModel& m = compiled(model);
    const auto gather = [&](kernels::Row<L>* to, int row, int count) {
      for (int i = 0; i < count; ++i)
        for (int l = 0; l < L; ++l) to[i][l] = g.rows[(row + i) * kBlock + lane + l];
    };
    gather(w.q0, m.layout.q, m.nq);
    gather(w.v0, m.layout.v, m.nv);
    gather(w.q_before, m.layout.previous_q, m.nq);
    gather(w.v_before, m.layout.previous_v, m.nv);
    if (!m.memories.empty())
      for (int l = 0; l < L; ++l)
        w.remembered.now[std::size_t(l)] = batch.memory_[std::size_t(g.first + lane + l)];
    w.stage.block = g.rows + lane;
    w.stage.group = 0;
    const LaneBits live = g.live >> lane;
    NewtonReport report;
    SolveLog log;
    const int of_block = g.first % kBlock + lane;
    if (tape != nullptr && tape->next_inner() != nullptr) log.inner = tape->next_inner() + of_block;
    step.advance(kernels::active_kernels(), w, single, live, g.history >> lane, report,
                 tape == nullptr ? nullptr : &log);
    for (int l = 0; l < L; ++l)
      if (std::vector<TapedSolve>& solves = log.special[std::size_t(l)]; !solves.empty())
        tape->add({tape->steps(), of_block + l, std::move(solves)});
    for (int l = 0; l < L; ++l) {
      if (!has(live, l)) continue;
      const std::size_t e = std::size_t(g.first + lane + l);
      batch.status_[e] = report.status[l];
      batch.iterations_[e] = report.iterations[l];
      batch.residual_[e] = report.residual[l];
      if (failed(report.status[l])) continue;
      if (m.layout.past_states > 0) remember(m.layout, g.rows + lane + l, batch.steps_[e]);
      ++batch.steps_[e];
      if (!m.memories.empty()) batch.memory_[e] = w.remembered.now[std::size_t(l)];
      // One step back is too long for BDF2's history where a step had to be cut.
      batch.has_history_[e] = settings.accuracy > 0 ? 0 : 1;
      const auto shift = [&](int now, int before, const kernels::Row<L>* from, int count) {
        for (int i = 0; i < count; ++i) {
          double* row = g.rows + i * kBlock + lane + l;
          row[before * kBlock] = row[now * kBlock];
          row[now * kBlock] = from[i][l];
        }
      };
      shift(m.layout.q, m.layout.previous_q, w.q0, m.nq);
      shift(m.layout.v, m.layout.previous_v, w.v0, m.nv);
    }
  }
};

Stepper::Stepper(const Model& model, const StepperOptions& options)
    : impl_(std::make_unique<Impl>(model, step_settings(model, options))) {}
Stepper::~Stepper() = default;
Stepper::Stepper(Stepper&&) noexcept = default;
Stepper& Stepper::operator=(Stepper&&) noexcept = default;

double Stepper::timestep() const { return impl_->settings.timestep; }
Integrator Stepper::integrator() const { return impl_->settings.integrator; }
double Stepper::tolerance() const { return impl_->settings.tolerance; }
double Stepper::accuracy() const { return impl_->settings.accuracy; }

void Stepper::step(Batch& batch, std::span<const double> controls) {
  for (int b = 0; b < batch.blocks(); ++b) step_block(batch, b, controls);
}

void Stepper::step_block(Batch& batch, int block, std::span<const double> controls,
                         BlockTape* tape) {
  const CompiledModel& model = compiled(impl_->model);
  const std::size_t nu = std::size_t(model.nu);
  for (int group = 0; group < kBlock / kGroup; ++group) {
    GroupOfBlock g{batch.block(block) + group * kGroup, block * kBlock + group * kGroup};
    for (int l = 0; l < kGroup; ++l) {
      const std::size_t e = std::size_t(g.first + l);
      if (g.first + l >= batch.environments() || failed(batch.status_[e]) || batch.held_[e] != 0)
        continue;
      g.live |= 1U << l;
      if (batch.has_history_[e] != 0) g.history |= 1U << l;
    }
    // A lone environment goes through kernels of one lane: the same bits, a third of the time.
    const bool alone = g.live != 0 && (g.live & (g.live - 1)) == 0;
    for (int l = 0; l < kGroup; ++l) {
      if (!has(g.live, l)) continue;
      const std::size_t e = std::size_t(g.first + l);
      const std::span<const double> u = controls.subspan(e * nu, nu);
      const double* state = g.rows + l;
      if (alone ? set_motors(model, impl_->single, 0, state, u)
                : set_motors(model, impl_->work, l, state, u))
        continue;
      batch.status_[e] = StepStatus::non_finite;
      batch.iterations_[e] = 0;
      g.live &= ~(1U << l);
    }
    if (g.live == 0) continue;
    if (alone) {
      impl_->step_lanes(batch, impl_->single, g, __builtin_ctz(g.live), tape);
    } else {
      impl_->step_lanes(batch, impl_->work, g, 0, tape);
    }
  }
  if (tape != nullptr) tape->append(batch, block);
}

std::size_t Stepper::workspace_bytes(const Model& model) {
  return Workspace::bytes(compiled(model));
}

}  // namespace tangere
