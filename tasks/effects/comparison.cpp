// SPDX-License-Identifier: Apache-2.0
// Single steps in turn, at one instant after the other:
//
//   share = (S - S')/T + Σ_sensors (F - F')/(every T)      T = S + Σ_sensors F/every
//
// S is a step and F a reading of a field, per environment; S' and F' are those of the other model.
// Each is a sum over the instants of lower quartiles over the rounds: what disturbs a step makes it
// longer, never shorter, and disturbs nothing else.
#include "tasks/effects/comparison.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "engine/base/as_size.hpp"
#include "engine/model/random.hpp"

namespace tangere {
namespace {

/// Readings of large pads take longer than steps, but vary less: at one in so many instants.
constexpr int kReadingStride = 3;
constexpr int kResamples = 100, kBisections = 8;
/// The loosest tolerance that is tried: every first guess meets it.
constexpr double kAnything = 1e12;

/// Times of both models at one instant; those of one round were taken one after the other [s].
struct InstantTimes {
  std::vector<double> with, without;
};

double lower_quartile(std::vector<double> times) {
  const auto quarter = times.begin() + std::ptrdiff_t(times.size() / 4);
  std::nth_element(times.begin(), quarter, times.end());
  return *quarter;
}

double lower_quartile(const std::vector<double>& times, const std::vector<std::size_t>& which) {
  std::vector<double> drawn;
  drawn.reserve(which.size());
  for (const std::size_t k : which) drawn.push_back(times[k]);
  return lower_quartile(std::move(drawn));
}

/// Returns the share of its time that the first model would save by being the other.
double saved(const std::vector<InstantTimes>& instants, const std::vector<std::size_t>& rounds) {
  double with = 0, without = 0;
  for (const InstantTimes& at : instants) {
    with += lower_quartile(at.with, rounds);
    without += lower_quartile(at.without, rounds);
  }
  return with > 0 ? 1 - without / with : 0;
}

/// Returns the time of all readings, each weighed by how often it happens [s].
double reading_time(TimedModel& model, int instant) {
  double sum = 0;
  for (std::size_t k = 0; k < model.readings().size(); ++k)
    sum += model.time_reading(k, instant) / model.interval(k);
  return sum;
}

template <class A, class B>
void take_turns(int rounds, const A& with, const B& without, InstantTimes& times) {
  for (int round = 0; round < rounds; ++round) {
    if (round % 2 == 0) times.with.push_back(with());
    times.without.push_back(without());
    if (round % 2 != 0) times.with.push_back(with());
  }
}

/// Loosens the tolerance of a model until it needs as few passes as `passes`.
void need_as_few(TimedModel& model, int instant, double passes, double tolerance) {
  model.solve_to(kAnything);
  if (model.time_step(instant).group_passes >= passes) return;
  double low = std::log(tolerance), high = std::log(kAnything), best = low, least = HUGE_VAL;
  for (int k = 0; k < kBisections; ++k) {
    const double middle = (low + high) / 2;
    model.solve_to(std::exp(middle));
    const double found = model.time_step(instant).group_passes;
    if (std::abs(found - passes) < least) least = std::abs(found - passes), best = middle;
    (found > passes ? low : high) = middle;
  }
  model.solve_to(std::exp(best));
}

/// Makes both need as many passes as the one that needs fewer, at most `most`. Returns by how much
/// the other's time has still to be scaled. `other`: its step before.
double match_passes(TimedModel& with, TimedModel& without, int instant, double tolerance,
                    double most, TimedStep& other) {
  with.solve_to(tolerance), without.solve_to(tolerance);
  const double needed = with.time_step(instant).group_passes;
  other = without.time_step(instant);
  const double passes = std::min({needed, other.group_passes, most});
  if (needed > passes) need_as_few(with, instant, passes, tolerance);
  if (other.group_passes > passes) need_as_few(without, instant, passes, tolerance);
  const double left = without.time_step(instant).group_passes;
  return left > 0 ? with.time_step(instant).group_passes / left : 1;
}

/// Readings of a short run are timed at its last instant.
bool reads_at(const TimedModel& model, int instant) {
  return instant % kReadingStride == std::min(kReadingStride / 2, model.instants() - 1);
}

/// A round of steps of one pass takes about half the time of others, and its noise counts twice.
int rounds_of(const TimedParts& parts, int rounds) {
  return parts.steps && parts.passes == 1 ? 2 * rounds : rounds;
}

}  // namespace

StepTimes measure_times(TimedModel& model, double tolerance, int rounds) {
  StepTimes times;
  int instants = 0, readings = 0;
  double first = 0, repeated = 0, stages = 0;
  for (int i = 0; i < model.instants(); ++i) {
    std::vector<double> steps, first_passes, fields;
    model.solve_to(tolerance);
    const TimedStep step = model.time_step(i);  // also warms caches
    if (step.steps == 0) continue;              // every environment has failed before
    ++instants;
    for (int round = 0; round < rounds; ++round) steps.push_back(model.time_step(i).seconds);
    times.passes += step.passes;
    times.step += lower_quartile(steps);
    model.solve_to(kAnything);
    const double least = model.time_step(i).group_passes;
    for (int round = 0; round < rounds; ++round) first_passes.push_back(model.time_step(i).seconds);
    stages += least;
    first += lower_quartile(first_passes);
    repeated += step.group_passes / least * lower_quartile(first_passes);
    if (!reads_at(model, i)) continue;
    for (int round = 0; round < rounds; ++round) fields.push_back(reading_time(model, i));
    times.reading += lower_quartile(fields);
    ++readings;
  }
  model.solve_to(tolerance);
  if (instants == 0) return times;
  times.first_pass = first / times.step;
  times.scaled_first_pass = repeated / times.step;
  times.stages = stages / instants;
  times.passes /= instants;
  times.step /= instants;
  times.reading /= std::max(1, readings);
  return times;
}

ModelComparison compare(TimedModel& with, TimedModel& without, const StepTimes& times,
                        TimedParts parts, double tolerance, int rounds) {
  rounds = rounds_of(parts, rounds);
  ModelComparison result;
  int instants = 0;
  std::vector<InstantTimes> steps, readings;
  for (int i = 0; i < with.instants(); ++i) {
    if (parts.steps) {
      TimedStep other;
      const double scale =
          match_passes(with, without, i, tolerance, parts.passes * times.stages, other);
      if (other.steps == 0) continue;
      ++instants;
      result.passes += other.passes;
      result.steps += other.steps;
      result.failures += other.failures;
      take_turns(
          rounds, [&] { return with.time_step(i).seconds; },
          [&] { return scale * without.time_step(i).seconds; }, steps.emplace_back());
    }
    if (parts.readings && reads_at(with, i))
      take_turns(
          rounds, [&] { return reading_time(with, i); }, [&] { return reading_time(without, i); },
          readings.emplace_back());
  }
  with.solve_to(tolerance), without.solve_to(tolerance);
  result.passes = parts.steps ? result.passes / std::max(1, instants) : times.passes;
  const double step_factor = parts.once          ? times.first_pass
                             : parts.passes == 1 ? times.scaled_first_pass
                                                 : 1;
  const auto share = [&](const std::vector<std::size_t>& which) {
    return (step_factor * times.step * saved(steps, which) +
            times.reading * saved(readings, which)) /
           times.whole();
  };
  std::vector<std::size_t> which(as_size(rounds));
  std::iota(which.begin(), which.end(), 0);
  result.saved.share = share(which);
  double sum = 0, squares = 0;
  for (std::uint32_t k = 0; k < kResamples; ++k) {
    for (std::size_t r = 0; r < which.size(); ++r)
      which[r] =
          std::min(which.size() - 1,
                   std::size_t(rounds * uniform({0, 0, k, Purpose::policy, std::uint32_t(r)})));
    const double drawn = share(which);
    sum += drawn, squares += drawn * drawn;
  }
  const double mean = sum / kResamples;
  result.saved.spread = std::sqrt(std::max(0.0, squares / kResamples - mean * mean));
  return result;
}

}  // namespace tangere
