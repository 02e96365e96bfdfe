// SPDX-License-Identifier: Apache-2.0
// Goes through the table of effects: the scene without each, and how the times compare.
#include "tasks/effects/effect_costs.hpp"
#include "tasks/effects/ablation.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/base/as_size.hpp"
#include "tasks/effects/sleep_gain.hpp"

namespace tangere {
namespace {

constexpr int kMostRounds = 41;

bool is_of_sensors(EffectKind kind) { return element_owner(kind) == NumberOwner::tactile; }

bool is_memory(EffectKind kind) {
  return kind == EffectKind::pair_memory || kind == EffectKind::ground_memory ||
         kind == EffectKind::tactile_memory;
}

/// Whether removing an effect also removes shear springs: contacts, sensors, friction, ks.
bool takes_memory(const Model& model, const Effect& effect) {
  const EffectKind kind = effect.kind;
  const bool friction = kind == EffectKind::pair_friction || kind == EffectKind::ground_friction ||
                        kind == EffectKind::tactile_shear;
  if (is_part(kind) && !friction && !is_memory(kind)) return false;
  return std::any_of(model.effects().begin(), model.effects().end(), [&](const EffectInfo& e) {
    return e.on && is_memory(e.effect.kind) && e.effect.element == effect.element &&
           element_owner(e.effect.kind) == element_owner(kind);
  });
}

/// Parts of the step that an effect changes. The shear state is updated once per step but read in
/// every residual evaluation, so models with and without it are compared with equal numbers of
/// evaluations. Feedback is a contact.
TimedParts parts_of(const Model& model, const Effect& effect) {
  constexpr int kAllPasses = 1000;
  const bool reads = is_of_sensors(effect.kind);
  if (takes_memory(model, effect)) return {true, reads, kAllPasses, false};
  switch (effect.kind) {
    case EffectKind::varying_parameters: return {true, true, 1, false};
    case EffectKind::force_motors: return {true, false, 1, true};
    case EffectKind::pair_contact:
    case EffectKind::loops:
    case EffectKind::transmissions:
    case EffectKind::feedback: return {true, false, 2, false};
    default: return {!reads, reads, 1, false};
  }
}

/// Returns the bytes of one environment's state and readings.
std::size_t bytes_of(const Model& model) {
  std::size_t bytes = model.state_bytes_per_environment();
  for (const FieldOutput of : requested_fields(model.scene()))
    bytes += sizeof(double) * numbers_of(model, of);
  return bytes;
}

std::ptrdiff_t elements_of(const Model& model, EffectKind kind) {
  return std::count_if(model.effects().begin(), model.effects().end(), [&](const EffectInfo& e) {
    return e.effect.kind == kind && e.effect.element >= 0;
  });
}

/// Returns why an effect is not timed; "" where it is.
std::string reason_not_to_time(const Model& model, const Effect& effect) {
  if (!has_way(effect.kind, Ablation::removed)) return "follows from the joints; cannot be removed";
  const std::ptrdiff_t elements = elements_of(model, effect.kind);
  if (effect.element >= 0 && !times_elements(effect.kind, elements))
    return fmt::format("one of {}; timed together, as '{}'", elements, to_string(effect.kind));
  return "";
}

/// Steps that are cut to an accuracy take other parts in another model, so whole ones are timed.
StepperOptions uncut(const Model& model) {
  StepperOptions options;
  options.integrator = model.integrator();  // the one that can keep an accuracy
  options.accuracy = 0;
  options.sleep = 0;  // as in recorded_states.cpp
  options.tolerance = Stepper(model, options).tolerance();
  return options;
}

/// Steps that create energy are repeated (docs/solver.md), which is frequent for a modified model
/// at states of the original one. So models are compared without this check.
Scene taken_once(Scene scene) {
  scene.solver.bounded_energy = false;
  return scene;
}

/// What all effects of a scene are measured with.
struct Measurement {
  const Model& model;
  RecordedStates recorded;
  StepperOptions stepping;
  TimedModel timed, compared;  // as it is; taken_once()
  StepTimes times;
  int rounds;

  Measurement(const Model& of, const EffectCostOptions& options)
      : model(of),
        recorded(record_states(of, options.environments, options.instants, options.seed)),
        stepping(uncut(of)),
        timed(of, recorded, stepping),
        compared(Model(taken_once(of.scene())), recorded, stepping),
        times(measure_times(timed, *stepping.tolerance, kLeastRounds)),
        rounds(rounds_of(options)) {}

