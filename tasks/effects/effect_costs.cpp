// SPDX-License-Identifier: Apache-2.0
// Pairs of sweeps, with and without an effect:
//
//   share = (S - S')/T + Σ_sensors (F - F')/(every T)      T = S + Σ_sensors F/every
//
// S is a step and F a reading of a field, per environment; S' and F' are those without the effect.
// Ratios are taken within a round, so that a clock that changes its speed cancels out.
#include "tasks/effects/effect_costs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/base/as_size.hpp"
#include "tasks/effects/timed_model.hpp"

namespace tangere {
namespace {

constexpr int kMostRounds = 41;
/// A reading of a large pad takes longer than a step, but varies less.
constexpr int kReadingInstants = 4;

double per_step(const SweepTime& time) {
  return time.steps > 0 ? time.seconds / static_cast<double>(time.steps) : 0;
}
double passes_per_step(const SweepTime& time) {
  return time.steps > 0 ? static_cast<double>(time.newton_passes) / static_cast<double>(time.steps)
                        : 0;
}

double order_statistic(std::vector<double> values, double at) {
  const auto k = static_cast<std::ptrdiff_t>(at * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + k, values.end());
  return values[static_cast<std::size_t>(k)];
}

MeasuredShare summed_up(const std::vector<double>& shares) {
  return {order_statistic(shares, 0.5),
          (order_statistic(shares, 0.75) - order_statistic(shares, 0.25)) / 2};
}

bool is_of_sensors(EffectKind kind) {
  return kind == EffectKind::tactile || kind == EffectKind::tactile_shear ||
         kind == EffectKind::tactile_damping;
}

/// How often a sensor is read: in one of so many steps.
double interval(const SensorInfo& sensor) { return std::max(1, sensor.every); }

double field_bytes_of(const Model& model) {
  double bytes = 0;
  for (const SensorInfo& sensor : model.sensors()) bytes += 3.0 * sizeof(double) * sensor.points;
  return bytes;
}

/// Readings per step of all sensors of a model [s].
double reading_time(TimedModel& timed) {
  double seconds = 0;
  for (std::size_t s = 0; s < timed.model().sensors().size(); ++s)
    seconds += per_step(timed.time_readings(static_cast<int>(s), kReadingInstants)) /
               interval(timed.model().sensors()[s]);
  return seconds;
}

/// The scene's own times, against which effects are compared.
struct Baseline {
  TimedModel& timed;
  double step, reading;  ///< medians [s]
  double passes;

