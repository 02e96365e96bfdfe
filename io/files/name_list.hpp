// SPDX-License-Identifier: Apache-2.0
// Lists of names in one word: "q,v,pad.sum".
#pragma once

#include <string>
#include <vector>

namespace tangere {

/// Splits a list at its commas. Throws InputError, which begins with `what` and the list, for empty
/// names and for names that are listed twice.
std::vector<std::string> split_names(const std::string& what, const std::string& list);

}  // namespace tangere
