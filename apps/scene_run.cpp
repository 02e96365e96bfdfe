// SPDX-License-Identifier: Apache-2.0
// All subcommands use the same words for the same thing.
#include "apps/scene_run.hpp"

#include <fmt/format.h>

#include <csignal>
#include <nlohmann/json.hpp>

#include "apps/named_value.hpp"
#include "engine/model/short_touches.hpp"
#include "engine/sense/loop_readings.hpp"
#include "engine/sense/start_overlaps.hpp"
#include "io/files/csv.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/accuracy/measured_order.hpp"
#include "tasks/run/costly_steps.hpp"

namespace tangere::apps {
namespace {

constexpr std::size_t kMostFailuresListed = 20;

}  // namespace

Precision precision_named(const std::string& name) {
  return named_value("precision", name, {Precision::f64, Precision::mixed});
}

std::vector<std::string> integrator_names() {
  std::vector<std::string> names;
  for (const Integrator known : integrators()) names.emplace_back(to_string(known));
  return names;
}

Integrator integrator_named(const std::string& name) {
  return named_value("integrator", name, integrators());
}

LossKind loss_named(const std::string& name) {
  return named_value("loss", name, std::span<const LossKind>(loss_kinds()));
}

std::string split_text(const StepCounts& counts) {
  std::string text = fmt::format("steps split: {}", counts.split_steps);
  const auto add = [&](const char* what, std::int64_t count) {
    if (count > 0) text += fmt::format(", {}: {}", what, count);
  };
  add("less accurate than requested", counts.accuracy_not_met_steps);
  add("a body came through another", counts.tunnelled_steps);
  add("damped because they created energy", counts.damped_steps);
  add("bodies overlap", counts.overlapping_steps);
  add("readings of layers that do not carry the loads of the contact", counts.loads_not_carried);
  return text;
}

Json split_json(const StepCounts& counts) {
  return {{"split_steps", counts.split_steps},
          {"accuracy_not_met_steps", counts.accuracy_not_met_steps},
          {"tunnelled_steps", counts.tunnelled_steps},
          {"damped_steps", counts.damped_steps},
          {"overlapping_steps", counts.overlapping_steps}};
}

Json steps_json(const std::optional<EpisodeSteps>& steps) {
  return {{"simulation_steps", steps ? Json(steps->taken) : Json()},
          {"tunnelled_steps", steps ? Json(steps->tunnelled) : Json()},
          {"overlapping_steps", steps ? Json(steps->overlapping) : Json()}};
}

std::string missed_text(const std::optional<EpisodeSteps>& steps) {
  if (!steps || steps->tunnelled + steps->overlapping == 0) return "";
  return fmt::format(", steps in which a body came through another: {}, bodies overlap: {}, of {}",
                     steps->tunnelled, steps->overlapping, steps->taken);
}

Json mean_asleep(double sleep, const StepCounts& counts) {
  if (sleep == 0) return nullptr;
  return static_cast<double>(counts.bodies_asleep) /
         static_cast<double>(std::max<std::int64_t>(1, counts.simulation_steps));
}

std::string sleep_text(double sleep, int moving_bodies, const StepCounts& counts) {
  const Json mean = mean_asleep(sleep, counts);
  if (mean.is_null()) return "";
  return fmt::format("bodies asleep: {:.2f} of {} on average\n", mean.get<double>(), moving_bodies);
}

void apply_solver_options(SolverOptions& scene_options, const SolverOptions& requested) {
  if (requested.accuracy) scene_options.accuracy = requested.accuracy;
  if (!scene_options.tolerance) scene_options.tolerance = requested.tolerance;
  if (scene_options.sleep == 0) scene_options.sleep = requested.sleep;
  scene_options.keep_inert_contacts |= requested.keep_inert_contacts;
}

Scene read_scene_for(const std::string& path, bool allow_unknown, const Console& console,
                     const SolverOptions& requested) {
  SceneFile file = read_scene(path, {allow_unknown});
  apply_solver_options(file.scene.solver, requested);
  for (const std::string& warning : file.warnings) console.note("warning: " + warning);
  return std::move(file.scene);
}

ControlProgram make_controls(const std::string& path, std::uint64_t seed, const Model& model,
                             const Stepper& stepper, const Console& console) {
  if (!path.empty()) {
    const auto columns = static_cast<std::size_t>(model.nu());
    CsvControl table{read_csv(path, columns, model.u_names()), path};
    return {model, stepper.timestep(), seed, std::move(table)};
  }
  if (!model.scene().control && model.nu() > 0)
    console.note("the scene has no <control> and there is no --controls: every control is 0");
  return {model, stepper.timestep(), seed};
}

std::int64_t step_count(const std::optional<std::int64_t>& requested,
                        const ControlProgram& controls) {
  const std::int64_t steps = requested.value_or(controls.steps());
  if (steps < 0)
    throw InputError("the controls have no end, so the number of steps is not known; give --steps");
  controls.check_covers(steps);
  return steps;
}

void warn_about_geometry(const Console& console, const Model& model) {
  for (const MeshInfo& mesh : model.meshes())
    if (mesh.unresolved > MeshInfo::kMostUnresolved)
      console.note(fmt::format(
          "warning: body '{}': cells of {:.3g} m do not resolve {:.0f} % of the mesh's surface, "
          "where walls or details are thinner than about 1.5 cells; expected a larger 'resolution' "
          "or a smaller 'error'",
          mesh.body, mesh.cell, 100 * mesh.unresolved));
  for (const auto& lines : {start_overlaps(model), sensors_inside(model), unchecked_overlaps(model),
                            rounded_places(model), open_loops(model), paths_through_surfaces(model),
                            transmissions_outside_limits(model)})
    for (const std::string& line : lines) console.note("warning: " + line);
}

void warn_about_steps(const Console& console, const Model& model, const Stepper& stepper) {
  if (stepper.accuracy() > 0) {
    std::string laws;
    for (const std::string& law : first_order_laws(model.scene()))
      laws += (laws.empty() ? "" : ", ") + law;
    if (!laws.empty())
      console.note(fmt::format(
          "warning: accuracy {:g} may not be kept by {}: their errors can be of first order in a "
          "part (ks, where points slip or land) or in the whole step of {:g} ms (timing), and no "
          "estimate sees them; 'tangere accuracy' measures what is reached",
          stepper.accuracy(), laws, 1e3 * stepper.timestep()));
    return;
  }
  for (const std::string& line : short_touches(model, stepper.integrator(), stepper.timestep()))
    console.note("warning: " + line);
}

Json note_costly_steps(const Console& console, Integrator integrator, double accuracy,
                       const StepCounts& counts) {
  const std::string line = costly_steps(integrator, counts);
  if (line.empty() || accuracy > 0) return nullptr;
  console.note("warning: " + line);
  return line;
}

ExitCode exit_code(const Console& console, bool failed, const StepCounts& counts) {
  if (counts.missed_contacts() == 0) return failed ? kSomeFailed : kDone;
  std::string what;
  if (counts.tunnelled_steps > 0)
    what = fmt::format("in {} steps a body came through another", counts.tunnelled_steps);
  if (counts.overlapping_steps > 0)
    what += fmt::format(
        "{}after {} steps bodies overlap by more than a quarter of their thickness, and no "
        "contact point is as deep",
        what.empty() ? "" : ", ", counts.overlapping_steps);
  console.note(fmt::format(
      "error: contacts missed bodies in {} of {} steps: {}; expected more contact points where "
      "bodies overlap, and stiffer contacts or shorter steps where one comes through",
      counts.missed_contacts(), counts.simulation_steps, what));
  return kSomeFailed;
}

Json settings_json(const RunFacts& facts) {
  return {{"seed", facts.seed},
          {"timestep", facts.timestep},
          {"integrator", facts.integrator},
          {"tolerance", facts.tolerance},
          {"accuracy", facts.accuracy},
          {"sleep", facts.sleep},
          {"precision", facts.precision},
          {"instruction_set", facts.instruction_set}};
}

void note_empty_sensors(const Console& console, const Model& model, const RolloutOptions& rollout) {
  for (const FieldOutput of : fields_of(model, rollout.outputs)) {
    if (tactile_frames(model, of, rollout) == 0)
      console.note(fmt::format(
          "{} {} is read every {} steps: no {} in {} steps", is_view(of.form) ? "camera" : "sensor",
          source_name(model.scene(), of), reading_times(model, of, rollout).every,
          is_view(of.form) ? "picture" : "field", rollout.steps));
  }
}

int report_stop(const Console& console, const std::string& command, int signal,
                const std::string& when, const std::string& left, const Json& result) {
  const char* name = signal == SIGINT ? "SIGINT" : "SIGTERM";
  const ExitCode code = signal == SIGINT ? kInterrupted : kTerminated;
  const std::string text = fmt::format("stopped by {} {}; {}", name, when, left);
  console.fail("tangere: " + text);
  Json object{{"command", command}, {"exit_code", static_cast<int>(code)}, {"error", text}};
  object.update(result);
  console.result(object);
  return code;
}

int report_stop(const Console& console, const std::string& command, int signal,
                const std::string& when) {
  return report_stop(console, command, signal, when, "nothing was written", Json::object());
}

void list_failures(const Console& console, const std::string& what,
                   const std::vector<Failure>& failures, const std::string& where) {
  for (std::size_t i = 0; i < failures.size() && i < kMostFailuresListed; ++i)
    console.fail(fmt::format(
        "{} {} failed {}: {}", what, failures[i].number,
        failures[i].step < 0 ? "before this run" : fmt::format("in step {}", failures[i].step),
        to_string(failures[i].status)));
  if (failures.size() > kMostFailuresListed)
    console.fail(fmt::format("failed too, not listed: {}; {}",
                             failures.size() - kMostFailuresListed, where));
}

Json failures_json(const std::string& what, const std::vector<Failure>& failures) {
  Json list = Json::array();
  for (const Failure& f : failures)
    list.push_back({{what, f.number},
                    {"step", f.step},
                    {"status", static_cast<int>(f.status)},
                    {"reason", to_string(f.status)}});
  return list;
}

}  // namespace tangere::apps
