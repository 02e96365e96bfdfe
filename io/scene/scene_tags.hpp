// SPDX-License-Identifier: Apache-2.0
// Checks of a scene's text before it is parsed as XML.
#pragma once

#include <string>
#include <string_view>

namespace tangere {

/// Throws InputError ("name:line: …") for an element of more than 100 attributes. The XML parser
/// compares each attribute of an element with all others: 200 000 of them took it minutes.
void check_attribute_counts(std::string_view text, const std::string& name);

}  // namespace tangere
