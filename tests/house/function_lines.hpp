// SPDX-License-Identifier: Apache-2.0
// The rule that a function fits a screen.
#pragma once

#include <vector>

#include "tests/house/rules.hpp"

namespace tangere::house {

/// A function outside of tests has at most 90 lines, from its return type to its last brace. What a
/// function defines inside belongs to it.
std::vector<Violation> check_functions(const Tree& tree);

}  // namespace tangere::house
