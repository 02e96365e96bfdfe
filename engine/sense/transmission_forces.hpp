// SPDX-License-Identifier: Apache-2.0
// What acts on the lengths of transmissions in a state.
#pragma once

#include <span>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

class Batch;

/// Returns the force on the joint of each transmission of one environment [N], or the torque where
/// the joint turns [N m], in the order of Scene::transmissions: by its spring, damping, limits, dry
/// friction and motors, without the inertia of its armature. A positive force lengthens, so a cord
/// under tension has a negative one. Its work is force times the change of the joint's coordinate.
/// `u`: (nu) controls of the environment, as a step takes them; those of position motors with
/// timing="start" count as if a step began here. Throws InputError for an environment that is not
/// there and for controls of another number.
std::vector<double> transmission_forces(const Model& model, const Batch& batch, int environment,
                                        std::span<const double> u);

}  // namespace tangere
