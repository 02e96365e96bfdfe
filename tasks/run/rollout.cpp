// SPDX-License-Identifier: Apache-2.0
// The serial rollout. Buffers are made once; rows leave in ascending order.
#include "tasks/run/rollout.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <string>

#include "engine/sense/readout.hpp"
#include "kernels/numbers/block.hpp"

namespace tangere {
namespace {

constexpr int kPoseWidth = 7, kTwistWidth = 6, kForceWidth = 3, kPositionWidth = 3;

/// Numbers of one environment in the largest tactile field.
std::size_t largest_field(const Model& model) {
  std::size_t largest = 0;
  for (const SensorInfo& sensor : model.sensors())
    largest = std::max(largest, static_cast<std::size_t>(sensor.points) * kForceWidth);
  return largest;
}

/// Copies a batch row by row into dense arrays and hands them on.
class Recorder {
 public:
  Recorder(const Batch& batch, Precision precision, RowSink& sink)
      : batch_(batch),
        sink_(sink),
        readout_(batch.model(), precision),
        environments_(batch.environments()) {
    const Model& model = batch.model();
    const auto e = static_cast<std::size_t>(environments_);
    q_.resize(e * static_cast<std::size_t>(model.nq()));
    v_.resize(e * static_cast<std::size_t>(model.nv()));
    pose_.resize(e * static_cast<std::size_t>(model.nb()) * kPoseWidth);
    twist_.resize(e * static_cast<std::size_t>(model.nb()) * kTwistWidth);
    end_effectors_.resize(e * model.end_effectors().size() * kPositionWidth);
    force_.resize(e * largest_field(model));
    iterations_.resize(e);
    status_.resize(e);
  }

  void write_state(std::int64_t step, double time) {
    for (int e = 0; e < environments_; ++e) {
      batch_.get_q(e, part(q_, e));
      batch_.get_v(e, part(v_, e));
      readout_.bodies(batch_, e, part(pose_, e), part(twist_, e));
    }
    if (!end_effectors_.empty())
      each_block(end_effectors_, [&](int block, auto positions) {
        readout_.read_end_effectors(batch_, block, positions);
      });
    sink_.write(StateRow{step, time, q_, v_, pose_, twist_, end_effectors_});
  }

  /// `stepping`: the environments that took the step.
  void write_step(std::int64_t step, std::span<const double> u, const std::vector<bool>& stepping) {
    for (int e = 0; e < environments_; ++e) {
      const auto i = static_cast<std::size_t>(e);
      iterations_[i] = stepping[i] ? batch_.iterations(e) : 0;
      status_[i] = static_cast<std::int8_t>(batch_.status(e));
    }
    sink_.write(StepRow{step, u, iterations_, status_, batch_.residuals()});
  }

  void write_field(int sensor, std::int64_t frame, std::int64_t step) {
    const auto points =
        static_cast<std::size_t>(batch_.model().sensors()[static_cast<std::size_t>(sensor)].points);
    const std::span<double> field =
        std::span(force_).first(static_cast<std::size_t>(environments_) * points * kForceWidth);
    each_block(field,
               [&](int block, auto fields) { readout_.read_block(batch_, block, sensor, fields); });
    sink_.write(TactileRow{sensor, frame, step, field});
  }

 private:
  /// Calls `read` with every block and where its environments' numbers go.
  template <class Read>
  void each_block(std::span<double> all, const Read& read) const {
    std::array<std::span<double>, kernels::kBlock> parts;
    for (int block = 0; block < batch_.blocks(); ++block) {
      const int first = block * kernels::kBlock,
                last = std::min(first + kernels::kBlock, environments_);
      for (int e = first; e < last; ++e) parts[static_cast<std::size_t>(e - first)] = part(all, e);
      read(block, std::span<const std::span<double>>(parts));
    }
  }

  [[nodiscard]] std::span<double> part(std::span<double> all, int environment) const {
    const std::size_t width = all.size() / static_cast<std::size_t>(environments_);
    return all.subspan(static_cast<std::size_t>(environment) * width, width);
  }

