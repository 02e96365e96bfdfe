// SPDX-License-Identifier: Apache-2.0
// Reads what a page shows from a trajectory file or a data set.
#pragma once

#include <string>

#include "io/view/view_data.hpp"

namespace tangere {

/// Reads a trajectory file of `simulate`, a folder of shards, or one file of a data set.
/// Coordinates become poses by the scene in the file. Frames are thinned evenly, so that the page
/// stays below options.bytes; then `notes` and `stride` are set. Throws IoError for a file that
/// is missing, damaged, of another format, without a scene, without q, or without rows, and
/// InputError for an episode that it does not have.
ViewData read_view(const std::string& path, const ViewOptions& options);

}  // namespace tangere
