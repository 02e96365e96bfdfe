// SPDX-License-Identifier: Apache-2.0
// What lies in io/view/page, compiled into the library by io/CMakeLists.txt.
#pragma once

#include <string_view>

namespace tangere {

/// "page.html", "page.css", or "program": the scripts one after the other in the order of
/// io/CMakeLists.txt. Throws std::out_of_range for another name.
std::string_view page_file(std::string_view name);

}  // namespace tangere
