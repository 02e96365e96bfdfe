// SPDX-License-Identifier: Apache-2.0
// One HTML page that needs nothing else: its program, its styles and its data.
#pragma once

#include <string>

#include "io/view/view_data.hpp"

namespace tangere {

/// The data block of a page: JSON, in which an array of numbers is {"base64": …} of float32, or of
/// int32 if "type" is so, little-endian (docs/view.md). It does not contain "</".
std::string view_json(const ViewData& data);

/// The page: what lies in io/view/page, with the data block in its place.
std::string render_view_page(const ViewData& data);

}  // namespace tangere
