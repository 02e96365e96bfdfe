// SPDX-License-Identifier: Apache-2.0
// Text as an XML document with one root. Every reader of XML files begins here.
#pragma once

#include <tinyxml2.h>

#include <string>
#include <vector>

namespace tangere {

/// Parses `text` into `document` and returns its root, which lives as long as the document.
/// `expected` names the root for messages: "the root <robot>". Text outside the root gives
/// warnings. Throws InputError ("name:line: …") for what is no well-formed XML in UTF-8.
const tinyxml2::XMLElement& parse_xml(tinyxml2::XMLDocument& document, const std::string& text,
                                      const std::string& name, const std::string& expected,
                                      std::vector<std::string>& warnings);

/// Returns a text as the value of an attribute, with its quotes.
std::string quoted_text(const std::string& text);

}  // namespace tangere
