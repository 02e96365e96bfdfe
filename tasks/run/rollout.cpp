// SPDX-License-Identifier: Apache-2.0
// Blocks are stepped and read on several threads; rows leave from one, in ascending order.
#include "tasks/run/rollout.hpp"

#include <chrono>
#include <string>

#include "tasks/run/block_reader.hpp"
#include "tasks/run/block_threads.hpp"
#include "tasks/run/recorder.hpp"

namespace tangere {
namespace {

void check(std::span<const Stepper> steppers, const RolloutOptions& options) {
  if (steppers.empty())
    throw InputError("a rollout without a stepper; expected one for each thread");
  if (options.steps < 1)
    throw InputError("a rollout of " + std::to_string(options.steps) +
                     " steps; expected at least 1");
  if (options.every < 0)
    throw InputError("tactile every " + std::to_string(options.every) +
                     " steps; expected 1 or more, or 0 for the scene's own");
  if (options.first_step < 0)
    throw InputError("a rollout from step " + std::to_string(options.first_step) +
                     "; expected 0 or more");
}

}  // namespace

Recording rollout_recording(const Batch& batch, const Stepper& stepper,
                            const RolloutOptions& options, const RunFacts& facts) {
  Recorder recorder(batch, std::span(&stepper, 1), options, facts.task ? &*facts.task : nullptr);
  Recording recording = recorder.take_description();
  recording.facts = attributes_of(facts, options.steps, options.every);
  const Attributes more{{"tangere_version", facts.version},
                        {"instruction_set", facts.instruction_set},
                        {"command_line", facts.command},
                        {"scene_name", facts.scene_name},
                        {"scene_path", facts.scene_path},
                        {"scene_text", facts.scene_text},
                        {"first_episode", batch.episode(0)},
                        {"first_step", options.first_step},
                        {"environments", std::int64_t{batch.environments()}},
                        {"quaternion_order", "w x y z"},
                        {"world_axes", "right-handed, SI units"},
                        {"task", facts.task ? facts.task->name : kNoTask}};
  recording.facts.insert(recording.facts.end(), more.begin(), more.end());
  return recording;
}

RolloutSummary run_rollout(Batch& batch, std::span<Stepper> steppers,
                           const ControlProgram& controls, const RolloutOptions& options,
                           RowSink& sink, const ProgressCallback& progress,
                           const std::stop_token& stop) {
  check(steppers, options);
  if (const double step = steppers.front().timestep(); controls.timestep() != step)
    throw InputError("controls laid out for a timestep of " + std::to_string(controls.timestep()) +
                     " s; the stepper's is " + std::to_string(step) + " s");
  controls.check_covers(options.first_step + options.steps);
  SceneProgram program(controls, 1, options.first_step);
  return run_rollout(batch, steppers, program, options, sink, progress, stop);
}

RolloutSummary run_rollout(Batch& batch, std::span<Stepper> steppers, EpisodeProgram& program,
                           const RolloutOptions& options, RowSink& sink,
                           const ProgressCallback& progress, const std::stop_token& stop) {
  check(steppers, options);
  const double timestep = steppers.front().timestep();
  check_sensor_memory(batch.model(), timestep);
  const auto start = std::chrono::steady_clock::now();
  BlockThreads threads(static_cast<int>(steppers.size()));
  RolloutSummary summary;
  StepTally tally(batch, 0, batch.environments());
  std::vector<double> u(static_cast<std::size_t>(batch.environments()) *
                        static_cast<std::size_t>(batch.model().nu()));
  const auto each_block = [&](const auto& body) {
    for (int b = 0; b < batch.blocks(); ++b) body(b);
  };

  TaskProgram* const task = program.task_program();
  Recorder recorder(batch, steppers, options, task != nullptr ? &task->task().spec() : nullptr);
  recorder.begin(u, tally, task != nullptr ? &task->data() : nullptr, threads, sink);
  for (std::int64_t t = 0; t < options.steps; ++t) {
    each_block([&](int b) { program.controls(t, batch, b, u); });
    recorder.before_step();
    threads.for_each(batch.blocks(), steppers,
                     [&](Stepper& stepper, int b) { stepper.step_block(batch, b, u); });
    recorder.after_step(t + 1);
    tally.count(batch, t);
    each_block([&](int b) { program.after_step(t, batch, b); });
    if ((t + 1) % program.steps_per_row() == 0) {
      each_block([&](int b) { program.after_row(batch, b); });
      // A warm-up is no action.
      if (task != nullptr && t >= task->opening_steps())
        recorder.write(Recorder::When::action, t + 1);
    }
    recorder.write(Recorder::When::row, t + 1);
    summary.steps = t + 1;
    if (progress) progress(t + 1);
    summary.stopped = stop.stop_requested();
    if (summary.stopped) break;
  }
  summary.counts = tally.counts;
  summary.counts.loads_not_carried = recorder.loads_not_carried();
  summary.audit = recorder.audit();
  summary.failures = std::move(tally.failures);
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace tangere
