// SPDX-License-Identifier: Apache-2.0
// The run is played again from its start, with tapes.
#include "apps/run_gradients.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <numeric>

#include "apps/memory.hpp"
#include "apps/scene_run.hpp"
#include "engine/derivative/number_gradients.hpp"

namespace tangere::apps {

void GradientArguments::add(CLI::App& app) {
  add_text(
      app, "--gradients", loss, "LOSS",
      "Also write derivatives of a loss by controls, start and the scene's numbers: final, path, "
      "tactile, shear, variables or markers");
  add_flag(app, "--point-gradients", points,
           "With --gradients: also by place and coefficients of every tactile point");
  add_memory_size(app, "--tape-memory", tape_memory,
                  "With --gradients: memory for the states kept; a longer run repeats steps from "
                  "checkpoints [default: 1GB]");
}

void GradientArguments::check() const {
  if (tape_memory && loss.empty())
    throw InputError("--tape-memory without --gradients; expected both");
  if (points && loss.empty())
    throw InputError("--point-gradients without --gradients; expected both");
}

RunGradients::RunGradients(const GradientArguments& arguments, const Batch& batch,
                           const Stepper& stepper, const RolloutOptions& rollout)
    : name_(arguments.loss) {
  if (name_.empty()) return;
  const Model& model = batch.model();
  const int every = model.sensors().empty() ? 1 : tactile_interval(model.sensors()[0], rollout);
  const LossKind kind = loss_named(name_);
  if (arguments.points && kind != LossKind::tactile && kind != LossKind::shear)
    throw InputError("--point-gradients with --gradients " + name_ +
                     "; expected a loss that reads fields, tactile or shear");
  loss_ = make_loss(kind, model, every);
  TapeOptions options;
  options.length = rollout.steps;
  options.stepper = {stepper.integrator(), stepper.timestep(), stepper.tolerance(),
                     stepper.accuracy()};
  options.precision = rollout.precision;
  options.parameters = true;
  options.points = arguments.points;
  if (arguments.tape_memory) options.tape_bytes = *arguments.tape_memory;
  check_memory(gradient_bytes(model, batch.environments(), options, 1),
               fmt::format("--gradients of {} environments and {} steps", batch.environments(),
                           rollout.steps));
  const RolloutLoss* const losses[] = {loss_.get()};
  rollouts_.emplace(model, options, losses);
  start_ = batch;
}

bool RunGradients::write(const ControlProgram& controls, const RolloutOptions& rollout,
                         const StopSignals& signals, TrajectoryFile& output) {
  const GradientSummary summary = rollouts_->run(
      *start_,
      [&](std::int64_t step, int e, std::span<double> u) {
        controls.evaluate(rollout.first_step + step, start_->episode(e), u);
      },
      signals.token());
  if (summary.stopped) return false;
  const LossGradient& g = summary.losses[0];
  std::vector<std::string> names, units;
  const NumberGradients parameters(start_->model());
  for (const NumberInfo& info : parameters.infos())
    names.push_back(info.name), units.push_back(info.unit);
  output.write({name_, loss_meaning(loss_named(name_)), g.value, g.u, g.q, g.v, g.parameters, names,
                units, g.points});
  value_ = g.value;
  recomputed_steps_ = summary.recomputed_steps;
  return true;
}

Json RunGradients::json() const {
  if (!wanted()) return nullptr;
  const double sum = std::accumulate(value_.begin(), value_.end(), 0.0);
  return {{"loss_name", name_},
          {"mean_loss", sum / static_cast<double>(value_.size())},
          {"recomputed_steps", recomputed_steps_}};
}

}  // namespace tangere::apps
