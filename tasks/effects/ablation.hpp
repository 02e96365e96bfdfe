// SPDX-License-Identifier: Apache-2.0
// Makes scenes without one of their effects (engine/scene/effects.hpp), to measure what it costs.
#pragma once

#include <cstdint>

#include "engine/scene/effects.hpp"

namespace tangere {

/// Ways to make a scene without an effect.
enum class Ablation : std::uint8_t {
  removed,  ///< as if the scene had never named it: the element is gone, its numbers are zero
  zero,     ///< still named, but its coefficient is zero
  idle,     ///< still named with its coefficients, but never met: limits a million metres away
};

/// Whether a kind has this way. Velocity products have none: they follow from joints that turn.
bool has_way(EffectKind kind, Ablation way);
/// Returns the scene without an effect. Numbers of the effect no longer vary between environments,
/// and controls of motors that go leave <control>. Throws InputError where has_way() is false.
Scene without(Scene scene, const Effect& effect, Ablation way = Ablation::removed);

}  // namespace tangere
