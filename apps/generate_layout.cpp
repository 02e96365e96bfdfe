// SPDX-License-Identifier: Apache-2.0
// The command that makes a data set again is written from the options, without what changes no
// byte.
#include "apps/generate_layout.hpp"

#include <fmt/format.h>

#include "engine/base/hash.hpp"
#include "io/dataset/dataset_from_model.hpp"
#include "io/files/text_file.hpp"
#include "kernels/table/isa.hpp"

namespace tangere::apps {
namespace {

/// Names a table by its content, because a path may lead elsewhere on another machine.
std::string controls_named(const std::string& path) {
  if (path.empty()) return "of the scene";
  constexpr std::size_t kLargestTable = std::size_t{1} << 32;
  const std::string text = read_text_file(path, kLargestTable, "a csv file");
  return fmt::format("a table of checksum {:016x}", hash_bytes(text));
}

/// For a shell that reads the command again.
std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

/// Returns the command that makes the same data set again, in any folder and on any number of
/// threads. With --program, this holds if the program is found from there and answers the same.
std::string command_of(const GenerateOptions& options, const EpisodeOptions& run,
                       const std::string& policy) {
  std::string command = fmt::format("tangere generate {} --episodes {} --seed {} --precision {}",
                                    options.scene, run.episodes, run.seed, options.precision);
  if (policy.empty()) command += fmt::format(" --steps {} --every {}", run.steps, run.every);
  if (!policy.empty()) command += " --policy " + policy;
  if (options.noise) command += fmt::format(" --noise {}", *options.noise);
  if (!options.mix.empty()) command += " --mix " + options.mix;
  if (!options.name.empty()) command += " --name " + options.name;
  if (!options.program.empty()) command += " --program " + quoted(options.program);
  if (!options.controls.empty()) command += " --controls " + options.controls;
  if (options.accuracy) command += fmt::format(" --accuracy {}", *options.accuracy);
  if (options.sleep) command += " --sleep";
  if (options.compress != "none") command += " --compress " + options.compress;
  if (const int quality = jpeg_quality_named(options.pictures); quality > 0)
    command += fmt::format(" --pictures jpeg:{}", quality);
  if (options.tactile != "sparse") command += " --tactile " + options.tactile;
  if (!options.record.empty()) command += " --record " + options.record;
  if (options.shards) command += fmt::format(" --shards {}", *options.shards);
  if (options.gradients != "none") command += " --gradients " + options.gradients;
  if (!options.loss.empty()) command += " --loss " + options.loss;
  return command;
}

}  // namespace

DatasetLayout make_layout(const GenerateOptions& options, const Model& model,
                          const Stepper& stepper, const EpisodeOptions& run,
                          const ProgramInfo& info, const GradientPlan& gradients, const Task* task,
                          const PlayedBy& played_by) {
  DatasetLayout description;
  if (task != nullptr) description.task.emplace(task->spec());
  description.played_by = played_by;
  description.set_name = options.name;
  description.controls = controls_named(options.controls);
  description.command = command_of(options, run, played_by.policy);
  description.shards = options.shards.value_or(0);
  description.compression = options.compress;
  description.jpeg_quality = jpeg_quality_named(options.pictures);
  description.record = run.record;
  description.sparse = options.tactile == "sparse";
  description.gradients_of =
      options.loss.empty() ? options.gradients : options.gradients + " " + options.loss;
  description.gradients = gradients.arrays;
  description.episodes = run.episodes;
  description.steps = run.steps;
  description.every = run.every;
  description.seed = run.seed;
  description.precision = to_string(run.precision);
  description.single = run.precision == Precision::mixed;
  description.version = info.version;
  description.instruction_set = kernels::active_isa_name();
  return dataset_layout_from(model, stepper, description);
}

}  // namespace tangere::apps
