// SPDX-License-Identifier: Apache-2.0
// A number that is not drawn has a list of one value.
#include "engine/scene/variable_numbers.hpp"

#include "engine/scene/scene_faults.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/shapes.hpp"

namespace tangere {
namespace {

RandomizationDescription undrawn(const Scene& scene, const SceneNumber& number) {
  RandomizationDescription d;
  d.number = number;
  d.distribution = {Distribution::Kind::list, 0, 0, {number_in(scene, number)}};
  return d;
}

}  // namespace

std::vector<SceneNumber> variable_numbers(const Scene& scene) {
  std::vector<SceneNumber> numbers;
  const auto add = [&](const SceneNumber& n) {
    if (variation_fault(scene, undrawn(scene, n)).empty()) numbers.push_back(n);
  };
  const auto add_coefficients = [&](SceneNumber of) {
    for (int k = 0; k < kCoefficients; ++k) {
      of.field = coefficient_field(k);
      add(of);
    }
  };
  for (const PairContactDescription& c : scene.pair_contacts)
    if (!c.second_half) add_coefficients(first_number(c));
  for (const GroundContactDescription& c : scene.ground_contacts) add_coefficients(first_number(c));
  for (const TactileDescription& t : scene.sensors) add_coefficients(first_number(t));
  for (const LinkDescription& link : scene.links) {
    add({NumberOwner::body, NumberField::density, link.body.name});
    for (int which = 0; which < kSizeIndices; ++which)
      if (row_of(link.body.shape).size(which) != nullptr) add(size_of_body(link.body.name, which));
    for (std::size_t k = 0; k < kJointEffects; ++k)
      add({NumberOwner::joint, effect_field(k), link.joint.name});
    for (int axis = 0; axis < 3; ++axis)
      add({NumberOwner::joint, NumberField::pos, link.joint.name, axis});
  }
  for (const MotorDescription& motor : scene.motors) {
    if (!motor.has_gains()) continue;
    for (const NumberField gain : {NumberField::P, NumberField::D})
      add({NumberOwner::motor, gain, motor.joint});
  }
  for (const LoopDescription& loop : scene.loops)
    for (std::size_t k = 0; k < (loop.weld ? 4U : 2U); ++k)
      add({NumberOwner::loop, loop_field(k), loop.name});
  for (const CameraDescription& camera : scene.cameras) {
    for (const NumberField field : {NumberField::pos, NumberField::look, NumberField::light})
      for (int axis = 0; axis < 3; ++axis) add({NumberOwner::camera, field, camera.name, axis});
    for (const NumberField field : {NumberField::ambient, NumberField::brightness})
      add({NumberOwner::camera, field, camera.name});
  }
  return numbers;
}

void let_vary(Scene& scene, const SceneNumber& number) {
  if (randomization_of(scene, number) < 0) scene.randomizations.push_back(undrawn(scene, number));
}

}  // namespace tangere
