// SPDX-License-Identifier: Apache-2.0
// The address of a number of a scene. One table gives its name, its unit and where it stands, to
// <randomize>, gradients, identification and every file.
#pragma once

#include <span>
#include <string>

namespace tangere {

struct Scene;

/// Whose a number is. Its name begins with that word.
enum class NumberOwner { contact, ground, tactile, body, joint, motor };

/// Some are counted from the first of their kind: coefficients of a contact or a sensor from kn on,
/// effects of a joint from damping on, numbers of a size from radius on.
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
  v
};
/// How far a field is from the first of its kind.
constexpr int from(NumberField first, NumberField field) {
  return static_cast<int>(field) - static_cast<int>(first);
}

/// A number of a scene. A number of a joint holds for all of its dofs.
struct SceneNumber {
  NumberOwner owner = NumberOwner::joint;
  NumberField field = NumberField::q;
  std::string name;           ///< of the owner; of a motor its joint, of a contact its general body
  int component = 0;          ///< of size, pos, q and v
  std::string second_name{};  ///< of a contact: its primitive body
  bool operator==(const SceneNumber&) const = default;
};

/// A row of the table.
struct NumberKind {
  NumberOwner owner;
  NumberField field;
  const char* name;   ///< of the field: what <randomize> calls it
  const char* unit;   ///< "N/m", "1"; where dofs slide, and of laws that are not linear
  const char* other;  ///< where dofs turn, and of the law linear; nullptr: the same
  bool indexed;       ///< it has components

  [[nodiscard]] const char* unit_of(bool turns_or_linear) const {
    return turns_or_linear && other != nullptr ? other : unit;
  }
};
std::span<const NumberKind> number_kinds();
/// Throws InputError where an owner has no such field.
const NumberKind& number_kind(NumberOwner owner, NumberField field);

/// Coefficient k of a contact or a sensor.
constexpr NumberField coefficient_field(int k) { return static_cast<NumberField>(k); }
/// Number `which` of a shape's size (size_number), and back.
SceneNumber size_of_body(const std::string& body, int which);
inline int size_index(const SceneNumber& number) {
  return from(NumberField::radius, number.field) + number.component;
}
/// Whether it is a number of the starting state.
inline bool is_of_start(const SceneNumber& number) {
  return number.field == NumberField::q || number.field == NumberField::v;
}

/// "contact pad ball kn", "ground ball mu", "tactile pad kt", "body ball density",
/// "body pad size[0]", "joint arm damping", "joint arm q[0]", "motor arm P".
std::string name_of(const SceneNumber& number);
/// In words that name_of() begins with, without the field: "contact pad ball".
std::string owner_of(const SceneNumber& number);
/// Of a number that the scene has; two units for a joint that slides and turns. Throws InputError.
std::string unit_of(const Scene& scene, const SceneNumber& number);

/// Where it stands in a scene, and its value in SI. Both throw InputError for a number that is not
/// there.
double& number_in(Scene& scene, const SceneNumber& number);
double number_in(const Scene& scene, const SceneNumber& number);

/// Which of Scene::randomizations it follows, -1: none, it is the scene's.
int randomization_of(const Scene& scene, const SceneNumber& number);

}  // namespace tangere
