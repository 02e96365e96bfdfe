// SPDX-License-Identifier: Apache-2.0
// All tasks by name. A new task of the project needs its two functions here and a line in
// task_list.cpp; a task of another program is added by add_task().
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tasks/catalogue/task.hpp"

namespace tangere {

/// Names of all tasks, those meant for experiments first.
std::vector<std::string> task_names();
bool is_task(const std::string& name);
/// Returns the declaration of a task. Throws InputError for an unknown name.
TaskSpec task_spec(const std::string& name);
/// Makes the task of that name on its scene (spec.scene, as read from its file). The task's own
/// distributions replace what the file randomises. Throws InputError for an unknown name and for a
/// scene that does not belong to the task.
std::unique_ptr<Task> make_task(const std::string& name, const Scene& scene);

/// A task of another program: its declaration, and its factory for a scene.
struct OwnTask {
  std::function<TaskSpec()> declare;
  std::function<std::unique_ptr<Task>(const Scene&)> make;
};
/// Makes a task known by its name to all functions here and to the command. Call it before any of
/// them, in one thread. Throws InputError if there is a task of this name.
void add_task(const OwnTask& task);

TaskSpec declare_dummy();
std::unique_ptr<Task> make_dummy(const Scene& scene);

/// `pad`: the scene with 200 × 200 tactile points, or with 32 × 32.
enum class BallPad { large, small };
TaskSpec declare_ball_rolling(BallPad pad);
std::unique_ptr<Task> make_ball_rolling(const Scene& scene, BallPad pad);

/// The friction of contacts and skins: the paper's dampers alone; springs beside them (`ks`), on
/// the scene NAME_elastic.xml; or those springs in gels that are the contact, on NAME_gel.xml.
enum class Friction { viscous, elastic, gel };
/// Returns the declaration of a task with that friction.
TaskSpec with_friction(TaskSpec spec, Friction friction);

TaskSpec declare_stable_grasp(Friction friction);
std::unique_ptr<Task> make_stable_grasp(const Scene& scene, Friction friction);

/// Observations of the box besides the goal: touch, its pose, or none.
enum class PushObservation { tactile, privileged, reduced };
TaskSpec declare_box_pushing(PushObservation observation, Friction friction);
std::unique_ptr<Task> make_box_pushing(const Scene& scene, PushObservation observation,
                                       Friction friction);

/// Observations besides angles and fingertips: touch or none.
enum class CapObservation { tactile, blind };
TaskSpec declare_cap_opening(CapObservation observation, Friction friction);
std::unique_ptr<Task> make_cap_opening(const Scene& scene, CapObservation observation,
                                       Friction friction);

/// Which components are off at the start and corrected by actions.
enum class InsertionMotion { both, translation, rotation };
TaskSpec declare_insertion(InsertionMotion motion, Friction friction);
std::unique_ptr<Task> make_insertion(const Scene& scene, InsertionMotion motion, Friction friction);

/// Observations besides angles and goal: touch or none.
enum class InHandObservation { tactile, blind };
TaskSpec declare_in_hand(InHandObservation observation);
std::unique_ptr<Task> make_in_hand(const Scene& scene, InHandObservation observation);

}  // namespace tangere
