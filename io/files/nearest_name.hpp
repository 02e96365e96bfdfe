// SPDX-License-Identifier: Apache-2.0
// Finds the valid name that a mistyped name most resembles, for error messages.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace tangere {

/// The candidate with the smallest edit distance; "" when none is near (more than about half of it
/// would change).
std::string nearest_name(std::string_view wrong, std::span<const std::string> candidates);

/// "; did you mean 'x'?" or "; expected one of a, b, c" or "" when there are no candidates.
std::string suggestion(std::string_view wrong, std::span<const std::string> candidates);

}  // namespace tangere
