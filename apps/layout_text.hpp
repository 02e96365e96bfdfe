// SPDX-License-Identifier: Apache-2.0
// Layouts of sensors that a user names: files, or those that the program contains.
#pragma once

#include <string>

namespace tangere::apps {

/// Returns the text of the layout `layout`: a layout of the program, or a file. `what`: the option,
/// for messages. Throws InputError for a name that is neither, with the nearest one.
std::string layout_text(const std::string& what, const std::string& layout);

}  // namespace tangere::apps
