// SPDX-License-Identifier: Apache-2.0
// The run is played again from its start, with tapes.
#include "apps/run_gradients.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <numeric>

#include "apps/memory.hpp"
#include "apps/scene_run.hpp"
#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"

namespace tangere::apps {

void GradientArguments::add(CLI::App& app) {
  add_text(app, "--gradients", loss, "LOSS",
           "For a scene: also write derivatives of a loss by controls, start and the scene's "
           "numbers: final, path, tactile, shear, variables, markers, pictures or channels; not "
           "with --sleep");
  add_flag(app, "--point-gradients", points,
           "With --gradients: also by place and coefficients of every tactile point");
  add_memory_size(app, "--tape-memory", tape_memory,
                  "With --gradients: memory for the states kept, such as 2GiB; with less than all "
                  "of them steps are repeated from checkpoints, with the same bits [default: 1GB]");
}

void GradientArguments::check() const {
  if (tape_memory && loss.empty())
    throw InputError("--tape-memory without --gradients; expected both");
  if (points && loss.empty())
    throw InputError("--point-gradients without --gradients; expected both");
}

namespace {

/// A table for each sensor from (E, points of all, kPointNumbers).
void add_points(const Scene& scene, const Model& model, std::span<const double> all,
                std::size_t environments, Recording& recording) {
  recording.groups.push_back(
      {"gradients/grad_points",
       {{"meaning",
         "derivative of the loss by each tactile point's place in its body's axes and its own "
         "coefficients"}}});
  std::size_t next = 0;
  for (std::size_t s = 0; s < model.sensors().size(); ++s) {
    const auto points = static_cast<std::size_t>(model.sensors()[s].points),
               width = points * std::size_t{kPointNumbers};
    Channel channel{.name = "gradients/grad_points/" + model.sensors()[s].name,
                    .shape = {points, std::uint64_t{kPointNumbers}},
                    .rows = static_cast<std::int64_t>(environments)};
    for (int k = 0; k < kPointNumbers; ++k) {
      channel.names.emplace_back(point_number_name(k));
      channel.units.emplace_back(point_number_unit(k, scene.sensors[s].law));
    }
    std::vector<double> numbers;
    for (std::size_t e = 0; e < environments; ++e) {
      const auto part = all.subspan(e * (all.size() / environments) + next, width);
      numbers.insert(numbers.end(), part.begin(), part.end());
    }
    recording.tables.push_back({std::move(channel), std::move(numbers)});
    next += width;
  }
}

/// The gradients of a loss as tables whose rows are environments.
Recording described(const LossGradient& g, const std::string& loss, const Model& model,
                    std::int64_t steps) {
  Recording recording;
  recording.groups.push_back(
      {"gradients", {{"loss", loss}, {"meaning", loss_meaning(loss_named(loss))}}});
  const auto environments = static_cast<std::int64_t>(g.value.size());
  const auto add = [&](const char* name, std::vector<std::uint64_t> shape,
                       const std::vector<double>& numbers, const char* meaning,
                       std::vector<std::string> names, std::vector<std::string> units) {
    recording.tables.push_back({{.name = name,
                                 .shape = std::move(shape),
                                 .rows = environments,
                                 .names = std::move(names),
                                 .units = std::move(units),
                                 .meaning = meaning},
                                numbers});
  };
  const std::vector<std::string> u_names(model.u_names().begin(), model.u_names().end()),
      v_names(model.v_names().begin(), model.v_names().end());
  add("gradients/loss", {}, g.value, "the loss of each environment", {}, {});
  if (!u_names.empty())
    add("gradients/grad_u", {static_cast<std::uint64_t>(steps), u_names.size()}, g.u,
        "derivative of the loss by the controls of every step", u_names, {});
  add("gradients/grad_q", {v_names.size()}, g.q,
      "by the initial positions, along the dofs of v; rotations on the right", v_names, {});
  add("gradients/grad_v", {v_names.size()}, g.v, "by the initial velocities", v_names, {});
  std::vector<std::string> names, units;
  const NumberGradients parameters(model);
  for (const NumberInfo& info : parameters.infos())
    names.push_back(info.name), units.push_back(info.unit);
  add("gradients/grad_numbers", {names.size()}, g.parameters,
      "by the numbers of the scene, in the units given", names, units);
  if (!g.points.empty()) add_points(model.scene(), model, g.points, g.value.size(), recording);
  return recording;
}

}  // namespace

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
  output.add(described(g, name_, start_->model(), rollout.steps));
  value_ = g.value;
  recomputed_steps_ = summary.recomputed_steps;
  return true;
}

Json RunGradients::json() const {
  if (!requested()) return nullptr;
  const double sum = std::accumulate(value_.begin(), value_.end(), 0.0);
  return {{"loss_name", name_},
          {"mean_loss", sum / static_cast<double>(value_.size())},
          {"recomputed_steps", recomputed_steps_}};
}

}  // namespace tangere::apps
