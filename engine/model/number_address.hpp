// SPDX-License-Identifier: Apache-2.0
// The address of a number in a scene.
#pragma once

#include <string>

namespace tangere {

/// The owner of a number. The number's name begins with this word.
enum class NumberOwner { contact, ground, tactile, body, joint, motor };

/// Some fields are counted from the first of their kind: effects of a joint from damping on,
/// numbers of a size from radius on, but for the scale of a mesh.
enum class NumberField {
  kn,
  kt,
  mu,
  damping,
  armature,
  stiffness,
  lim_stiffness,
  turning_damping,
  turning_stiffness,
  P,
  D,
  density,
  mass,
  radius,
  length,
  size,
  pos,
  q,
  v,
  ks,
  scale
};
/// Names a number of a scene. A number of a joint applies to all of its dofs.
struct SceneNumber {
  NumberOwner owner = NumberOwner::joint;
  NumberField field = NumberField::q;
  std::string name;   ///< of the owner; for a motor its joint, for a contact its general body
  int component = 0;  ///< of size, pos, q and v
  std::string second_name{};  ///< for a contact: its primitive body
  bool operator==(const SceneNumber&) const = default;
};

}  // namespace tangere
