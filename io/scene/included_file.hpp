// SPDX-License-Identifier: Apache-2.0
// <include file="…"/>: the children of another file's root stand where the <include> stands.
#pragma once

#include <tinyxml2.h>

#include <memory>
#include <string>

#include "io/scene/included_texts.hpp"
#include "io/scene/scene_node.hpp"

namespace tangere {

/// Whether two paths lead to one file, or would if it were there.
bool same_file(const std::string& a, const std::string& b);

struct IncludedFile {
  tinyxml2::XMLDocument document;
  const tinyxml2::XMLElement* root = nullptr;
  std::unique_ptr<SceneContext> context;  ///< its own units and defaults
};

/// Reads the file that `include`, a child of `parent`, names: beside the file in which it stands,
/// or in the first of the folders of the outermost context that has it.
/// The file's root has the name of `parent`. Throws InputError at the <include> for a ring of
/// files, for too many of them, and for attributes with numbers where the two files differ in their
/// unit; IoError if the file cannot be read. The file lives as long as the outermost context.
const IncludedFile& include_file(const SceneNode& include, const SceneNode& parent);

}  // namespace tangere
