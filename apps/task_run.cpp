// SPDX-License-Identifier: Apache-2.0
// The program contains the scenes of its own tasks, so it needs no folder of scenes to run them.
#include "apps/task_run.hpp"

#include <fmt/format.h>

#include <charconv>
#include <filesystem>

#include "apps/named_value.hpp"
#include "apps/scene_run.hpp"
#include "io/files/csv.hpp"
#include "io/files/nearest_name.hpp"
#include "io/scene/scene_reader.hpp"
#include "tasks/catalogue/task_list.hpp"

namespace tangere::apps {

std::unique_ptr<Task> find_task(const std::string& word, const Console& console,
                                const SolverOptions& requested) {
  if (is_task(word)) {
    const TaskSpec spec = task_spec(word);
    const char* const text = program_scene(spec.scene);
    // A task of another program names a file.
    SceneFile file = text != nullptr ? parse_scene(text, spec.scene) : read_scene(spec.scene);
    for (const std::string& warning : file.warnings) console.note("warning: " + warning);
    apply_solver_options(file.scene.solver, requested);
    return make_task(word, file.scene);
  }
  const bool plain = word.find('/') == std::string::npos && word.find('.') == std::string::npos;
  if (plain && !std::filesystem::exists(word))
    throw InputError(
        fmt::format("'{}' is neither a file nor a task{}", word, suggestion(word, task_names())));
  return nullptr;
}

void note_outputs_of(const Console& console, const Task& task, const std::string& instead) {
  const std::optional<OutputsDescription>& outputs = task.model().scene().outputs;
  if (outputs)
    console.note(fmt::format("{}<outputs> are for runs of the scene: task {} {}",
                             outputs->source.prefix(), task.spec().name, instead));
}

PolicyKind policy_named(const std::string& name, const std::string& table, PolicyKind fallback) {
  PolicyKind kind = table.empty() ? fallback : PolicyKind::csv;
  if (!name.empty())
    kind =
        named_value("policy", name,
                    {PolicyKind::random, PolicyKind::hold, PolicyKind::csv, PolicyKind::scripted});
  if (kind == PolicyKind::csv && table.empty())
    throw InputError("--policy csv without --controls; expected both");
  if (kind != PolicyKind::csv && !table.empty())
    throw InputError(
        fmt::format("--policy {} with --controls; expected csv, or no --controls", name));
  return kind;
}

double random_share_of(const std::string& mix) {
  constexpr std::string_view kBegin = "random=";
  double share = 0;
  const char* const end = mix.data() + mix.size();
  const bool begins = mix.starts_with(kBegin);
  const auto [at, error] =
      begins ? std::from_chars(mix.data() + kBegin.size(), end, share) : std::from_chars_result{};
  if (!begins || error != std::errc() || at != end || !(share > 0 && share < 1))
    throw InputError(
        fmt::format("--mix {}: expected random=SHARE with a share between 0 and 1", mix));
  return share;
}

Policy make_policy(const Task& task, PolicyKind kind, const std::string& table,
                   const PolicyVariation& variation) {
  if (kind != PolicyKind::csv) return Policy(task, kind, {}, variation);
  return Policy(task, kind, read_csv(table, task.spec().action.size()));
}

void refuse_with_task(const Task& task, const std::vector<GivenOption>& options) {
  for (const GivenOption& option : options)
    if (option.given)
      throw InputError(fmt::format(
          "{} with task '{}', which takes at most {} actions of {} steps; expected it with "
          "scenes only",
          option.name, task.spec().name, task.spec().horizon, task.spec().steps_per_action));
}

void refuse_with_scene(const std::string& scene, const std::vector<GivenOption>& options) {
  for (const GivenOption& option : options)
    if (option.given)
      throw InputError(fmt::format("{} with the scene '{}'; expected a task", option.name, scene));
}

}  // namespace tangere::apps
