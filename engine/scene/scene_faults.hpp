// SPDX-License-Identifier: Apache-2.0
// What is wrong with a scene, told from the scene alone. The reader asks for each element as it
// appears, compile() for a whole scene, so that scenes that a program builds meet the same checks.
#pragma once

#include <string>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Return what is wrong with a part of a scene: what was found, and what was expected; "" if
/// nothing is. Names that the scene does not have are not their concern.
std::string joint_fault(const JointDescription& joint);
std::string body_fault(const BodyDescription& body);
/// `motor` may be one of the scene's, or the one that follows them.
std::string motor_fault(const Scene& scene, const MotorDescription& motor);
std::string contact_fault(const Scene& scene, const GroundContactDescription& contact);
std::string contact_fault(const Scene& scene, const PairContactDescription& contact);
std::string markers_fault(const TactileDescription& sensor);
std::string variation_fault(const Scene& scene, const RandomizationDescription& variation);

/// Throws InputError (file:line) for the first fault.
void check_scene(const Scene& scene);

}  // namespace tangere
