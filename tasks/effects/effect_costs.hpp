// SPDX-License-Identifier: Apache-2.0
// Cost of each effect of a scene: time of a step with the effect relative to the time without it,
// from the same states. docs/effects.md explains the figures.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/model/model.hpp"
#include "tasks/effects/comparison.hpp"
#include "tasks/effects/run_costs.hpp"

namespace tangere {

struct EffectCostOptions {
  int environments = 32;
  int instants = 12;   ///< of the run, from which single steps are timed
  double seconds = 2;  ///< to spend, about; more where kLeastRounds take longer
  std::uint64_t seed = 0;
};

struct EffectCost {
  EffectInfo effect;
  /// State and fields of one environment that go with the effect [bytes].
  std::int64_t bytes = 0;
  /// Of a step; 0 for an effect that is off; no value: not measured, `note` has the reason.
  std::optional<MeasuredShare> measured{};
  std::string note{};          ///< reason why it is not measured, or a remark; may be ""
  double seconds_without = 0;  ///< a step of one environment without the effect [s]
  /// Residual evaluations per step from the same states, to the same tolerance. The scale of the
  /// residual may lack the force of the removed effect (docs/solver.md).
  double passes_without = 0;
};

struct EffectCosts {
  int environments = 0, instants = 0;
  int failed = 0;                   ///< environments that fail along the run
  int rounds = 0;                   ///< pairs of steps per effect and instant
  std::int64_t run_steps = 0;       ///< played, from which the instants come
  std::int64_t planned_steps = -1;  ///< of the scene's controls; -1: they have no end
  bool uncut = false;               ///< the scene's accuracy cuts steps; whole ones were timed
  StepTimes times{};                ///< of the scene as it is
  MeasuredShare itself{};           ///< the scene against itself: noise of the measurement
  std::vector<EffectCost> effects;  ///< parallel to Model::effects()
  std::vector<RunCost> run_costs;   ///< cost of optional outputs
};

/// Whether the elements of a kind are timed one by one: up to 12 contacts or sensors, or up to 4 of
/// which a coefficient is taken out. The shares of more are lost in the noise.
bool times_elements(EffectKind kind, std::ptrdiff_t elements);
/// Rounds that an effect gets at least.
inline constexpr int kLeastRounds = 5;

/// Plays a batch by the scene's own controls, then times single steps from states of that run with
/// the model and with a model without the effect, in turn. Throws InputError like a rollout.
EffectCosts measure_effects(const Model& model, const EffectCostOptions& options = {});

}  // namespace tangere