  [[nodiscard]] double whole() const { return step + reading; }
};

Baseline measure_baseline(TimedModel& timed) {
  std::vector<double> steps, readings;
  double passes = 0;
  timed.time_steps();  // warms caches and pages
  for (int round = 0; round < kLeastRounds; ++round) {
    const SweepTime time = timed.time_steps();
    steps.push_back(per_step(time));
    passes = passes_per_step(time);
    readings.push_back(reading_time(timed));
  }
  return {timed, order_statistic(steps, 0.5), order_statistic(readings, 0.5), passes};
}

/// What is timed of an effect.
struct Parts {
  bool step, reading;
};
Parts parts_of(EffectKind kind) {
  if (kind == EffectKind::varying_parameters) return {true, true};
  return {!is_of_sensors(kind), is_of_sensors(kind)};
}

struct Comparison {
  std::vector<double> shares;
  double seconds_without = 0, passes_without = 0;
  std::int64_t failures = 0, steps = 0;
};

/// Returns 1 - b/a, where `a` and `b` follow each other closely, in either order.
template <class A, class B>
double gain(bool first, const A& with, const B& without, double& a, double& b) {
  if (first) a = with();
  b = without();
  if (!first) a = with();
  return a > 0 ? 1 - b / a : 0;
}

Comparison compare(Baseline& base, TimedModel& without, Parts parts, int rounds) {
  Comparison result;
  result.passes_without = base.passes;
  if (parts.step) without.time_steps();  // warms caches and pages
  for (int round = 0; round < rounds; ++round) {
    const bool first = round % 2 == 0;
    double share = 0, a = 0, b = 0;
    if (parts.step) {
      SweepTime time;
      share += base.step / base.whole() *
               gain(
                   first, [&] { return per_step(base.timed.time_steps()); },
                   [&] { return per_step(time = without.time_steps()); }, a, b);
      result.passes_without = passes_per_step(time);
      result.failures += time.failures;
      result.steps += time.steps;
    }
    if (parts.reading && base.reading > 0)
      share += base.reading / base.whole() *
               gain(
                   first, [&] { return reading_time(base.timed); },
                   [&] { return reading_time(without); }, a, b);
    result.shares.push_back(share);
  }
  result.seconds_without = base.whole() * (1 - order_statistic(result.shares, 0.5));
  return result;
}

/// Returns why an effect is not timed; "" where it is.
std::string reason_not_to_time(const Model& model, const EffectInfo& info) {
  const Scene& scene = model.scene();
  if (!has_way(info.effect.kind, Way::removed)) return "follows from the joints; cannot be removed";
  const auto count = [&] {
    if (is_of_sensors(info.effect.kind)) return scene.sensors.size();
    return info.effect.kind >= EffectKind::ground_contact ? scene.ground_contacts.size()
                                                          : scene.pair_contacts.size();
  };
  if (info.effect.element >= 0 && count() > std::size_t(kMostElementsTimed))
    return fmt::format("one of {}; timed together, as '{}'", count(), to_string(info.effect.kind));
  return "";
}

/// The kind as a whole is its only element, which has been timed already.
bool is_the_only_element(const std::vector<EffectCost>& costs, const Model& model,
                         const EffectInfo& info, std::size_t at) {
  const auto& effects = model.effects();
  if (info.effect.element != 0) return false;
  const bool last = at + 1 >= effects.size() || effects[at + 1].effect.element < 0;
  return last && costs.back().effect.effect == Effect{info.effect.kind, -1};
}

}  // namespace

EffectCosts measure_effects(const Model& model, const EffectCostOptions& options) {
  const RecordedStates recorded =
      record_states(model, options.environments, options.instants, options.seed);
  StepperOptions stepping;
  stepping.tolerance = Stepper(model).tolerance();
  TimedModel timed(model, recorded, stepping);
  Baseline base = measure_baseline(timed);

  EffectCosts costs;
  costs.environments = options.environments;
  costs.instants = static_cast<int>(recorded.instants.size());
  costs.run_steps = recorded.steps;
  costs.seconds = base.whole();
  costs.field_seconds = base.reading;
  costs.passes = base.passes;

  std::size_t to_time = 1;
  for (const EffectInfo& info : model.effects())
    to_time += info.on && reason_not_to_time(model, info).empty() ? 1 : 0;
  const double pair = 2 * base.step * options.environments * options.instants;
  costs.rounds = std::clamp(static_cast<int>(options.seconds / (pair * double(to_time))),
                            kLeastRounds, kMostRounds);

  TimedModel again(Model(model.scene()), recorded, stepping);
  costs.itself = summed_up(compare(base, again, {true, true}, costs.rounds).shares);

  for (std::size_t k = 0; k < model.effects().size(); ++k) {
    const EffectInfo& info = model.effects()[k];
    EffectCost cost{info};
    cost.seconds_without = costs.seconds;
    cost.passes_without = costs.passes;
    cost.note = info.on ? reason_not_to_time(model, info) : "";
    if (is_the_only_element(costs.effects, model, info, k)) {
      const EffectInfo own = info;
      cost = costs.effects.back();
      cost.effect = own;
    } else if (!info.on) {
      cost.measured = MeasuredShare{};
    } else if (has_way(info.effect.kind, Way::removed)) {
      const Model trimmed(without(model.scene(), info.effect));
      cost.bytes = static_cast<std::int64_t>(model.state_bytes_per_environment()) -
                   static_cast<std::int64_t>(trimmed.state_bytes_per_environment()) +
                   static_cast<std::int64_t>(field_bytes_of(model) - field_bytes_of(trimmed));
      if (cost.note.empty()) {
        TimedModel without_it(trimmed, recorded, stepping);
        const Comparison c = compare(base, without_it, parts_of(info.effect.kind), costs.rounds);
        cost.measured = summed_up(c.shares);
        cost.seconds_without = c.seconds_without;
        cost.passes_without = c.passes_without;
        if (c.failures > 0)
          cost.note =
              fmt::format("without it {} of {} steps find no solution", c.failures, c.steps);
      }
    }
    costs.effects.push_back(std::move(cost));
  }
  return costs;
}

}  // namespace tangere
