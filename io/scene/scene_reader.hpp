// SPDX-License-Identifier: Apache-2.0
// Reads scene files in two dialects: that of the paper's published simulator (root <redmax>) and
// ours (root <tangere>). Both have the same elements.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "engine/model/model.hpp"
#include "io/scene/included_texts.hpp"

namespace tangere {

struct SceneReadOptions {
  bool allow_unknown = false;  ///< unknown elements and attributes become warnings
  /// Of text that a program made: where each of its lines comes from, for messages. Empty: from
  /// the text itself.
  std::vector<Source> origins{};
  /// Where files of <include> are searched that are not beside the file that names them, before the
  /// scenes that come with the program (io/scene/scene_folders.hpp).
  std::vector<std::filesystem::path> folders{};
  /// Of text that a data set stores: texts that take the place of files of <include>.
  IncludedTexts included{};
};

struct SceneFile {
  Scene scene;                        ///< SI units, defaults filled in, names resolved
  std::vector<std::string> warnings;  ///< "file:line: …", in the order of the file
};

/// Reads and checks a scene. Throws IoError when the file cannot be read. Throws InputError
/// ("file:line: what; expected …") for anything in it that is unknown, missing, malformed or
/// impossible.
SceneFile read_scene(const std::filesystem::path& path, const SceneReadOptions& options = {});

/// The same for text in memory. `name` stands for the file in messages, and csv files are searched
/// beside it.
SceneFile parse_scene(const std::string& text, const std::string& name,
                      const SceneReadOptions& options = {});

/// Receives each warning of a scene, without a line end.
using SceneWarning = std::function<void(const std::string& text)>;
/// Reads and compiles a scene. Warnings go to `warn`; without one, to stderr. Throws like
/// read_scene() and Model.
Model load_model(const std::filesystem::path& path, const SceneReadOptions& options = {},
                 const SceneWarning& warn = {});

}  // namespace tangere
