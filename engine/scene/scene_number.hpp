// SPDX-License-Identifier: Apache-2.0
// The numbers of a scene. One table gives their names, units and places to <randomize>, gradients,
// identification and every file.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "engine/scene/number_address.hpp"
#include "engine/scene/scene.hpp"
#include "engine/scene/units.hpp"

namespace tangere {

struct Attribute;  // engine/scene/schema.hpp
/// Returns the elements whose attributes are the numbers of an owner (schema.hpp).
std::uint64_t element_of(NumberOwner owner);
/// Returns the row of the schema for a field. Throws InputError where an owner has no such field.
const Attribute& number_kind(NumberOwner owner, NumberField field);

/// Returns the field of coefficient k of a contact or a sensor. coefficient_index() is the inverse.
constexpr NumberField coefficient_field(int k) { return static_cast<NumberField>(k); }
constexpr std::size_t coefficient_index(NumberField field) {
  return static_cast<std::size_t>(field);
}
/// Returns the field of number k of JointEffects. effect_index() is the inverse.
constexpr NumberField effect_field(std::size_t k) {
  return k == 0 ? NumberField::damping
                : static_cast<NumberField>(static_cast<int>(NumberField::armature) + int(k) - 1);
}
constexpr std::size_t effect_index(NumberField field) {
  return field == NumberField::damping ? 0
                                       : static_cast<std::size_t>(field) + 1 -
                                             static_cast<std::size_t>(NumberField::armature);
}
/// The numbers of a loop, and the field of each. loop_index() is the inverse.
inline constexpr double LoopDescription::*kLoopNumbers[] = {
    &LoopDescription::stiffness, &LoopDescription::damping, &LoopDescription::turning_stiffness,
    &LoopDescription::turning_damping};
constexpr NumberField loop_field(std::size_t k) {
  constexpr NumberField kFields[] = {NumberField::stiffness, NumberField::damping,
                                     NumberField::turning_stiffness, NumberField::turning_damping};
  return kFields[k];
}
constexpr std::size_t loop_index(NumberField field) {
  std::size_t k = 0;
  while (loop_field(k) != field) ++k;
  return k;
}
inline constexpr int kScaleIndex = kSizeIndices - 1;  ///< of the scale of a mesh in size_number()
/// Returns number `which` of a body's size (size_number). size_index() is the inverse.
SceneNumber size_of_body(const std::string& body, int which);
int size_index(const SceneNumber& number);
/// Whether it is a number of the starting state.
inline bool is_of_start(const SceneNumber& number) {
  return number.field == NumberField::q || number.field == NumberField::v;
}

/// Returns "contact pad ball kn", "ground ball mu", "tactile pad kt", "body ball density",
/// "body pad size[0]", "joint arm damping", "joint arm q[0]", "motor arm P", "loop NAME stiffness".
std::string name_of(const SceneNumber& number);
/// Returns the words with which name_of() begins, without the field: "contact pad ball".
std::string owner_of(const SceneNumber& number);
/// Returns the units of a number that the scene has. A joint that slides and turns has two units.
/// Throws InputError.
std::vector<Unit> units_of(const Scene& scene, const SceneNumber& number);
/// Returns the unit of a coefficient of a contact or sensor. `per_area`: it counts per area.
Unit coefficient_unit(NumberOwner owner, NumberField field, ContactLaw law, bool per_area);
/// Returns them as text: "N/m, N m/rad".
std::string unit_of(const Scene& scene, const SceneNumber& number);

/// Returns the first coefficient of a contact or a sensor. Its other ones differ by their field.
SceneNumber first_number(const PairContactDescription& contact);
SceneNumber first_number(const GroundContactDescription& contact);
SceneNumber first_number(const TactileDescription& sensor);

/// Returns a reference to the number in the scene, or its value in SI. Both throw InputError for a
/// number that is not there.
double& number_in(Scene& scene, const SceneNumber& number);
double number_in(const Scene& scene, const SceneNumber& number);

/// Returns the index in Scene::randomizations that the number follows; -1: it keeps the scene's
/// value.
int randomization_of(const Scene& scene, const SceneNumber& number);
/// Returns the index in Scene::randomizations whose random number draws entry k: the first one with
/// the same tie, or k.
std::size_t drawn_with(const Scene& scene, std::size_t k);

}  // namespace tangere
