// SPDX-License-Identifier: Apache-2.0
// Reports what the effects of a scene cost, for `tangere inspect --effects`.
#pragma once

#include <span>
#include <string>

#include "apps/console.hpp"
#include "tasks/effects/effect_costs.hpp"

namespace tangere::apps {

/// One key per effect, kinds and their elements: whether it is on, and why.
Json effects_json(std::span<const EffectInfo> effects);
/// The same with what each costs.
Json effect_costs_json(const EffectCosts& costs);
/// How it was measured.
Json effect_measurement_json(const EffectCosts& costs);
/// A row per effect that is on; those that are off in one paragraph.
std::string effect_costs_text(const EffectCosts& costs, const std::string& instruction_set);

/// What a run adds to steps, a list.
Json run_costs_json(const EffectCosts& costs);
/// A picture of the shares, those of single contacts and sensors where they are timed. `scene`: its
/// name. `machine`: processor and instruction set.
std::string effect_costs_svg(const EffectCosts& costs, const std::string& scene,
                             const std::string& machine);

}  // namespace tangere::apps
