// SPDX-License-Identifier: Apache-2.0
// Blocks are stepped and read on several threads; rows leave from one, in ascending order. Buffers
// are made once.
#include "tasks/run/rollout.hpp"

#include <algorithm>
#include <chrono>
#include <string>

#include "kernels/numbers/block.hpp"
#include "tasks/run/block_reader.hpp"
#include "tasks/run/block_threads.hpp"
#include "tasks/run/energy_balance_recorder.hpp"

namespace tangere {
namespace {

constexpr int kPoseWidth = 7, kTwistWidth = 6, kPositionWidth = 3;

std::size_t numbers_in(const Model& model, FieldOutput output) {
  return numbers_of(model.sensors()[static_cast<std::size_t>(output.sensor)].points, output.form);
}

/// Numbers of one environment in the largest reading.
std::size_t largest_reading(const Model& model, const RolloutOutputs& outputs) {
  std::size_t largest = 0;
  for (const FieldOutput output : fields_of(model, outputs))
    largest = std::max(largest, numbers_in(model, output));
  return largest;
}

std::size_t bodies_in(const Model& model, const RolloutOutputs& outputs) {
  if (!outputs.bodies) return 0;
  return outputs.chosen_bodies.empty() ? static_cast<std::size_t>(model.nb())
                                       : outputs.chosen_bodies.size();
}

/// Copies rows of a batch into dense arrays and writes them to the sink.
class Recorder {
 private:
  [[nodiscard]] std::span<double> part(std::span<double> all, int environment) const {
    const std::size_t width = all.size() / static_cast<std::size_t>(environments_);
    return all.subspan(static_cast<std::size_t>(environment) * width, width);
  }
  [[nodiscard]] auto place(std::span<double> all) const {
    return [this, all](int environment) { return part(all, environment); };
  }

 public:
  Recorder(const Batch& batch, const RolloutOptions& options, BlockThreads& threads, int workers,
           RowSink& sink)
      : batch_(batch),
        sink_(sink),
        threads_(threads),
        environments_(batch.environments()),
        options_(options) {
    const Model& model = batch.model();
    for (int k = 0; k < workers; ++k) readouts_.emplace_back(model, options.precision);
    const RolloutOutputs& outputs = options.outputs;
    const auto e = static_cast<std::size_t>(environments_);
    q_.resize(e * static_cast<std::size_t>(model.nq()));
    v_.resize(e * static_cast<std::size_t>(model.nv()));
    const std::size_t bodies = bodies_in(model, outputs);
    pose_.resize(e * bodies * kPoseWidth);
    twist_.resize(e * bodies * kTwistWidth);
    if (outputs.end_effectors)
      end_effectors_.resize(e * model.end_effectors().size() * kPositionWidth);
    reading_.resize(e * largest_reading(model, outputs));
    iterations_.resize(e);
    status_.resize(e);
  }

  void write_state(std::int64_t step, double time) {
    const RolloutOutputs& outputs = options_.outputs;
    const bool states = is_due(outputs.states, step),
               bodies = !pose_.empty() && is_due(outputs.of_bodies, step),
               end_effectors = !end_effectors_.empty() && is_due(outputs.of_end_effectors, step);
    if (!states && !bodies && !end_effectors) return;
    for (int block = 0; block < batch_.blocks(); ++block) {
      if (states) read_states(batch_, block, place(q_), place(v_));
      if (end_effectors) read_end_effectors(readouts_[0], batch_, block, place(end_effectors_));
    }
    for (int e = 0; e < environments_ && bodies; ++e)
      readouts_[0].bodies(batch_, e, part(pose_, e), part(twist_, e), outputs.chosen_bodies);
    StateRow row{step, time, {}, {}, {}, {}, {}};
    if (states) row.q = q_, row.v = v_;
    if (bodies) row.body_pose = pose_, row.body_twist = twist_;
    if (end_effectors) row.end_effectors = end_effectors_;
    sink_.write(row);
    if (states) sink_.write(SleepRow{step, batch_.sleeps()});
  }

  void write_memory(std::int64_t step) {
    if (options_.outputs.memory && is_due(options_.outputs.of_memory, step))
      sink_.write(MemoryRow{step, batch_.shear_states()});
  }

  /// Writes step `step`, which has been taken but not counted yet.
  void write_step(std::int64_t step, std::span<const double> u, const StepTally& tally) {
    const bool thinned = options_.outputs.states.given();
    if (thinned && !is_due(options_.outputs.states, step + 1)) return;
    if (thinned) u = {};
    for (int e = 0; e < environments_; ++e) {
      const auto i = static_cast<std::size_t>(e);
      iterations_[i] = tally.steps(batch_, e) ? batch_.iterations(e) : 0;
      status_[i] = static_cast<std::int8_t>(batch_.status(e));
    }
    sink_.write(StepRow{step, u, iterations_, status_, batch_.residuals()});
  }

  void write_field(FieldOutput output, std::int64_t frame, std::int64_t step) {
    const std::span<double> numbers = std::span(reading_).first(
        static_cast<std::size_t>(environments_) * numbers_in(batch_.model(), output));
    threads_.for_each(batch_.blocks(), readouts_, [&](Readout& readout, int block) {
      read_field<double>(readout, batch_, block, output, place(numbers));
    });
    sink_.write(TactileRow{output, frame, step, numbers});
  }

 private:
  [[nodiscard]] bool is_due(const OutputTimes& times, std::int64_t row) const {
    return times.at(row, options_.steps, options_.first_step);
  }

