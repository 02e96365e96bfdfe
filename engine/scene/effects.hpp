// SPDX-License-Identifier: Apache-2.0
// Table of the physical effects: for each, whether a scene has it on and the lines that request it.
// `inspect`, the measurement of costs and the tests iterate over this table;
// tasks/effects/ablation.hpp makes the scene without an effect.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/scene/effect_kind.hpp"
#include "engine/scene/scene.hpp"

namespace tangere {

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

/// Returns one row per kind, in their order, and behind each kind of contacts and sensors a row per
/// element.
std::vector<EffectInfo> effects_of(const Scene& scene);

/// What the elements of a kind are: pair contacts, ground contacts or sensors; none where it has no
/// elements.
std::optional<NumberOwner> element_owner(EffectKind kind);
/// How many elements of a kind a scene has; 0 where the kind has no elements.
int element_count(const Scene& scene, EffectKind kind);
/// Whether a kind is a part of its elements, such as friction. They stay when it goes, as the
/// contacts of feedback do when their sensor goes.
bool is_part(EffectKind kind);

/// Returns "gravity", "pair contact" …
const char* to_string(EffectKind kind);
/// Returns "scenes/x.xml:20, 25": the lines of an effect, the file once; "" where there are none.
std::string lines_of(const EffectInfo& effect);

}  // namespace tangere
