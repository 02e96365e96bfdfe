// SPDX-License-Identifier: Apache-2.0
// The share of gravity that acts on links.
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Gives each link the share of its bodies that have mass, and its lift. Gravity enters at the root
/// of a tree as its acceleration, times the share of the root; lifts are forces on the others.
/// Throws InputError where two bodies of a link differ.
void compile_gravity_shares(CompiledModel& m);

}  // namespace tangere