  /// Every effect gets the same share of the time.
  [[nodiscard]] int rounds_of(const EffectCostOptions& options) const {
    int effects = 1;
    for (const EffectInfo& info : model.effects())
      effects += info.on && info.effect.kind != EffectKind::sleeping &&
                         reason_not_to_time(model, info.effect).empty()
                     ? 1
                     : 0;
    const double pair = 2 * times.step * options.environments * options.instants;
    return static_cast<int>(
        std::clamp(options.seconds / (pair * effects), double(kLeastRounds), double(kMostRounds)));
  }
  [[nodiscard]] ModelComparison against(const Model& other, TimedParts parts) {
    TimedModel timed_other(other, recorded, stepping);
    return compare(compared, timed_other, times, parts, *stepping.tolerance, rounds);
  }
};

/// Measures sleep, which acts over whole runs. `cost`: of the effect, not measured yet.
void measure_sleep(const Measurement& m, const EffectCostOptions& options, EffectCost& cost) {
  const SleepGain gain =
      measure_sleep_gain(m.model, options.environments, options.seed, kLeastRounds);
  const double step_share = m.times.whole() > 0 ? m.times.step / m.times.whole() : 0;
  cost.bytes = static_cast<std::int64_t>(gain.bytes);
  cost.measured = MeasuredShare{step_share * gain.added.share, step_share * gain.added.spread};
  cost.note = fmt::format(
      "of the steps of a run, in which {:.1f} bodies sleep on average; the head's "
      "step is without it",
      gain.mean_asleep);
}

EffectCost measure(Measurement& m, const EffectInfo& info, const EffectCostOptions& options) {
  EffectCost cost{info};
  cost.seconds_without = m.times.whole();
  cost.passes_without = m.times.passes;
  if (!info.on) {
    cost.measured = MeasuredShare{};
    return cost;
  }
  cost.note = reason_not_to_time(m.model, info.effect);
  if (!has_way(info.effect.kind, Ablation::removed)) return cost;
  if (info.effect.kind == EffectKind::sleeping) {
    measure_sleep(m, options, cost);
    return cost;
  }
  const Model trimmed(without(m.model.scene(), info.effect));
  cost.bytes =
      static_cast<std::int64_t>(bytes_of(m.model)) - static_cast<std::int64_t>(bytes_of(trimmed));
  if (m.times.passes == 0) cost.note = "every environment fails before the first instant";
  if (!cost.note.empty()) return cost;
  const ModelComparison c =
      m.against(Model(taken_once(trimmed.scene())), parts_of(m.model, info.effect));
  cost.measured = c.saved;
  cost.seconds_without = m.times.whole() * (1 - c.saved.share);
  cost.passes_without = c.passes;
  if (c.failures > 0)
    cost.note = fmt::format("without it {} of {} steps find no solution", c.failures, c.steps);
  return cost;
}

}  // namespace

bool times_elements(EffectKind kind, std::ptrdiff_t elements) {
  return elements <= (is_part(kind) ? 4 : 12);
}

EffectCosts measure_effects(const Model& model, const EffectCostOptions& options) {
  Measurement m(model, options);
  EffectCosts costs;
  costs.environments = options.environments;
  costs.instants = static_cast<int>(m.recorded.instants.size());
  costs.run_steps = m.recorded.steps;
  costs.planned_steps = m.recorded.planned;
  costs.failed = m.recorded.failed;
  costs.uncut = Stepper(model).accuracy() > 0;
  costs.times = m.times;
  costs.rounds = m.rounds;
  costs.itself = m.against(Model(taken_once(model.scene())), {true, true, 1, false}).saved;
  for (const EffectInfo& info : model.effects()) {
    // The only element of a kind is the kind, which has been measured just before.
    if (info.effect.element == 0 && elements_of(model, info.effect.kind) == 1) {
      EffectCost cost = costs.effects.back();
      cost.effect = info;
      costs.effects.push_back(std::move(cost));
    } else {
      costs.effects.push_back(measure(m, info, options));
    }
  }
  costs.run_costs = measure_run_costs(m.timed, m.times, kLeastRounds);
  return costs;
}

}  // namespace tangere
