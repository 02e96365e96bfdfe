// SPDX-License-Identifier: Apache-2.0
// The parser's messages contain neither what was found nor what was expected, so they are replaced.
#include "io/scene/xml_document.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/base/error.hpp"
#include "io/files/text_file.hpp"
#include "io/scene/scene_tags.hpp"

namespace tangere {
namespace {

/// Describes an error of the XML parser.
std::string fault_of(tinyxml2::XMLError error, const std::string& expected) {
  switch (error) {
    case tinyxml2::XML_ERROR_MISMATCHED_ELEMENT:
      return "an element is closed by another's end tag, or never";
    case tinyxml2::XML_ERROR_PARSING_ELEMENT:
      return "a tag that is not of the form <name attribute=\"value\">";
    case tinyxml2::XML_ERROR_PARSING_ATTRIBUTE:
      return "an attribute that is not of the form name=\"value\"";
    case tinyxml2::XML_ERROR_PARSING_COMMENT: return "a comment without its end -->";
    case tinyxml2::XML_ERROR_PARSING_DECLARATION: return "a declaration without its end ?>";
    case tinyxml2::XML_ERROR_EMPTY_DOCUMENT: return "no element; expected " + expected;
    case tinyxml2::XML_ELEMENT_DEPTH_EXCEEDED: return "elements nested too deep";
    default: return tinyxml2::XMLDocument::ErrorIDToName(error);
  }
}

}  // namespace

const tinyxml2::XMLElement& parse_xml(tinyxml2::XMLDocument& document, const std::string& text,
                                      const std::string& name, const std::string& expected,
                                      std::vector<std::string>& warnings) {
  if (text.find('\0') != std::string::npos)
    throw InputError(name + ": holds a zero byte; expected XML text");
  if (const std::size_t bad = find_invalid_utf8(text); bad != std::string_view::npos)
    throw InputError(fmt::format(
        "{}:{}: byte 0x{:02x} is no UTF-8; expected text in UTF-8", name,
        1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(bad), '\n'),
        static_cast<unsigned char>(text[bad])));
  check_attribute_counts(text, name);
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS)
    throw InputError(fmt::format("{}:{}: not well-formed XML: {}", name,
                                 std::max(document.ErrorLineNum(), 1),
                                 fault_of(document.ErrorID(), expected)));
  const tinyxml2::XMLElement* const root = document.RootElement();
  if (root == nullptr) throw InputError(name + ":1: no element; expected " + expected);
  for (const tinyxml2::XMLNode* node = document.FirstChild(); node != nullptr;
       node = node->NextSibling()) {
    if (node->ToText() != nullptr)
      warnings.push_back(fmt::format("{}:{}: stray text outside <{}> is ignored", name,
                                     node->GetLineNum(), root->Name()));
    if (node->ToElement() != nullptr && node != root)
      throw InputError(fmt::format("{}:{}: <{}> after the end of <{}>; expected one root", name,
                                   node->GetLineNum(), node->ToElement()->Name(), root->Name()));
  }
  return *root;
}

std::string quoted_text(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    switch (c) {
      case '&': out += "&amp;"; break;
      case '<': out += "&lt;"; break;
      case '>': out += "&gt;"; break;
      case '"': out += "&quot;"; break;
      default: out += c;
    }
  }
  return out + "\"";
}

}  // namespace tangere
