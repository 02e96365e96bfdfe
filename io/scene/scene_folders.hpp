// SPDX-License-Identifier: Apache-2.0
// Where files of <include> are searched: beside the file that names them, then among the scenes
// that come with the program.
#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace tangere {

/// Returns the folders of scenes that come with the running program or module, as far as they are
/// there: `scenes` beside it (a Python package), ../share/tangere/scenes (installed) and
/// ../../scenes (built in the source tree).
std::vector<std::filesystem::path> shipped_scenes();

/// Returns the file `name` in the first of the folders that has it. If none has it and the name is
/// relative, throws IoError that names the places and the nearest file of a folder; a sole place
/// is returned as it is.
std::string find_scene_file(const std::string& name,
                            std::span<const std::filesystem::path> folders);

}  // namespace tangere
