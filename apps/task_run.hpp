// SPDX-License-Identifier: Apache-2.0
// What every command that accepts a task does the same way: telling tasks from scene files, making
// one, its policy, what to say of it.
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

/// `name`: as given, `fallback` where it is empty; a table makes it csv. Throws InputError for
/// another name, and for csv without a table or a table with another policy.
PolicyKind policy_named(const std::string& name, const std::string& table, PolicyKind fallback);
Policy make_policy(const Task& task, PolicyKind kind, const std::string& table);

/// Options that have no meaning with a task, and whether they were given. Throws InputError for one
/// that was.
struct GivenOption {
  const char* name;
  bool given;
};
void refuse_with_task(const Task& task, const std::vector<GivenOption>& options);
/// The same for those that a scene alone does not have.
void refuse_with_scene(const std::string& scene, const std::vector<GivenOption>& options);

/// Text of a scene that comes with the program, null for others.
const char* task_scene(const std::string& file);

}  // namespace tangere::apps
