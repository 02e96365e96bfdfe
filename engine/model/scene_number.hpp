// SPDX-License-Identifier: Apache-2.0
// The numbers of a scene. One table gives their names, units and places to <randomize>, gradients,
// identification and every file.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "engine/model/number_address.hpp"
#include "engine/model/scene.hpp"

namespace tangere {

/// Returns how far a field is from the first of its kind.
constexpr int offset_from(NumberField first, NumberField field) {
  return static_cast<int>(field) - static_cast<int>(first);
}

/// A row of the table of kinds.
struct NumberKind {
  NumberOwner owner;
  NumberField field;
  const char* name;   ///< name of the field, as in <randomize>
  const char* unit;   ///< "N/m", "1"; for dofs that slide, and for laws other than linear
  const char* other;  ///< for dofs that turn, and for law linear; nullptr: the same
  bool indexed;       ///< it has components

  [[nodiscard]] const char* unit_of(bool turns_or_linear) const {
    return turns_or_linear && other != nullptr ? other : unit;
  }
};
std::span<const NumberKind> number_kinds();
/// Throws InputError where an owner has no such field.
const NumberKind& number_kind(NumberOwner owner, NumberField field);

/// Returns the field of coefficient k of a contact or a sensor. coefficient_index() is the inverse.
constexpr NumberField coefficient_field(int k) {
  return k < kPointCoefficients ? static_cast<NumberField>(k) : NumberField::ks;
}
constexpr std::size_t coefficient_index(NumberField field) {
  return field == NumberField::ks ? kCoefficients - 1
                                  : static_cast<std::size_t>(offset_from(NumberField::kn, field));
}
/// Returns the field of number k of JointEffects.
constexpr NumberField effect_field(std::size_t k) {
  return static_cast<NumberField>(offset_from(NumberField::kn, NumberField::damping) + int(k));
}
inline constexpr int kScaleIndex = 5;  ///< of the scale of a mesh in size_number()
/// Returns number `which` of a body's size (size_number). size_index() is the inverse.
SceneNumber size_of_body(const std::string& body, int which);
inline int size_index(const SceneNumber& number) {
  return number.field == NumberField::scale
             ? kScaleIndex
             : offset_from(NumberField::radius, number.field) + number.component;
}
/// Whether it is a number of the starting state.
inline bool is_of_start(const SceneNumber& number) {
  return number.field == NumberField::q || number.field == NumberField::v;
}

/// Returns "contact pad ball kn", "ground ball mu", "tactile pad kt", "body ball density",
/// "body pad size[0]", "joint arm damping", "joint arm q[0]", "motor arm P".
std::string name_of(const SceneNumber& number);
/// Returns the words with which name_of() begins, without the field: "contact pad ball".
std::string owner_of(const SceneNumber& number);
/// Returns the unit of a number that the scene has. A joint that slides and turns has two units.
/// Throws InputError.
std::string unit_of(const Scene& scene, const SceneNumber& number);

/// Returns a reference to the number in the scene, or its value in SI. Both throw InputError for a
/// number that is not there.
double& number_in(Scene& scene, const SceneNumber& number);
double number_in(const Scene& scene, const SceneNumber& number);

/// Returns the index in Scene::randomizations that the number follows; -1: it keeps the scene's
/// value.
int randomization_of(const Scene& scene, const SceneNumber& number);

}  // namespace tangere
