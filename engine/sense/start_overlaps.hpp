// SPDX-License-Identifier: Apache-2.0
// Bodies that start deep inside one another. Springs as deep throw them apart at the first step.
#pragma once

#include <string>
#include <vector>

#include "engine/model/model.hpp"

namespace tangere {

/// Returns a line for each contact whose points start deeper in the other body than a tenth of
/// their own extent, or of a sphere's radius, at the starting state of the scene's first
/// environment with seed 0.
std::vector<std::string> start_overlaps(const Model& model);

}  // namespace tangere
