// SPDX-License-Identifier: Apache-2.0
// Files of camera gels: <gel background="NAME.png" pixel="…" reach="…" blur="…"> with the lamps of
// each channel inside (docs/pictures.md#a-gel-file). Lengths are in metres.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "engine/scene/gel.hpp"

namespace tangere {

/// Reads a gel and its background, a PNG file beside it. Adds what has no effect to `warnings`
/// (file:line). Throws IoError for files that cannot be read, InputError (file:line) for what is no
/// gel, for lengths above 0.1 m and for lamps beyond 1e5 grey levels.
Gel read_gel(const std::string& path, std::vector<std::string>& warnings);

/// Text of a gel file. `background`: name of its PNG file, beside it; `notes`: attributes of
/// <fit>, what it was fitted to and how well; none: no <fit>.
std::string gel_text(const Gel& gel, const std::string& background,
                     const std::vector<std::pair<std::string, std::string>>& notes);

}  // namespace tangere
