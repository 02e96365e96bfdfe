// SPDX-License-Identifier: Apache-2.0
// What all commands that accept a task have in common: telling tasks from scene files, making the
// task and its policy, and reporting on it.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/console.hpp"
#include "tasks/run/policy.hpp"

namespace tangere::apps {

/// The task that `word` names, on its own scene; null when it names a file. Throws InputError, with
/// the nearest task, for a plain word that is neither.
std::unique_ptr<Task> find_task(const std::string& word, const Console& console);

/// The policy called `name`, or `fallback` if that is empty. With a table it is csv. Throws
/// InputError for another name, for csv without a table, and for a table with another policy.
PolicyKind policy_named(const std::string& name, const std::string& table, PolicyKind fallback);
Policy make_policy(const Task& task, PolicyKind kind, const std::string& table);

/// Takes options that have no meaning with a task, and whether they were given. Throws InputError
/// for an option that was given.
struct GivenOption {
  const char* name;
  bool given;
};
void refuse_with_task(const Task& task, const std::vector<GivenOption>& options);
/// The same for options that a scene alone does not have.
void refuse_with_scene(const std::string& scene, const std::vector<GivenOption>& options);

/// The text of a scene that comes with the program, null for other names.
const char* task_scene(const std::string& file);

}  // namespace tangere::apps
