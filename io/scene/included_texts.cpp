// SPDX-License-Identifier: Apache-2.0
// Walks through all elements with the name "include". Rings have been refused by the reader.
#include "io/scene/included_texts.hpp"

#include <tinyxml2.h>

#include <filesystem>
#include <string_view>

#include "io/files/text_file.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

class IncludeWalk {
 public:
  explicit IncludeWalk(const std::string& path) : folder_(fs::path(path).parent_path()) {}

  void add_from(const std::string& place, const std::string& text) {
    tinyxml2::XMLDocument document;
    if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) return;
    for (const auto* root = document.RootElement(); root != nullptr;
         root = root->NextSiblingElement())
      add_below(*root, place);
  }
  IncludedTexts texts;

 private:
  void add_below(const tinyxml2::XMLElement& element, const std::string& place) {
    const char* const named = element.Attribute("file");
    if (std::string_view(element.Name()) == "include" && named != nullptr)
      add(place_from(place, named));
    for (const auto* child = element.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement())
      add_below(*child, place);
  }

  void add(const std::string& place) {
    if (texts.contains(place)) return;
    const std::string path = (folder_ / place).string();
    const std::string text = read_text_file(path, kLargestInclude, "a scene file");
    texts[place] = text;
    add_from(place, text);
  }

  fs::path folder_;
};

}  // namespace

std::string place_from(const std::string& place, const std::string& named) {
  return (fs::path(place).parent_path() / named).lexically_normal().string();
}

IncludedTexts included_texts(const std::string& path, const std::string& text) {
  IncludeWalk walk(path);
  if (!path.empty()) walk.add_from("", text);
  return std::move(walk.texts);
}

}  // namespace tangere