  const Batch& batch_;
  RowSink& sink_;
  Readout readout_;
  int environments_;
  std::vector<double> q_, v_, pose_, twist_, end_effectors_;  // as in StateRow
  std::vector<double> force_;                                 // shared by the sensors
  std::vector<std::int32_t> iterations_;
  std::vector<std::int8_t> status_;
};

void check(const RolloutOptions& options) {
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

/// Every environment's controls from its episode.
class ProgramDriver : public RolloutDriver {
 public:
  ProgramDriver(const ControlProgram& controls, std::int64_t first_step)
      : controls_(controls), first_step_(first_step) {}

  void drive(std::int64_t step, Batch& batch, std::span<double> u) override {
    const auto nu = static_cast<std::size_t>(batch.model().nu());
    for (int e = 0; e < batch.environments(); ++e)
      controls_.evaluate(first_step_ + step, batch.episode(e),
                         u.subspan(static_cast<std::size_t>(e) * nu, nu));
  }
  void done(std::int64_t, Batch&, RowSink&) override {}

 private:
  const ControlProgram& controls_;
  std::int64_t first_step_;
};

/// Counts one step's outcome into the summary; environments that failed in it leave `live`.
void count(const Batch& batch, std::int64_t step, const std::vector<bool>& stepping,
           std::vector<bool>& live, RolloutSummary& summary) {
  for (int e = 0; e < batch.environments(); ++e) {
    if (!stepping[static_cast<std::size_t>(e)]) continue;
    const StepStatus status = batch.status(e);
    ++summary.environment_steps;
    summary.newton_iterations += batch.iterations(e);
    summary.split_steps += status == StepStatus::split ? 1 : 0;
    if (!failed(status)) continue;
    summary.failures.push_back({e, step, status});
    live[static_cast<std::size_t>(e)] = false;
  }
}

}  // namespace

int tactile_interval(const SensorInfo& sensor, const RolloutOptions& options) {
  if (options.every > 0) return options.every;
  return sensor.every > 0 ? sensor.every : 1;
}

std::int64_t tactile_frames(const SensorInfo& sensor, const RolloutOptions& options) {
  const int every = tactile_interval(sensor, options);
  return (options.first_step + options.steps) / every - options.first_step / every;
}

double rollout_bytes(const Model& model, int environments) {
  const double numbers =
      model.nq() + model.nv() + model.nu() + double{kPoseWidth + kTwistWidth} * model.nb() +
      static_cast<double>(model.end_effectors().size() * kPositionWidth + largest_field(model));
  constexpr double kFlags = sizeof(std::int32_t) + sizeof(std::int8_t);
  return environments * (numbers * sizeof(double) + kFlags);
}

RolloutSummary run_rollout(Batch& batch, Stepper& stepper, const ControlProgram& controls,
                           const RolloutOptions& options, RowSink& sink,
                           const RolloutProgress& progress) {
  check(options);
  if (controls.timestep() != stepper.timestep())
    throw InputError("controls laid out for a timestep of " + std::to_string(controls.timestep()) +
                     " s; the stepper's is " + std::to_string(stepper.timestep()) + " s");
  controls.check_covers(options.first_step + options.steps);
  ProgramDriver driver(controls, options.first_step);
  return run_rollout(batch, stepper, driver, options, sink, progress);
}

RolloutSummary run_rollout(Batch& batch, Stepper& stepper, RolloutDriver& driver,
                           const RolloutOptions& options, RowSink& sink,
                           const RolloutProgress& progress) {
  check(options);
  const auto start = std::chrono::steady_clock::now();
  const auto sensors = batch.model().sensors();
  const auto environments = static_cast<std::size_t>(batch.environments());
  const auto nu = static_cast<std::size_t>(batch.model().nu());
  Recorder recorder(batch, options.precision, sink);
  RolloutSummary summary;
  std::vector<double> u(environments * nu);
  std::vector<bool> live(environments), stepping(environments);
  for (std::size_t e = 0; e < environments; ++e) {
    live[e] = !failed(batch.statuses()[e]);
    if (!live[e]) summary.failures.push_back({static_cast<int>(e), -1, batch.statuses()[e]});
  }

  // Times come from the counter, so that they do not drift.
  const auto time = [&](std::int64_t row) {
    return static_cast<double>(options.first_step + row) * stepper.timestep();
  };
  recorder.write_state(0, time(0));
  for (std::int64_t t = 0; t < options.steps; ++t) {
    driver.drive(t, batch, u);
    for (std::size_t e = 0; e < environments; ++e)
      stepping[e] = live[e] && !batch.held(static_cast<int>(e));
    stepper.step(batch, u);
    recorder.write_step(t, u, stepping);
    count(batch, t, stepping, live, summary);
    driver.done(t, batch, sink);
    recorder.write_state(t + 1, time(t + 1));
    for (std::size_t s = 0; s < sensors.size(); ++s) {
      const std::int64_t every = tactile_interval(sensors[s], options),
                         done = options.first_step + t + 1;
      if (done % every == 0)
        recorder.write_field(static_cast<int>(s), done / every - options.first_step / every - 1,
                             t + 1);
    }
    summary.steps = t + 1;
    summary.stopped = progress && !progress(t + 1);
    if (summary.stopped) break;
  }
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

}  // namespace tangere
