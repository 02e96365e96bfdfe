// SPDX-License-Identifier: Apache-2.0
// Two serial runs of the same batch in turn. Neighbours in time are compared, because a busy
// machine slows down and recovers.
#include "tasks/effects/sleep_gain.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "engine/base/as_size.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "tasks/run/episode_program.hpp"
#include "tasks/run/thread_time.hpp"

namespace tangere {
namespace {

/// Plays the run. Returns the seconds of its steps alone.
double play(Stepper& stepper, Batch& batch, std::uint64_t seed) {
  const Model& model = batch.model();
  const ControlProgram program(model, model.timestep(), seed);
  const std::int64_t steps =
      program.steps() < 0 ? kOpenRunSteps : std::min(program.steps(), kMostRunSteps);
  std::vector<double> u(as_size(model.nu()) * as_size(batch.environments()));
  double seconds = 0;
  for (std::int64_t step = 0; step < steps; ++step) {
    write_controls(program, step, batch, u);
    const double start = thread_seconds();
    stepper.step(batch, u);
    seconds += thread_seconds() - start;
  }
  return seconds;
}

std::size_t bytes_of(const SleepState& s) {
  return sizeof(SleepState) + s.asleep.size() * sizeof(s.asleep[0]) +
         s.island.size() * sizeof(s.island[0]) + s.rested.size() * sizeof(s.rested[0]) +
         s.u.size() * sizeof(s.u[0]);
}

}  // namespace

SleepGain measure_sleep_gain(const Model& model, int environments, std::uint64_t seed, int rounds) {
  StepperOptions awake;
  awake.sleep = 0;
  Stepper with(model), without(model, awake);
  const Batch start(model, environments, seed);
  SleepGain gain;
  std::vector<double> added;
  for (int round = 0; round < rounds; ++round) {
    Batch asleep = start, other = start;
    const double first = round % 2 == 0 ? play(with, asleep, seed) : 0;
    const double never = play(without, other, seed);
    added.push_back((round % 2 == 0 ? first : play(with, asleep, seed)) / never - 1);
    if (round > 0) continue;
    for (int e = 0; e < environments; ++e) {
      const SleepState& state = asleep.sleep(e);
      gain.mean_asleep +=
          double(state.slept) / double(std::max<std::int64_t>(1, asleep.steps(e))) / environments;
      gain.bytes = std::max(gain.bytes, bytes_of(state));
    }
  }
  double mean = 0, squares = 0;
  for (const double x : added) mean += x / rounds;
  for (const double x : added) squares += (x - mean) * (x - mean);
  std::sort(added.begin(), added.end());
  gain.added.share = added[added.size() / 2];
  gain.added.spread = std::sqrt(squares / std::max(1, rounds - 1) / rounds);
  return gain;
}

}  // namespace tangere
