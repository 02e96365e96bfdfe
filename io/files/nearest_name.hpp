// SPDX-License-Identifier: Apache-2.0
// Finds the valid name that a mistyped name most resembles, for error messages.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace tangere {

/// Returns the candidate with the smallest edit distance. If none is near (more than about half of
/// the word would change), the first that begins with a wrong word of three letters or more; else
/// "".
std::string nearest_name(std::string_view wrong, std::span<const std::string> candidates);

/// Returns "; did you mean 'x'?" or "; expected one of a, b, c", or "" if there are no candidates.
std::string suggestion(std::string_view wrong, std::span<const std::string> candidates);

}  // namespace tangere
