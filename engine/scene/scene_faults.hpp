// SPDX-License-Identifier: Apache-2.0
// Validation of a scene. The reader checks each element as it appears, and compile() checks a whole
// scene, so that scenes built by programs pass the same checks.
#pragma once

#include <string>

#include "engine/scene/scene.hpp"

namespace tangere {

/// Return an error text for a part of a scene, with the value found and what was expected; "" if it
/// is valid. Unknown names are not checked.
std::string joint_fault(const JointDescription& joint);
std::string body_fault(const BodyDescription& body);
/// `motor` may be one of the scene's, or the one that follows them.
std::string motor_fault(const Scene& scene, const MotorDescription& motor);
std::string contact_fault(const Scene& scene, const GroundContactDescription& contact);
std::string contact_fault(const Scene& scene, const PairContactDescription& contact);
/// `loop` may be one of the scene's, or the one that follows them.
std::string loop_fault(const Scene& scene, const LoopDescription& loop);
/// Of the numbers of a transmission.
std::string transmission_fault(const TransmissionDescription& transmission);
std::string markers_fault(const TactileDescription& sensor);
/// The sensor has a picture.
std::string picture_fault(const TactileDescription& sensor);
/// `variation` may be one of the scene's, or the one that follows them.
std::string variation_fault(const Scene& scene, const RandomizationDescription& variation);
/// Of a value in SI that a varying number is set to.
std::string varying_value_fault(const SceneNumber& number, double value);

/// Throws InputError (file:line) for the first fault.
void check_scene(const Scene& scene);

}  // namespace tangere
