// SPDX-License-Identifier: Apache-2.0
// tangere gradcheck: checks the gradients of a scene, or of a task's return. Prints a table per
// input, and one number.
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/memory.hpp"
#include "apps/run_options.hpp"
#include "apps/scene_run.hpp"
#include "apps/task_run.hpp"
#include "tasks/catalogue/task_list.hpp"
#include "tasks/gradients/gradient_check.hpp"
#include "tasks/gradients/losses.hpp"

namespace tangere::apps {
namespace {

constexpr std::int64_t kDefaultSteps = 100;
constexpr int kDefaultEntries = 24;
constexpr double kTolerance =
    1e-12;  // differences of rollouts do not resolve errors below the solve's residual

struct GradcheckArguments {
  std::string scene, loss, controls, policy;
  std::optional<std::int64_t> steps, actions;
  std::optional<int> every, entries;
  std::optional<std::uint64_t> seed;
  std::optional<double> tolerance;
  bool allow_unknown = false;
};

/// The loss as given. The default is tactile if there is a sensor, else the final state.
LossKind loss_of(const std::string& name, const Model& model) {
  if (!name.empty()) return loss_named(name);
  return model.sensors().empty() ? LossKind::final_state : LossKind::tactile;
}

/// The steps of the scene's own run, but a hundred if that is longer or has no end.
std::int64_t steps_of(const GradcheckArguments& o, const ControlProgram& controls) {
  if (o.steps) {
    controls.check_covers(*o.steps);
    return *o.steps;
  }
  const std::int64_t own = controls.steps();
  return own < 0 ? kDefaultSteps : std::min(own, kDefaultSteps);
}

ExitCode exit_code(const GradientCheck& check) { return check.passed() ? kDone : kSomeFailed; }

void set_comparison(const GradcheckArguments& o, CheckOptions& options) {
  options.entries = o.entries.value_or(kDefaultEntries);
  options.seed = o.seed.value_or(0);
  options.tolerance = o.tolerance.value_or(options.tolerance);
}

/// Explains why nothing was compared, and what may help. `what`: the loss.
std::string nothing_compared(const GradientCheck& check, const char* what,
                             const char* try_instead) {
  const auto without = std::count_if(check.inputs.begin(), check.inputs.end(),
                                     [](const CheckedInput& c) { return !c.influence; });
  std::string why;
  if (check.kinks() == 0)
    why = fmt::format("no input acts on the {}; its gradient is zero", what);
  else if (without == 0)
    why = fmt::format("all {} derivatives that were compared lie at kinks of the {}", check.kinks(),
                      what);
  else
    why = fmt::format("{} derivatives lie at kinks of the {}; the other inputs do not act on it",
                      check.kinks(), what);
  return fmt::format("nothing could be compared with differences: {}; try {}", why, try_instead);
}

/// The input with the largest error, and what disagrees there.
std::string worst_text(const GradientCheck& check) {
  const auto error = [](const CheckedInput& c) {
    return std::max(c.difference_error, c.tangent_error);
  };
  const CheckedInput& worst = *std::ranges::max_element(check.inputs, {}, error);
  if (worst.tangent_error > worst.difference_error)
    return fmt::format("the gradient by {} and the tangent along a direction disagree", worst.name);
  return fmt::format("the gradient by {} and the difference at '{}' disagree", worst.name,
                     worst.worst);
}

/// `what`: the loss. `try_instead`: advice if nothing can be compared.
void print(const Console& console, const GradientCheck& check, const char* what,
           const char* try_instead) {
  console.print(fmt::format("{:<8} {:>7} {:>8} {:>6} {:>12} {:>12} {:>12}  {}", "input", "entries",
                            "compared", "kinks", "norm", "differences", "tangent",
                            "largest difference at"));
  for (const CheckedInput& c : check.inputs)
    console.print(fmt::format("{:<8} {:>7} {:>8} {:>6} {:>12.4e} {:>12.1e} {:>12.1e}  {}", c.name,
                              c.entries, c.compared, c.kinks, c.norm, c.difference_error,
                              c.tangent_error, c.worst));
  for (const CheckedInput& c : check.inputs)
    if (!c.influence)
      console.note(fmt::format("{} do not act on this loss; nothing is compared", c.name));
  for (const std::string& reason : check.reasons) console.print(reason);
  if (check.entries() == 0) {
    console.fail(nothing_compared(check, what, try_instead));
    return;
  }
  console.print(
      fmt::format("largest error {:.1e} of a gradient's norm, {} derivatives compared with "
                  "differences, {} kinks",
                  check.max_relative_error(), check.entries(), check.kinks()));
  if (!check.passed())
    console.fail(fmt::format(
        "the largest error, {:.1e} of a gradient's norm, exceeds {:g} (--tolerance): {}",
        check.max_relative_error(), check.tolerance, worst_text(check)));
}

Json json_of(const GradientCheck& check) {
  Json inputs = Json::array();
  for (const CheckedInput& c : check.inputs)
    inputs.push_back({{"input", c.name},
                      {"size", c.entries},
                      {"entries", c.compared},
                      {"kinks", c.kinks},
                      {"influence", c.influence},
                      {"norm", c.norm},
                      {"difference_error", finite(c.difference_error)},
                      {"worst", c.worst},
                      {"tangent_error", finite(c.tangent_error)}});
  return inputs;
}

/// The keys that scenes and tasks have in common.
Json json_of_check(const GradientCheck& check, std::uint64_t seed, const Stepper& stepper) {
  return {{"command", "gradcheck"},
          {"exit_code", static_cast<int>(exit_code(check))},
          {"loss", check.loss},
          {"seed", seed},
          {"integrator", to_string(stepper.integrator())},
          {"passed", check.passed()},
          {"tolerance", check.tolerance},
          {"max_relative_error", finite(check.max_relative_error())},
          {"entries", check.entries()},
          {"kinks", check.kinks()},
          {"reasons", check.reasons},
          {"inputs", json_of(check)}};
}

/// --actions, or the number that takes a hundred steps.
std::int64_t actions_of(const GradcheckArguments& o, const TaskSpec& spec) {
  if (o.actions.value_or(0) > spec.horizon)
    throw InputError(fmt::format("--actions {} with task '{}'; expected at most {}, its horizon",
                                 *o.actions, spec.name, spec.horizon));
  return o.actions.value_or(
      std::clamp<std::int64_t>(kDefaultSteps / spec.steps_per_action, 1, spec.horizon));
}

int run_task(const GradcheckArguments& o, const Console& console, const Task& task) {
  refuse_with_task(task, {{"--loss", !o.loss.empty()},
                          {"--steps", o.steps.has_value()},
                          {"--every", o.every.has_value()},
                          {"--allow-unknown", o.allow_unknown}});
  const PolicyKind kind = policy_named(o.policy, o.controls, PolicyKind::scripted);
  const Policy policy = make_policy(task, kind, o.controls);
  const TaskSpec& spec = task.spec();
  CheckOptions options;
  options.length = actions_of(o, spec);
  set_comparison(o, options);
  const Stepper stepper(task.model());
  options.stepper.tolerance = std::min(stepper.tolerance(), kTolerance);
  console.print(fmt::format("task {}: at most {} actions of {} steps of {:g} s, {}, policy {}",
                            spec.name, options.length, spec.steps_per_action, stepper.timestep(),
                            to_string(stepper.integrator()), to_string(kind)));
  const GradientCheck check = check_task_gradient(
      task, [&](const Scene& scene) { return make_task(spec.name, scene); },
      [&](const TaskView& view, std::span<const double> observation, std::span<double> action) {
        policy.act(view, observation, action);
      },
      options);
  console.print(fmt::format("return {:.9g} of {} actions", check.loss, check.length));
  print(console, check, "return", "another --seed or --policy, or more --actions");
  Json result = json_of_check(check, options.seed, stepper);
  result.update({{"task", spec.name},
                 {"policy", to_string(kind)},
                 {"actions", check.length},
                 {"loss_name", "return"},
                 {"steps", check.length * spec.steps_per_action}});
  console.result(result);
  return exit_code(check);
}

int run(const GradcheckArguments& o, const Console& console) {
  if (const std::unique_ptr<Task> task = find_task(o.scene, console))
    return run_task(o, console, *task);
  refuse_with_scene(o.scene,
                    {{"--actions", o.actions.has_value()}, {"--policy", !o.policy.empty()}});
  const Model model(read_scene_for(o.scene, o.allow_unknown, console));
  const Stepper stepper(model);
  const ControlProgram controls =
      make_controls(o.controls, o.seed.value_or(0), model, stepper, console);
  CheckOptions options;
  options.length = steps_of(o, controls);
  set_comparison(o, options);
  options.stepper.tolerance = std::min(stepper.tolerance(), kTolerance);
  check_memory(
      gradient_bytes(model, 1, {.length = options.length, .stepper = {}, .parameters = true}, 1),
      fmt::format("gradients of {} steps", options.length));
  const LossKind kind = loss_of(o.loss, model);
  RolloutOptions rollout;
  rollout.every = o.every.value_or(0);
  int every = 1;
  if (!model.sensors().empty()) every = tactile_interval(model.sensors()[0], rollout);
  const auto loss = make_loss(kind, model, every);
  const Batch start(model, 1, o.seed.value_or(0));
  console.print(fmt::format("{}: {} steps of {:g} s, {}, loss {}", model.scene().name,
                            options.length, stepper.timestep(), to_string(stepper.integrator()),
                            to_string(kind)));
  const GradientCheck check = check_gradient(
      start, [&](std::int64_t step, int, std::span<double> u) { controls.evaluate(step, 0, u); },
      *loss, options);
  console.print(fmt::format("loss {:.9g}", check.loss));
  print(console, check, "loss", "another --seed, --loss or --steps");
  Json result = json_of_check(check, options.seed, stepper);
  result.update({{"scene", o.scene},
                 {"task", nullptr},
                 {"loss_name", to_string(kind)},
                 {"steps", options.length},
                 {"every", every}});
  console.result(result);
  return exit_code(check);
}

}  // namespace

Command add_gradcheck(CLI::App& program) {
  const auto options = std::make_shared<GradcheckArguments>();
  const auto console = std::make_shared<Console>();
  GradcheckArguments& o = *options;
  CLI::App& app = add_command(
      program, "gradcheck", "Check gradients of a scene or a task against differences and tangents",
      "tangere gradcheck scenes/rolling_ball_small.xml --loss shear --steps 100");
  add_text(app, "SCENE", o.scene, "",
           "Scene file (XML), or the name of a task, whose return is then the loss")
      .required();
  add_text(
      app, "--loss", o.loss, "NAME",
      "Loss of a scene: final (half squares of the last state), path (of all velocities), "
      "tactile or shear (of fields), markers (of their displacements), channels, pictures (of "
      "gels with a layer) or variables (of end effectors at the end) [default: tactile, or final "
      "without a sensor]");
  add_steps_option(app, o.steps,
                   "For a scene: length of the rollout [default: as the controls, 100 at most]");
  add_whole_number<std::int64_t>(
      app, "--actions", o.actions, 1, kMostSteps,
      "For a task: most actions of the episode [default: as many as take 100 steps]");
  add_policy_option(app, o.policy);
  add_whole_number<int>(
      app, "--every", o.every, 1, std::numeric_limits<int>::max(),
      "For a scene: read tactile fields every N steps [default: the first sensor's, or 1]");
  add_whole_number<int>(
      app, "--entries", o.entries, 0, std::numeric_limits<int>::max(),
      "Most derivatives of each input to compare with differences; 0: all [default: 24]");
  add_positive_number(app, "--tolerance", o.tolerance,
                      "Largest error of a check that passes, of a gradient's norm [default: 1e-4]");
  add_controls_option(app, o.controls);
  add_whole_number<std::uint64_t>(
      app, "--seed", o.seed, 0, std::numeric_limits<std::uint64_t>::max(),
      "Seed of the environment or episode, of the draw and of the directions [default: 0]");
  add_allow_unknown_option(app, o.allow_unknown);
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return run(*options, *console); }};
}

}  // namespace tangere::apps
