// SPDX-License-Identifier: Apache-2.0
// Copies names and settings out of model and stepper.
#include "engine/rows/run_facts.hpp"

#include "engine/model/scene_number.hpp"

namespace tangere {
namespace {

std::vector<std::string> copy(std::span<const std::string> texts) {
  return {texts.begin(), texts.end()};
}

}  // namespace

RunFacts run_facts(const Model& model, const Stepper& stepper, const RunOrigin& origin,
                   std::uint64_t seed) {
  const Scene& scene = model.scene();
  RunFacts facts;
  static_cast<RunOrigin&>(facts) = origin;
  facts.q_names = copy(model.q_names());
  facts.q_units = copy(model.q_units());
  facts.v_names = copy(model.v_names());
  facts.v_units = copy(model.v_units());
  facts.u_names = copy(model.u_names());
  facts.u_units = copy(model.u_units());
  for (const EndEffectorInfo& info : model.end_effectors())
    facts.end_effector_names.push_back(info.name);
  for (const RandomizationDescription& d : scene.randomizations) {
    facts.randomized_names.push_back(name_of(d.number));
    facts.randomized_units.push_back(unit_of(scene, d.number));
  }
  facts.scene_name = scene.name;
  facts.scene_path = scene.path;
  facts.scene_text = scene.text;
  facts.integrator = to_string(stepper.integrator());
  facts.timestep = stepper.timestep();
  facts.tolerance = stepper.tolerance();
  facts.accuracy = stepper.accuracy();
  facts.sleep = stepper.sleep();
  facts.seed = seed;
  return facts;
}

Attributes attributes_of(const RunFacts& facts, std::int64_t steps, std::int64_t every) {
  Attributes list{{"seed", facts.seed},
                  {"steps", steps},
                  {"every", every},
                  {"timestep", facts.timestep},
                  {"timestep_unit", "s"},
                  {"integrator", facts.integrator},
                  {"tolerance", facts.tolerance},
                  {"accuracy", facts.accuracy}};
  if (facts.sleep > 0) list.push_back({"sleep", facts.sleep});
  list.push_back({"precision", facts.precision});
  return list;
}

}  // namespace tangere
