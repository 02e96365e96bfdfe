// SPDX-License-Identifier: Apache-2.0
// The names of tasks and how to make each task.
#include "tasks/catalogue/task_list.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tangere {
namespace {

using Entry = OwnTask;

/// Entry of a task with variants; both functions receive `variant`.
template <class Declare, class Make, class... Variant>
Entry entry(Declare declare, Make make, Variant... variant) {
  return {[=] { return declare(variant...); },
          [=](const Scene& scene) { return make(scene, variant...); }};
}

std::vector<Entry>& entries() {
  using Push = PushObservation;
  static std::vector<Entry> all{
      entry(declare_ball_rolling, make_ball_rolling, BallPad::large),
      entry(declare_ball_rolling, make_ball_rolling, BallPad::small),
      entry(declare_stable_grasp, make_stable_grasp, Friction::viscous),
      entry(declare_stable_grasp, make_stable_grasp, Friction::elastic),
      entry(declare_stable_grasp, make_stable_grasp, Friction::gel),
      entry(declare_box_pushing, make_box_pushing, Push::tactile, Friction::viscous),
      entry(declare_box_pushing, make_box_pushing, Push::privileged, Friction::viscous),
      entry(declare_box_pushing, make_box_pushing, Push::reduced, Friction::viscous),
      entry(declare_box_pushing, make_box_pushing, Push::tactile, Friction::elastic),
      entry(declare_cap_opening, make_cap_opening, CapObservation::tactile, Friction::viscous),
      entry(declare_cap_opening, make_cap_opening, CapObservation::blind, Friction::viscous),
      entry(declare_cap_opening, make_cap_opening, CapObservation::tactile, Friction::elastic),
      entry(declare_insertion, make_insertion, InsertionMotion::both, Friction::viscous),
      entry(declare_insertion, make_insertion, InsertionMotion::translation, Friction::viscous),
      entry(declare_insertion, make_insertion, InsertionMotion::rotation, Friction::viscous),
      entry(declare_insertion, make_insertion, InsertionMotion::both, Friction::elastic),
      entry(declare_insertion, make_insertion, InsertionMotion::both, Friction::gel),
      entry(declare_in_hand, make_in_hand, InHandObservation::tactile),
      entry(declare_in_hand, make_in_hand, InHandObservation::blind),
      {declare_dummy, make_dummy},
  };
  return all;
}

const Entry& find(const std::string& name) {
  for (const Entry& e : entries())
    if (e.declare().name == name) return e;
  throw InputError(fmt::format("no task is named '{}'; expected one of {}", name,
                               fmt::join(task_names(), ", ")));
}

}  // namespace

std::vector<std::string> task_names() {
  std::vector<std::string> names;
  for (const Entry& e : entries()) names.push_back(e.declare().name);
  return names;
}

bool is_task(const std::string& name) {
  const std::vector<std::string> names = task_names();
  return std::find(names.begin(), names.end(), name) != names.end();
}

void add_task(const OwnTask& task) {
  const std::string name = task.declare().name;
  if (is_task(name)) throw InputError(fmt::format("there is a task named '{}' already", name));
  entries().push_back(task);
}

TaskSpec with_friction(TaskSpec spec, Friction friction) {
  if (friction == Friction::viscous) return spec;
  const bool gel = friction == Friction::gel;
  spec.name += gel ? "_gel" : "_elastic";
  spec.scene = spec.name + ".xml";
  spec.summary = gel ? "The same; the pads are gels, whose layers are the contact."
                     : "The same; contacts and skins keep their shear.";
  return spec;
}

TaskSpec task_spec(const std::string& name) { return find(name).declare(); }
std::unique_ptr<Task> make_task(const std::string& name, const Scene& scene) {
  return find(name).make(scene);
}

}  // namespace tangere
