// SPDX-License-Identifier: Apache-2.0
// What a task declares as text and as JSON.
#include "apps/inspect_task.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <nlohmann/json.hpp>

namespace tangere::apps {
namespace {

Json tensor_json(const TensorSpec& t) {
  return {{"name", t.name},       {"shape", t.shape},           {"unit", t.unit},
          {"meaning", t.meaning}, {"low", finite(t.low)},       {"high", finite(t.high)},
          {"scale", t.scale},     {"privileged", t.privileged}, {"touch", t.touch}};
}

std::string tensor_text(const TensorSpec& t) {
  const bool free = std::isinf(t.low) && std::isinf(t.high);
  return fmt::format("{} ({}) [{}], {}{}{}{}: {}", t.name, fmt::join(t.shape, ", "), t.unit,
                     free ? "no bounds" : fmt::format("{:g} to {:g}", t.low, t.high),
                     t.scale.empty() ? "" : fmt::format(", scale {:g}", fmt::join(t.scale, " ")),
                     t.privileged ? ", privileged" : "", t.touch ? ", touch" : "", t.meaning);
}

/// What belongs to a reset before the first action.
std::string reset_text(const TaskSpec& spec) {
  std::string text;
  if (spec.settling_steps > 0)
    text += fmt::format("a reset settles for {} steps of {:g} s\n", spec.settling_steps,
                        spec.settling_timestep);
  if (spec.warm_up)
    text += "a reset ends with one action of zeros, whose observation is the first\n";
  if (spec.restarts) text += "every action starts from a state that the task gives\n";
  return text;
}

}  // namespace

Json task_json(const TaskSpec& spec) {
  Json observations = Json::array();
  for (const TensorSpec& o : spec.observations) observations.push_back(tensor_json(o));
  return {{"name", spec.name},
          {"summary", spec.summary},
          {"success", spec.success},
          {"action", tensor_json(spec.action)},
          {"observations", observations},
          {"steps_per_action", spec.steps_per_action},
          {"control_every", spec.control_every},
          {"moments", spec.snapshots},
          {"horizon", spec.horizon},
          {"opening", spec.warm_up},
          {"restarts", spec.restarts},
          {"settling_steps", spec.settling_steps},
          {"settling_timestep", spec.settling_timestep},
          {"memory", spec.task_state}};
}

std::string task_text(const TaskSpec& spec) {
  std::string text =
      fmt::format("task {}: {}\nsuccess: {}\naction {}\nobservations ({} numbers)\n", spec.name,
                  spec.summary, spec.success, tensor_text(spec.action), spec.observation_size());
  for (const TensorSpec& o : spec.observations) text += fmt::format("  {}\n", tensor_text(o));
  text += fmt::format(
      "{} steps per action, controls {}, observed after step{} {}; at most {} actions\n",
      spec.steps_per_action,
      spec.control_every == 0   ? "once per action"
      : spec.control_every == 1 ? "at every step"
                                : fmt::format("every {} steps", spec.control_every),
      spec.snapshots.size() == 1 ? "" : "s", fmt::join(spec.snapshots, ", "), spec.horizon);
  return text + reset_text(spec);
}

}  // namespace tangere::apps
