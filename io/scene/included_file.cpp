// SPDX-License-Identifier: Apache-2.0
// An included file keeps its unit and its defaults to itself, so that a file means the same
// wherever it is included.
#include "io/scene/included_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>

#include "io/files/text_file.hpp"
#include "io/scene/scene_folders.hpp"
#include "io/scene/xml_document.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostFiles = 1000;  // a few files that each name two others would never end
constexpr int kDeepestFiles = 50;         // files in files

bool is_scene(const std::string& root) { return root == "redmax" || root == "tangere"; }

void refuse_rings(const SceneNode& include, const std::string& path) {
  int depth = 0;
  for (const SceneContext* c = &include.context(); c != nullptr; c = c->includer) {
    if (++depth > kDeepestFiles)
      include.fail(fmt::format("files in files, deeper than {}", kDeepestFiles));
    if (!same_file(c->file, path)) continue;
    std::string way = path;
    for (const SceneContext* w = &include.context(); w != c->includer; w = w->includer)
      way = fmt::format("{} includes {}", w->file, way);
    include.fail("files that include each other: " + way);
  }
}

/// Reads the root's own attributes. The unit of a scene stands in its <option>.
void read_head(const tinyxml2::XMLElement& root, SceneContext& context) {
  const bool scene = is_scene(root.Name());
  const SceneNode node(root, context);
  node.check_attributes(scene ? std::vector<std::string>{"model", "name"}
                              : std::vector<std::string>{"unit", "name"});
  const tinyxml2::XMLElement* const option = root.FirstChildElement("option");
  const SceneNode unit_node = scene && option != nullptr ? SceneNode(*option, context) : node;
  const bool metres =
      (!scene || option != nullptr) && unit_node.choice("unit", {"cm-g", "m-kg"}, 0) == 1;
  if (!metres) context.use_centimetres_and_grams();
}

/// Numbers of an <include> would be taken in the unit of the file that it names.
void check_units(const SceneNode& include, const tinyxml2::XMLElement& element,
                 const SceneContext& inner) {
  if (include.context().length == inner.length) return;
  for (const tinyxml2::XMLAttribute* a = element.FirstAttribute(); a != nullptr; a = a->Next()) {
    const std::string_view value = a->Value();
    const bool number = !value.empty() &&
                        value.find_first_not_of(" \t\n0123456789+-.,eE") == std::string_view::npos;
    if (number && std::string_view(a->Name()) != "file")
      include.fail(fmt::format("{}=\"{}\": this file is in {} and {} in {}; expected the same unit",
                               a->Name(), value, inner.length == 1 ? "cm-g" : "m-kg", inner.file,
                               inner.length == 1 ? "m-kg" : "cm-g"));
  }
}

/// Returns the path of the file that an <include> names. One whose text is stored need not exist.
std::string path_of(const SceneNode& include, bool stored) {
  SceneContext& context = include.context();
  std::vector<fs::path> folders{fs::path(context.file).parent_path()};
  if (stored) return (folders[0] / include.text("file")).string();
  std::ranges::copy(context.outermost().folders, std::back_inserter(folders));
  try {
    return find_scene_file(include.text("file"), folders);
  } catch (const IoError& e) {
    throw IoError(include.source().prefix() + "<include>: " + e.what());
  }
}

}  // namespace

bool same_file(const std::string& a, const std::string& b) {
  std::error_code not_both_there;
  return fs::equivalent(a, b, not_both_there) ||
         fs::path(a).lexically_normal() == fs::path(b).lexically_normal();
}

const IncludedFile& include_file(const SceneNode& include, const SceneNode& parent) {
  SceneContext& outer = include.context();
  const std::string place = place_from(outer.place, include.text("file"));
  const IncludedTexts& known = outer.outermost().included_texts;
  const auto stored = known.find(place);
  const std::string path = path_of(include, stored != known.end());
  refuse_rings(include, path);
  auto& all = outer.outermost().included;
  if (all.size() >= kMostFiles)
    include.fail(fmt::format("more than {} files in one scene", kMostFiles));
  const std::string name = parent.name();
  const std::string expected = is_scene(name) ? "the root <tangere>" : "the root <" + name + ">";
  const auto file = std::make_shared<IncludedFile>();
  all.push_back(file);
  file->context = std::make_unique<SceneContext>();
  SceneContext& context = *file->context;
  context.file = path;
  context.allow_unknown = outer.allow_unknown;
  context.includer = &outer;
  context.place = place;
  try {
    const std::string text = stored != known.end()
                                 ? stored->second
                                 : read_text_file(path, kLargestInclude, "a scene file");
    file->root = &parse_xml(file->document, text, path, expected, outer.outermost().warnings);
  } catch (const IoError& e) {
    throw IoError(include.source().prefix() + "<include>: " + e.what());
  }
  const std::string root = file->root->Name();
  if (root != name && !(is_scene(root) && is_scene(name)))
    include.fail(fmt::format("{} has the root <{}>; expected {}", path, root, expected));
  read_head(*file->root, context);
  check_units(include, include.element(), context);
  return *file;
}

}  // namespace tangere
