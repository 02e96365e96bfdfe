// SPDX-License-Identifier: Apache-2.0
// The share of gravity that acts on the links of a tree.
#pragma once

#include "engine/model/compiled_model.hpp"

namespace tangere {

/// Gives each link the share of the bodies of its tree that have mass. Throws InputError where two
/// of them differ, because gravity enters at the root of a tree as its acceleration.
void compile_gravity_shares(CompiledModel& m);

}  // namespace tangere
