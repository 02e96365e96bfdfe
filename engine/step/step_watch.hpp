// SPDX-License-Identifier: Apache-2.0
// What a look at solved steps comes to (GroupStep::solve_and_watch).
#pragma once

#include "engine/step/workspace.hpp"

namespace tangere {

/// Lanes that found a root. Those in which a body came through another, that created energy, or in
/// which a body turned too far for the scheme should not be taken.
struct Solved {
  LaneBits found = 0, passed = 0, created = 0, turned = 0;
  [[nodiscard]] LaneBits sound() const { return found & ~(passed | created | turned); }
};

}  // namespace tangere
