// SPDX-License-Identifier: Apache-2.0
// tangere inspect: shows what a scene compiles to and what a task declares.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>

#include "apps/arguments.hpp"
#include "apps/command.hpp"
#include "apps/inspect_cameras.hpp"
#include "apps/inspect_effects.hpp"
#include "apps/inspect_joints.hpp"
#include "apps/inspect_task.hpp"
#include "apps/machine.hpp"
#include "apps/run_options.hpp"
#include "apps/scene_run.hpp"
#include "apps/task_run.hpp"
#include "apps/text_output.hpp"
#include "engine/model/model.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/sensed_bodies.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "kernels/table/isa.hpp"

namespace tangere::apps {
namespace {

struct InspectArguments {
  std::string scene;
  bool allow_unknown = false;
  bool effects = false, overwrite = false;
  std::string svg;
};

std::string parent_name(const Scene& scene, const LinkDescription& link) {
  return link.parent < 0 ? "world" : scene.links[static_cast<std::size_t>(link.parent)].body.name;
}

const char* control_name(const Scene& scene) {
  if (!scene.control) return "none";
  constexpr const char* kNames[] = {"constant", "piecewise", "csv", "random"};
  static_assert(std::size(kNames) == std::variant_size_v<ControlDescription>);
  return kNames[scene.control->index()];
}

std::string names_line(std::string_view what, std::span<const std::string> names) {
  return fmt::format("{} ({}): {}\n", what, names.size(), fmt::join(names, ", "));
}

std::vector<std::string> randomized_names(const Scene& scene) {
  std::vector<std::string> names;
  for (const RandomizationDescription& d : scene.randomizations) names.push_back(name_of(d.number));
  return names;
}

std::vector<std::string> randomized_units(const Scene& scene) {
  std::vector<std::string> units;
  for (const RandomizationDescription& d : scene.randomizations)
    units.push_back(unit_of(scene, d.number));
  return units;
}

std::vector<std::string> randomized_ties(const Scene& scene) {
  std::vector<std::string> ties;
  for (const RandomizationDescription& d : scene.randomizations) ties.push_back(d.tie);
  return ties;
}

/// A line for each tie, with the numbers that are drawn together.
std::string ties_text(const Scene& scene) {
  std::string text;
  for (std::size_t k = 0; k < scene.randomizations.size(); ++k) {
    const std::string& tie = scene.randomizations[k].tie;
    if (tie.empty() || drawn_with(scene, k) != k) continue;
    std::vector<std::string> names;
    for (const RandomizationDescription& d : scene.randomizations)
      if (d.tie == tie) names.push_back(name_of(d.number));
    text += names_line(fmt::format("  drawn together as '{}'", tie), names);
  }
  return text;
}

/// Steps of a scene's own run; -1 if the scene does not define them.
std::int64_t steps_of(const Model& model) {
  return ControlProgram(model, model.timestep(), 0).steps();
}

/// A list with an entry for each value.
template <class Values, class Entry>
Json list_of(const Values& values, const Entry& entry) {
  Json list = Json::array();
  for (const auto& value : values) list.push_back(entry(value));
  return list;
}

Json bodies_json(const Model& model) {
  Json bodies = Json::array();
  for (std::size_t b = 0; b < model.scene().links.size(); ++b) {
    const LinkDescription& link = model.scene().links[b];
    bodies.push_back({{"name", link.body.name},
                      {"shape", shape_name(link.body.shape)},
                      {"mass", model.mass(static_cast<int>(b))},
                      {"joint", link.joint.name},
                      {"joint_type", to_string(link.joint.type)},
                      {"parent", parent_name(model.scene(), link)}});
  }
  return bodies;
}

/// The bodies that a sensor senses.
std::vector<std::string> sensed_names(const Model& model, std::size_t sensor) {
  const Scene& scene = model.scene();
  std::vector<std::string> names;
  for (const int k : sensed_bodies(scene, scene.sensors[sensor]))
    names.push_back(scene.links[std::size_t(k)].body.name);
  return names;
}

Json sensors_json(const Model& model) {
  Json sensors = Json::array();
  for (std::size_t k = 0; k < model.sensors().size(); ++k) {
    const SensorInfo& s = model.sensors()[k];
    sensors.push_back({{"name", s.name},
                       {"body", s.body},
                       {"rows", s.rows},
                       {"cols", s.cols},
                       {"points", s.points},
                       {"every", s.every},
                       {"pressure_sign", s.pressure_sign},
                       {"senses", sensed_names(model, k)},
                       {"markers", model.scene().sensors[k].markers.has_value()},
                       {"channels", s.channels}});
  }
  return sensors;
}

Json cameras_json(const Scene& scene) {
  return list_of(scene.cameras, [&](const CameraDescription& c) {
    const PictureCost cost = picture_cost(scene, c);
    return Json{{"name", c.name},
                {"body", c.body},
                {"rows", c.rows},
                {"cols", c.cols},
                {"fov", c.fov},
                {"rays", cost.rays},
                {"triangles", cost.triangles},
                {"rgb_bytes", cost.rgb_bytes},
                {"depth_bytes", cost.depth_bytes},
                {"ids_bytes", cost.ids_bytes}};
  });
}

Json contact_json(const ContactInfo& c) {
  return {{"first", c.first}, {"second", c.second}, {"points", c.points}, {"law", c.law}};
}

Json mesh_json(const MeshInfo& m) {
  return {{"body", m.body},   {"cells", m.cells}, {"cell", m.cell},
          {"bytes", m.bytes}, {"error", m.error}, {"unresolved", m.unresolved}};
}

Json end_effector_json(const EndEffectorInfo& v) { return {{"name", v.name}, {"joint", v.joint}}; }

Json stage_json(const StageInfo& s) {
  return {{"name", s.name}, {"of", s.of}, {"variant", s.variant}};
}

Json as_json(const Model& model) {
  const Scene& scene = model.scene();
  const std::int64_t steps = steps_of(model);
  return {{"command", "inspect"},
          {"exit_code", 0},
          {"scene", scene.path},
          {"model", scene.name},
          {"integrator", to_string(model.integrator())},
          {"timestep", model.timestep()},
          {"tolerance", Stepper(model).tolerance()},
          {"accuracy", Stepper(model).accuracy()},
          {"sleep", model.solver().sleep},
          {"gravity", scene.gravity},
          {"bodies", bodies_json(model)},
          {"q_names", model.q_names()},
          {"v_names", model.v_names()},
          {"u_names", model.u_names()},
          {"u_units", model.u_units()},
          {"joint_effects", joint_effects_json(scene)},
          {"motors", motors_json(scene)},
          {"loops", loops_json(model)},
          {"transmissions", transmissions_json(model)},
          {"contacts", list_of(model.contacts(), contact_json)},
          {"meshes", list_of(model.meshes(), mesh_json)},
          {"sensors", sensors_json(model)},
          {"cameras", cameras_json(scene)},
          {"variables", list_of(model.end_effectors(), end_effector_json)},
          {"outputs", scene.outputs ? Json(scene.outputs->record) : Json()},
          {"control", control_name(scene)},
          {"steps", steps < 0 ? Json() : Json(steps)},
          {"randomized", randomized_names(scene)},
          {"randomized_units", randomized_units(scene)},
          {"randomized_ties", randomized_ties(scene)},
          {"effects", effects_json(model.effects())},
          {"stages", list_of(model.stages(), stage_json)},
          {"state_bytes_per_environment", model.state_bytes_per_environment()},
          {"candidate_bytes_per_environment", Stepper::candidate_bytes(model)},
          {"workspace_bytes", Stepper::workspace_bytes(model)},
          {"instruction_set", kernels::active_isa_name()}};
}

std::string bodies_text(const Model& model) {
  const Scene& scene = model.scene();
  std::string text = fmt::format("bodies ({})\n", model.nb());
  for (std::size_t b = 0; b < scene.links.size(); ++b) {
    const LinkDescription& link = scene.links[b];
    text += fmt::format("  {:<16} {:<8} {:>12.6g} kg, joint {} ({}), parent {}\n", link.body.name,
                        shape_name(link.body.shape), model.mass(static_cast<int>(b)),
                        link.joint.name, to_string(link.joint.type), parent_name(scene, link));
  }
  return text;
}

std::string sensors_text(const Model& model) {
  std::string text = fmt::format("sensors ({})\n", model.sensors().size());
  for (std::size_t k = 0; k < model.sensors().size(); ++k) {
    const SensorInfo& s = model.sensors()[k];
    text += fmt::format("  {} on {}: {}, read {}, pressure reads {}{}\n", s.name, s.body,
                        s.rows > 0 ? fmt::format("{} x {} = {} points", s.rows, s.cols, s.points)
                                   : fmt::format("{} point{}", s.points, s.points == 1 ? "" : "s"),
                        s.every > 0 ? fmt::format("every {} steps", s.every) : "every step",
                        s.pressure_sign > 0 ? "positive (+1)" : "negative (-1)",
                        model.scene().sensors[k].markers ? ", markers" : "");
    if (s.picture[0] > 0) {
      text.pop_back();
      text += fmt::format(", pictures of {} x {} pixels, gel '{}'\n", s.picture[0], s.picture[1],
                          model.scene().sensors[k].picture->gel->name);
    }
    if (s.channels > 0) {
      const ChannelMap& map = *model.scene().sensors[k].channels->map;
      text.pop_back();
      text += fmt::format(", {} channels in {}, map '{}'\n", s.channels, map.unit, map.name);
    }
    const std::vector<std::string> sensed = sensed_names(model, k);
    text += fmt::format("    senses {}\n",
                        sensed.empty() ? "nothing" : fmt::format("{}", fmt::join(sensed, ", ")));
  }
  return text;
}

/// What runs of the scene compute and store.
std::string outputs_text(const Scene& scene) {
  if (!scene.outputs) return "outputs: everything\n";
  return fmt::format("outputs ({}:{}): {}\n", scene.outputs->source.file,
                     scene.outputs->source.line, fmt::join(scene.outputs->record, ", "));
}

std::string end_effectors_text(const Model& model) {
  if (model.end_effectors().empty()) return "";
  std::string text = fmt::format("\nend effectors ({})\n", model.end_effectors().size());
  for (const EndEffectorInfo& v : model.end_effectors())
    text += fmt::format("  {} on joint {}\n", v.name, v.joint);
  return text;
}

std::string as_text(const Model& model) {
  const Scene& scene = model.scene();
  const Stepper stepper(model);
  std::string text =
      fmt::format("scene {} ({}): {}, h = {} s, tolerance {}", scene.name, scene.path,
                  to_string(stepper.integrator()), stepper.timestep(), stepper.tolerance());
  if (stepper.accuracy() > 0) text += fmt::format(", steps cut to accuracy {}", stepper.accuracy());
  if (stepper.sleep() > 0) text += fmt::format(", bodies sleep at rest ({})", stepper.sleep());
  text += "\n\n";
  text += bodies_text(model) + '\n';
  text += names_line("coordinates", model.q_names());
  text += names_line("dofs", model.v_names());
  text += names_line("controls", model.u_names());
  const std::int64_t steps = steps_of(model);
  text += fmt::format("driven by: {}{}\n", control_name(scene),
                      steps < 0 ? "" : fmt::format(", {} steps", steps));
  text += names_line("varying between environments", randomized_names(scene));
  text += ties_text(scene);
  text += '\n' + joint_effects_text(scene) + '\n' + motors_text(scene);
  text += '\n' + loops_text(model) + transmissions_text(model);
  text += fmt::format("contacts ({})\n", model.contacts().size());
  for (const ContactInfo& c : model.contacts())
    text += fmt::format("  {} on {}: {} point{}, law {}\n", c.first, c.second, c.points,
                        c.points == 1 ? "" : "s", c.law);
  text += '\n' + sensors_text(model) + cameras_text(scene) + end_effectors_text(model) + '\n' +
          outputs_text(scene);
  text += "\neffects\n";
  for (const EffectInfo& e : model.effects())
    if (e.effect.element < 0)
      text += fmt::format("  {:<4} {:<24} {}\n", e.on ? "on" : "off", e.name, e.reason);
  text += "  (tangere inspect --effects measures what each costs)\n\nstages\n";
  for (const StageInfo& s : model.stages())
    text += fmt::format("  {:<16} {}: {}\n", s.name, s.of, s.variant);
  return text + fmt::format(
                    "\nmemory: {} bytes per environment, about {} more of contact candidates, {} "
                    "bytes of workspace per thread\n"
                    "instruction set: {}",
                    model.state_bytes_per_environment(), Stepper::candidate_bytes(model),
                    Stepper::workspace_bytes(model), kernels::active_isa_name());
}

/// `task`: null for a scene alone.
int report(const Model& model, const TaskSpec* task, const InspectArguments& options,
           const Console& console) {
  Json result = as_json(model);
  result["task"] = task != nullptr ? task_json(*task) : Json();
  if (options.effects) {
    TextOutput svg(options.svg, options.overwrite);
    const EffectCosts costs = measure_effects(model);
    if (svg.requested())
      svg.write(
          effect_costs_svg(costs, model.scene().name,
                           fmt::format("{}, {}", processor_name(), kernels::active_isa_name())),
          console);
    console.print(effect_costs_text(costs, kernels::active_isa_name()));
    result["effects"] = effect_costs_json(costs);
    result["run_costs"] = run_costs_json(costs);
    result["effect_measurement"] = effect_measurement_json(costs);
    result["svg"] = options.svg.empty() ? Json() : Json(options.svg);
  } else {
    if (task != nullptr) console.print(task_text(*task));
    console.print(as_text(model));
  }
  console.result(result);
  return kDone;
}

int inspect(const InspectArguments& options, const Console& console) {
  if (!options.svg.empty() && !options.effects)
    throw InputError("--svg without --effects; expected both");
  if (const std::unique_ptr<Task> task = find_task(options.scene, console)) {
    refuse_with_task(*task, {{"--allow-unknown", options.allow_unknown}});
    return report(task->model(), &task->spec(), options, console);
  }
  const Model model(read_scene_for(options.scene, options.allow_unknown, console));
  warn_about_geometry(console, model);
  return report(model, nullptr, options, console);
}

}  // namespace

Command add_inspect(CLI::App& program) {
  const auto options = std::make_shared<InspectArguments>();
  const auto console = std::make_shared<Console>();
  CLI::App& app =
      add_command(program, "inspect", "Show what a scene compiles to, and what a task declares",
                  "tangere inspect scenes/rolling_ball.xml --json");
  add_text(app, "SCENE", options->scene, "", "Scene file (XML), or the name of a task").required();
  add_allow_unknown_option(app, options->allow_unknown);
  add_flag(app, "--effects", options->effects,
           "Measure what each effect of the scene costs, and print that instead");
  add_text(app, "--svg", options->svg, "F.svg", "With --effects: write a picture of it");
  add_overwrite_option(app, options->overwrite, "Replace the picture if it exists");
  add_console_options(app, *console);
  return {&app, [=](const ProgramInfo&) { return inspect(*options, *console); }};
}

}  // namespace tangere::apps
