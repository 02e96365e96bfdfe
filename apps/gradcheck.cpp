// SPDX-License-Identifier: Apache-2.0
// tangere gradcheck: are the gradients of this scene right? A table per input, and one number.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <optional>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/scene_run.hpp"
#include "tasks/gradient_check.hpp"
#include "tasks/losses.hpp"

namespace tangere::apps {
namespace {

constexpr std::int64_t kDefaultSteps = 100;
constexpr int kDefaultEntries = 24;
constexpr double kTolerance = 1e-12;  // what a solve leaves is what differences of rollouts cannot see through

struct Options {
  std::string scene, loss, controls;
  std::optional<std::int64_t> steps;
  std::optional<int> every, entries;
  std::optional<std::uint64_t> seed;
  bool allow_unknown = false;
};

/// As given; tactile where there is a sensor, else the final state.
LossKind loss_of(const std::string& name, const Model& model) {
  if (!name.empty()) return loss_named(name);
  return model.sensors().empty() ? LossKind::final_state : LossKind::tactile;
}

/// A run of the scene's own length, or of a hundred steps where that is longer or has no end.
std::int64_t steps_of(const Options& o, const ControlProgram& controls) {
  if (o.steps) {
    controls.check_covers(*o.steps);
    return *o.steps;
  }
  const std::int64_t own = controls.steps();
  return own < 0 ? kDefaultSteps : std::min(own, kDefaultSteps);
}

void print(const Console& console, const GradientCheck& check) {
  console.print(fmt::format("{:<8} {:>7} {:>8} {:>6} {:>12} {:>12} {:>12}  {}", "input", "entries", "compared", "kinks", "norm",
                            "differences", "tangent", "largest difference at"));
  for (const CheckedInput& c : check.inputs)
    console.print(fmt::format("{:<8} {:>7} {:>8} {:>6} {:>12.4e} {:>12.1e} {:>12.1e}  {}", c.name, c.entries, c.compared, c.kinks,
                              c.norm, c.difference_error, c.tangent_error, c.worst));
  console.print(fmt::format("largest error {:.1e} of a gradient's norm, {} derivatives compared with differences, {} kinks",
                            check.max_relative_error(), check.entries(), check.kinks()));
}

Json json_of(const GradientCheck& check) {
  Json inputs = Json::array();
  for (const CheckedInput& c : check.inputs)
    inputs.push_back({{"input", c.name},
                      {"size", c.entries},
                      {"entries", c.compared},
                      {"kinks", c.kinks},
                      {"norm", c.norm},
                      {"difference_error", c.difference_error},
                      {"worst", c.worst},
                      {"tangent_error", c.tangent_error}});
  return inputs;
}

int run(const Options& o, const Console& console) {
  const Model model(read_scene_for(o.scene, o.allow_unknown, console));
  const Stepper stepper(model);
  const ControlProgram controls = make_controls(o.controls, o.seed.value_or(0), model, stepper, console);
  CheckOptions options;
  options.steps = steps_of(o, controls);
  options.entries = o.entries.value_or(kDefaultEntries);
  options.seed = o.seed.value_or(0);
  options.stepper.tolerance = std::min(model.solver().tolerance, kTolerance);
  const LossKind kind = loss_of(o.loss, model);
  RolloutOptions rollout;
  rollout.every = o.every.value_or(0);
  int every = 1;
  if (!model.sensors().empty()) every = tactile_interval(model.sensors()[0], rollout);
  const auto loss = make_loss(kind, model, every);
  const Batch start(model, 1, o.seed.value_or(0));
  console.print(fmt::format("{}: {} steps of {:g} s, {}, loss {}", model.scene().name, options.steps, stepper.timestep(),
                            to_string(stepper.integrator()), to_string(kind)));
  const GradientCheck check = check_gradient(
      start, [&](std::int64_t step, int, std::span<double> u) { controls.evaluate(step, 0, u); }, *loss, options);
  console.print(fmt::format("loss {:.9g}", check.loss));
  print(console, check);
  console.result({{"command", "gradcheck"},
                  {"exit_code", static_cast<int>(kDone)},
                  {"scene", o.scene},
                  {"loss_name", to_string(kind)},
                  {"loss", check.loss},
                  {"steps", options.steps},
                  {"every", every},
                  {"seed", options.seed},
                  {"integrator", to_string(stepper.integrator())},
                  {"max_relative_error", check.max_relative_error()},
                  {"entries", check.entries()},
                  {"kinks", check.kinks()},
                  {"inputs", json_of(check)}});
  return kDone;
}

}  // namespace

Command add_gradcheck(CLI::App& program) {
  const auto options = std::make_shared<Options>();
  const auto console = std::make_shared<Console>();
  Options& o = *options;
  CLI::App* app = program.add_subcommand("gradcheck", "Check a scene's gradients against differences and tangents");
  add_text(*app, "SCENE", o.scene, "", "Scene file (XML)")->required();
  add_text(*app, "--loss", o.loss, "NAME",
           "final: last state; path: speeds; tactile, shear: fields; variables: end effectors [default: tactile, or final "
           "where there is no sensor]");
  add_whole_number<std::int64_t>(*app, "--steps", o.steps, 1, kMostSteps,
                                 "Steps of the rollout [default: as many as the controls last, 100 at most]");
  add_whole_number<int>(*app, "--every", o.every, 1, std::numeric_limits<int>::max(),
                        "Tactile fields every N-th step [default: the scene's, or 1]");
  add_whole_number<int>(*app, "--entries", o.entries, 0, std::numeric_limits<int>::max(),
                        "Derivatives of each input compared with differences, drawn; 0: all [default: 24]");
  add_text(*app, "--controls", o.controls, "F.csv", "Controls, one row per step, one column per control");
  add_whole_number<std::uint64_t>(*app, "--seed", o.seed, 0, std::numeric_limits<std::uint64_t>::max(),
                                  "Seed of the environment, of the draw and of the directions [default: 0]");
  app->add_flag("--allow-unknown", o.allow_unknown,
                "Unknown elements and attributes of the scene are warnings, not errors");
  add_console_options(*app, *console);
  app->footer("Example:\n  tangere gradcheck scenes/rolling_ball_small.xml --loss shear --steps 100");
  return {app, [=](const ProgramInfo&) { return run(*options, *console); }};
}

}  // namespace tangere::apps
