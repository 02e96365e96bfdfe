// SPDX-License-Identifier: Apache-2.0
// What all tasks share: the compiled scene, the places of joints, random numbers.
#include "tasks/catalogue/task.hpp"

#include <fmt/format.h>

#include "engine/model/random.hpp"
#include "engine/rows/episode_channels.hpp"
#include "engine/step/shear_state_arrays.hpp"

namespace tangere {
namespace {

/// Sums `count` over the joints before the joint `name`. Throws InputError if there is none.
std::size_t place_of(const Scene& scene, const std::string& name, int (*count)(JointType)) {
  int place = 0;
  for (const LinkDescription& link : scene.links) {
    if (link.joint.name == name) return static_cast<std::size_t>(place);
    place += count(link.joint.type);
  }
  throw InputError(
      fmt::format("{}: the scene has no joint '{}', which its task needs", scene.path, name));
}

}  // namespace

Task::Task(const Scene& scene, TaskSpec spec)
    : model_((spec.check(), scene)), spec_(std::move(spec)), fields_(spec_.fields) {
  if (spec_.control_every == 0) spec_.control_every = spec_.steps_per_action;
  check_outputs(model_.scene(), fields_);
  for (const FieldOutput& output : fields_)
    if (output.form != FieldForm::field && output.form != FieldForm::pressure &&
        output.form != FieldForm::ideal && (!is_picture(output.form) || is_view(output.form)))
      throw InputError(fmt::format(
          "task '{}' reads {}; expected field, pressure, ideal or a picture of a sensor",
          spec_.name, to_string(output.form)));
  if (spec_.reads_tactile && fields_.empty()) fields_ = whole_fields(scene);
}

std::size_t Task::tactile_size() const {
  std::size_t numbers = 0;
  for (const FieldOutput& output : fields_) numbers += numbers_of(model_, output);
  return numbers;
}

std::size_t Task::bodies_size() const {
  return spec_.reads_bodies ? kMotion * static_cast<std::size_t>(model_.nb()) : 0;
}

std::size_t Task::shear_state_size() const {
  return spec_.reads_shear_state ? 3 * shear_state_arrays(model_).count() : 0;
}

std::size_t Task::end_effectors_size() const {
  return spec_.reads_end_effectors ? 3 * model_.end_effectors().size() : 0;
}

void Task::start(const TaskStart&) const {}
void Task::begin_action(const TaskView&, std::span<double>) const {}
void Task::restart_state(const TaskView&, std::span<double>, std::span<double>) const {}

void Task::reward_vjp(const TaskView&, double, const ViewCotangent&) const {
  throw InputError(fmt::format("task {} has no derivative of its reward; expected Task::reward_vjp",
                               spec_.name));
}
void Task::controls_vjp(const TaskView&, int, std::span<const double>, const ViewCotangent&) const {
  throw InputError(fmt::format(
      "task {} has no derivative of its controls; expected Task::controls_vjp", spec_.name));
}
void Task::scripted(const TaskView&, std::span<const double>, std::span<double>) const {
  throw InputError(fmt::format(
      "task {} has no script; expected another policy, such as --policy random, or Task::scripted",
      spec_.name));
}

void Task::observe_vjp(const TaskView&, std::span<const double>, const ViewCotangent&) const {
  throw InputError(
      fmt::format("task {} has no derivative of its observations; expected Task::observe_vjp, "
                  "which adds those of weight · observation by what observe() looks at",
                  spec_.name));
}
void Task::begin_action_vjp(const TaskView&, std::span<double>, const ViewCotangent&) const {}
void Task::restart_state_vjp(const TaskView&, std::span<const double>, std::span<const double>,
                             const ViewCotangent&) const {
  throw InputError(fmt::format(
      "task {} restarts at every action and has no derivative of the states it restarts from; "
      "expected Task::restart_state_vjp",
      spec_.name));
}

std::size_t Task::coordinate(const std::string& joint) const {
  return place_of(model_.scene(), joint, position_count);
}
std::size_t Task::dof(const std::string& joint) const {
  return place_of(model_.scene(), joint, dof_count);
}

double task_uniform(std::uint64_t seed, std::int64_t episode, std::int64_t step,
                    std::uint32_t index, double low, double high) {
  return uniform({seed, episode, step, Purpose::task, index}, low, high);
}

double task_normal(std::uint64_t seed, std::int64_t episode, std::int64_t step, std::uint32_t index,
                   double deviation) {
  return normal({seed, episode, step, Purpose::task, index}, 0, deviation);
}

}  // namespace tangere
