// SPDX-License-Identifier: Apache-2.0
// Walks through all elements with the name "include". Rings have been refused by the reader.
#include "io/scene/included_texts.hpp"

#include <tinyxml2.h>

#include <filesystem>
#include <string_view>
#include <vector>

#include "io/files/text_file.hpp"
#include "io/scene/scene_folders.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

class IncludeWalk {
 public:
  IncludeWalk() : folders_(shipped_scenes()) { folders_.emplace(folders_.begin()); }

  /// `path`: of the file with this text.
  void add_from(const std::string& place, const fs::path& path, const std::string& text) {
    tinyxml2::XMLDocument document;
    if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) return;
    for (const auto* root = document.RootElement(); root != nullptr;
         root = root->NextSiblingElement())
      add_below(*root, place, path);
  }
  IncludedTexts texts;

 private:
  void add_below(const tinyxml2::XMLElement& element, const std::string& place,
                 const fs::path& path) {
    const char* const named = element.Attribute("file");
    if (std::string_view(element.Name()) == "include" && named != nullptr)
      add(place_from(place, named), path, named);
    for (const auto* child = element.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement())
      add_below(*child, place, path);
  }

  void add(const std::string& place, const fs::path& includer, const std::string& named) {
    if (texts.contains(place)) return;
    folders_.front() = includer.parent_path();
    const std::string path = find_scene_file(named, folders_);
    const std::string text = read_text_file(path, kLargestInclude, "a scene file");
    texts[place] = text;
    add_from(place, path, text);
  }

  std::vector<fs::path> folders_;  // beside the including file, then as the reader searches
};

}  // namespace

std::string place_from(const std::string& place, const std::string& named) {
  return (fs::path(place).parent_path() / named).lexically_normal().string();
}

IncludedTexts included_texts(const std::string& path, const std::string& text) {
  IncludeWalk walk;
  if (!path.empty()) walk.add_from("", path, text);
  return std::move(walk.texts);
}

}  // namespace tangere
