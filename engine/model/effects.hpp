// SPDX-License-Identifier: Apache-2.0
// Table of the physical effects: for each, whether a scene has it on, the lines that request it,
// and how to remove it. `inspect`, the measurement of costs and the tests iterate over this table.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/model/scene.hpp"
#include "engine/model/scene_number.hpp"

namespace tangere {

enum class EffectKind : std::uint8_t {
  gravity,
  velocity_products,
  joint_damping,
  joint_springs,
  joint_limits,
  armature,
  force_motors,
  position_motors,
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
  feedback,
  varying_parameters,
  sleeping,
};
inline constexpr int kEffectKinds = 25;

/// An effect of a scene.
struct Effect {
  EffectKind kind = EffectKind::gravity;
  /// Index into Scene::pair_contacts, ground_contacts or sensors; -1: the kind as a whole.
  int element = -1;
  bool operator==(const Effect&) const = default;
};

/// An effect, whether a scene has it on, and why.
struct EffectInfo {
  std::string name;  ///< "gravity"; of an element "contact pad ball friction"
  bool on = false;
  std::string reason;
  Effect effect{};
  std::vector<Source> sources{};  ///< what calls for it, in file order; those with a line
  std::string variant{};          ///< of the kernel that computes it; "": it has none of its own
};

/// Ways to make a scene without an effect.
enum class Way : std::uint8_t {
  removed,  ///< as if the scene had never named it: the element is gone, its numbers are zero
  zero,     ///< still named, but its coefficient is zero
  idle,     ///< still named with its coefficients, but never met: limits a million metres away
};

/// Returns one row per kind, in their order, and behind each kind of contacts and sensors a row per
/// element.
std::vector<EffectInfo> effects_of(const Scene& scene);

/// What the elements of a kind are: pair contacts, ground contacts or sensors; none where it has no
/// elements.
std::optional<NumberOwner> element_owner(EffectKind kind);
/// Whether a kind is a part of its elements, such as friction. They stay when it goes, as the
/// contacts of feedback do when their sensor goes.
bool is_part(EffectKind kind);

/// Whether a kind has this way. Velocity products have none: they follow from joints that turn.
bool has_way(EffectKind kind, Way way);
/// Returns the scene without an effect. Numbers of the effect no longer vary between environments,
/// and controls of motors that go leave <control>. Throws InputError where has_way() is false.
Scene without(Scene scene, const Effect& effect, Way way = Way::removed);

/// Returns "gravity", "pair contact" …
const char* to_string(EffectKind kind);
/// Returns "scenes/x.xml:20, 25": the lines of an effect, the file once; "" where there are none.
std::string lines_of(const EffectInfo& effect);

}  // namespace tangere
