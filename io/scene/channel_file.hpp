// SPDX-License-Identifier: Apache-2.0
// Files of maps from a sensor's field to its channels (docs/channels.md#the-file): <channels
// nodes="ROWS COLS" loads="pressure" unit="uT"> with one <channel name="…" offset="…" linear="…"
// quadratic="…"/> for each.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "engine/scene/channels.hpp"

namespace tangere {

/// Reads a map. Adds what has no effect to `warnings` (file:line). Throws IoError for a file that
/// cannot be read, InputError (file:line) for what is no map.
ChannelMap read_channel_map(const std::string& path, std::vector<std::string>& warnings);

/// Text of such a file. `notes`: attributes of <fit>, what it was fitted to and how well; none: no
/// <fit>.
std::string channel_map_text(const ChannelMap& map,
                             const std::vector<std::pair<std::string, std::string>>& notes);

}  // namespace tangere
