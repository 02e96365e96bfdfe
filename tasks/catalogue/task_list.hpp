// SPDX-License-Identifier: Apache-2.0
// The tasks there are, by name. A new one gets its two functions here and a line in task_list.cpp.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tasks/catalogue/task.hpp"

namespace tangere {

/// Names of all tasks, those meant for experiments first.
std::vector<std::string> task_names();
bool is_task(const std::string& name);
/// What a task declares. Throws InputError for a name that is none.
TaskSpec task_spec(const std::string& name);
/// The task of that name on its scene (spec.scene, as read from its file); its own distributions
/// replace what the file randomises. Throws InputError for a name that is none and for a scene that
/// is not the task's.
std::unique_ptr<Task> make_task(const std::string& name, const Scene& scene);

TaskSpec declare_dummy();
std::unique_ptr<Task> make_dummy(const Scene& scene);

/// `pad`: the scene with 200 × 200 tactile points, or with 32 × 32.
enum class BallPad { large, small };
TaskSpec declare_ball_rolling(BallPad pad);
std::unique_ptr<Task> make_ball_rolling(const Scene& scene, BallPad pad);

TaskSpec declare_stable_grasp();
std::unique_ptr<Task> make_stable_grasp(const Scene& scene);

/// What is observed of the box besides the goal: touch, its pose, nothing.
enum class PushObservation { tactile, privileged, reduced };
TaskSpec declare_box_pushing(PushObservation observation);
std::unique_ptr<Task> make_box_pushing(const Scene& scene, PushObservation observation);

/// What is observed besides angles and fingertips: touch, nothing.
enum class CapObservation { tactile, blind };
TaskSpec declare_cap_opening(CapObservation observation);
std::unique_ptr<Task> make_cap_opening(const Scene& scene, CapObservation observation);

/// What is off at the start and what an action corrects.
enum class InsertionMotion { both, translation, rotation };
TaskSpec declare_insertion(InsertionMotion motion);
std::unique_ptr<Task> make_insertion(const Scene& scene, InsertionMotion motion);

}  // namespace tangere