  const Batch& batch_;
  RowSink& sink_;
  BlockThreads& threads_;
  std::vector<Readout> readouts_;  // one for each thread
  int environments_;
  const RolloutOptions& options_;
  std::vector<double> q_, v_, pose_, twist_, end_effectors_;  // as in StateRow
  std::vector<double> reading_;                               // shared by the sensors
  std::vector<std::int32_t> iterations_;
  std::vector<std::int8_t> status_;
};

/// Throws InputError for a body that is not there.
void check_bodies(const Model& model, const std::vector<int>& bodies) {
  for (const int body : bodies)
    if (body < 0 || body >= model.nb())
      throw InputError("an output of body " + std::to_string(body) + "; the scene has " +
                       std::to_string(model.nb()));
}

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

/// Writes the result of the action that ends with step `step`, unless it is part of a warm-up.
void write_action(EpisodeProgram& program, std::int64_t step, RowSink& sink) {
  const TaskProgram* const task = program.judged();
  if (task == nullptr || step < task->opening_steps()) return;
  const EnvironmentData& d = task->data();
  sink.write(ActionRow{(step - task->opening_steps()) / task->steps_per_row(), step + 1, d.action,
                       d.reward, d.terminated, d.truncated, d.success});
}

}  // namespace

std::vector<FieldOutput> fields_of(const Model& model, const RolloutOutputs& outputs) {
  if (!outputs.fields) return whole_fields(model.scene());
  check_outputs(*outputs.fields, model.sensors().size());
  return *outputs.fields;
}

int tactile_interval(const SensorInfo& sensor, const RolloutOptions& options) {
  if (options.every > 0) return options.every;
  return sensor.every > 0 ? sensor.every : 1;
}

OutputTimes reading_times(const Model& model, FieldOutput output, const RolloutOptions& options) {
  if (output.times.given()) return output.times;
  return {tactile_interval(model.sensors()[static_cast<std::size_t>(output.sensor)], options)};
}

/// Readings follow steps, so none is taken at row 0.
std::int64_t tactile_frames(const Model& model, FieldOutput output, const RolloutOptions& options) {
  const OutputTimes times = reading_times(model, output, options);
  return times.before(options.steps + 1, options.steps, options.first_step) -
         times.before(1, options.steps, options.first_step);
}

double rollout_bytes(const Model& model, int environments, const RolloutOutputs& outputs) {
  const double numbers =
      model.nq() + model.nv() + model.nu() +
      double{kPoseWidth + kTwistWidth} * static_cast<double>(bodies_in(model, outputs)) +
      static_cast<double>((outputs.end_effectors ? model.end_effectors().size() : 0) *
                              kPositionWidth +
                          largest_reading(model, outputs));
  constexpr double kFlags = sizeof(std::int32_t) + sizeof(std::int8_t);
  return environments * (numbers * sizeof(double) + kFlags) +
         (outputs.audit ? EnergyBalanceRecorder::bytes(environments) : 0);
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
  check_bodies(batch.model(), options.outputs.chosen_bodies);
  check_sensor_memory(batch.model(), timestep);
  const auto start = std::chrono::steady_clock::now();
  const int workers = static_cast<int>(steppers.size());
  BlockThreads threads(workers);
  Recorder recorder(batch, options, threads, workers, sink);
  std::optional<EnergyBalanceRecorder> audit;
  if (options.outputs.audit) audit.emplace(batch, timestep, sink);
  struct Reading {
    FieldOutput output;
    OutputTimes times;
    std::int64_t frame = 0;  // the next one
  };
  std::vector<Reading> readings;
  for (const FieldOutput output : fields_of(batch.model(), options.outputs))
    readings.push_back({output, reading_times(batch.model(), output, options)});
  RolloutSummary summary;
  StepTally tally(batch, 0, batch.environments());
  std::vector<double> u(static_cast<std::size_t>(batch.environments()) *
                        static_cast<std::size_t>(batch.model().nu()));
  const auto each_block = [&](const auto& body) {
    for (int b = 0; b < batch.blocks(); ++b) body(b);
  };

  // Times come from the step counter, so they do not drift.
  const auto time = [&](std::int64_t row) {
    return static_cast<double>(options.first_step + row) * timestep;
  };
  recorder.write_state(0, time(0));
  recorder.write_memory(0);
  if (audit) audit->start();
  for (std::int64_t t = 0; t < options.steps; ++t) {
    each_block([&](int b) { program.controls(t, batch, b, u); });
    if (audit) audit->before(u);
    threads.for_each(batch.blocks(), steppers,
                     [&](Stepper& stepper, int b) { stepper.step_block(batch, b, u); });
    recorder.write_step(t, u, tally);
    if (audit) audit->after(t, u, tally);
    tally.count(batch, t);
    each_block([&](int b) { program.look(t, batch, b); });
    if ((t + 1) % program.steps_per_row() == 0) {
      each_block([&](int b) { program.judge(batch, b); });
      write_action(program, t, sink);
    }
    recorder.write_state(t + 1, time(t + 1));
    recorder.write_memory(t + 1);
    for (Reading& reading : readings)
      if (reading.times.at(t + 1, options.steps, options.first_step))
        recorder.write_field(reading.output, reading.frame++, t + 1);
    summary.steps = t + 1;
    if (progress) progress(t + 1);
    summary.stopped = stop.stop_requested();
    if (summary.stopped) break;
  }
  summary.counts = tally.counts;
  if (audit) summary.audit = audit->summary();
  summary.failures = std::move(tally.failures);
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace tangere
