// SPDX-License-Identifier: Apache-2.0
// The kinds of effects (effects.hpp).
#pragma once

#include <cstdint>

namespace tangere {

enum class EffectKind : std::uint8_t {
  gravity,
  velocity_products,
  joint_damping,
  joint_springs,
  joint_limits,
  joint_friction,
  armature,
  force_motors,
  position_motors,
  loops,
  transmissions,
  pair_contact,
  pair_friction,
  pair_damping,
  pair_memory,
  ground_contact,
  ground_friction,
  ground_damping,
  ground_memory,
  tactile,
  tactile_shear,
  tactile_damping,
  tactile_memory,
  sensor_imperfections,
  markers,
  layer,
  feedback,
  varying_parameters,
  sleeping,
};
inline constexpr int kEffectKinds = 29;

}  // namespace tangere
