// SPDX-License-Identifier: Apache-2.0
// What all commands that accept a task share: telling tasks from scene files, making the task and
// its policy, and reporting on it.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/console.hpp"
#include "tasks/run/policy.hpp"

namespace tangere::apps {

/// Returns the task that `word` names, on its own scene; null if it names a file. Throws InputError
/// with the nearest task for a plain word that is neither. `requested`: as in apply_solver_options().
std::unique_ptr<Task> find_task(const std::string& word, const Console& console,
                                const SolverOptions& requested = {});

/// Prints that the <outputs> of a task's scene apply to runs of the scene only, if it has some.
/// `instead`: what the command does for a task ("stores what it observes").
void note_outputs_of(const Console& console, const Task& task, const std::string& instead);

/// The policy called `name`, or `fallback` if that is empty. With a table it is csv. Throws
/// InputError for another name, for csv without a table, and for a table with another policy.
PolicyKind policy_named(const std::string& name, const std::string& table, PolicyKind fallback);
/// Reads --mix, as in "random=0.3": a share between 0 and 1. Throws InputError for other text.
double random_share_of(const std::string& mix);
Policy make_policy(const Task& task, PolicyKind kind, const std::string& table,
                   const PolicyVariation& variation = {});

/// An option that has no meaning with a task, and whether it was given. The function below throws
/// InputError for one that was given.
struct GivenOption {
  const char* name;
  bool given;
};
void refuse_with_task(const Task& task, const std::vector<GivenOption>& options);
/// Does the same for options that only tasks have.
void refuse_with_scene(const std::string& scene, const std::vector<GivenOption>& options);

/// Returns the text of a scene that the program contains, those of tasks, the hard ones
/// and layouts of sensors, by its path below scenes/; null for other names.
const char* program_scene(const std::string& file);
/// Names of the layouts of sensors among them: "digit" is sensors/digit.xml.
std::vector<std::string> program_sensors();

}  // namespace tangere::apps
