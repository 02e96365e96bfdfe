// SPDX-License-Identifier: Apache-2.0
// The address of a number in a scene.
#pragma once

#include <string>

namespace tangere {

/// The owner of a number. The number's name begins with this word.
enum class NumberOwner { contact, ground, tactile, body, joint, motor, loop, camera };

/// The first fields are the coefficients of contacts and sensors in the order of Coefficients, also
/// those that have no word here; then come effects of joints, and numbers of a size, each in order.
enum class NumberField {
  kn,
  kt,
  mu,
  damping,
  ks,
  armature = 32,
  stiffness,
  lim_stiffness,
  friction,
  turning_damping,
  turning_stiffness,
  P,
  D,
  density,
  mass,
  radius,
  length,
  size,
  scale,
  pos,
  q,
  v,
  thickness,
  poisson,
  look,
  light,
  ambient,
  brightness
};
/// Names a number of a scene. A number of a joint applies to all of its dofs.
struct SceneNumber {
  NumberOwner owner = NumberOwner::joint;
  NumberField field = NumberField::q;
  std::string name;   ///< of the owner; for a motor its joint, for a contact its general body
  int component = 0;  ///< of size, pos, q, v, look and light
  std::string second_name{};  ///< for a contact: its primitive body
  bool operator==(const SceneNumber&) const = default;
};

}  // namespace tangere
