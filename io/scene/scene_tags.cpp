// SPDX-License-Identifier: Apache-2.0
// Walks from tag to tag as the parser does. Text that is no XML is left to the parser's message.
#include "io/scene/scene_tags.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "engine/base/error.hpp"

namespace tangere {
namespace {

constexpr int kMostAttributes = 100;

/// Where the piece that starts at `at` ends, if it is a comment or another one without attributes;
/// `at` if it is a tag.
std::size_t end_of_other(std::string_view text, std::size_t at) {
  struct Kind {
    std::string_view begin, end;
  };
  constexpr Kind kKinds[] = {{"<!--", "-->"}, {"<![CDATA[", "]]>"}, {"<?", "?>"}, {"<!", ">"}};
  for (const Kind& kind : kKinds) {
    if (text.substr(at, kind.begin.size()) != kind.begin) continue;
    const std::size_t end = text.find(kind.end, at + kind.begin.size());
    return end == std::string_view::npos ? text.size() : end + kind.end.size();
  }
  return at;
}

}  // namespace

void check_attribute_counts(std::string_view text, const std::string& name) {
  for (std::size_t at = text.find('<'); at < text.size(); at = text.find('<', at)) {
    const std::size_t begin = at, other = end_of_other(text, at);
    if (other != at) {
      at = other;
      continue;
    }
    int attributes = 0;
    for (++at; at < text.size() && text[at] != '>'; ++at) {
      if (text[at] == '"' || text[at] == '\'')
        at = std::min(text.find(text[at], at + 1), text.size() - 1);
      if (text[at] == '=') ++attributes;
    }
    if (attributes > kMostAttributes)
      throw InputError(fmt::format(
          "{}:{}: an element of {} attributes; expected at most {}", name,
          1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(begin), '\n'),
          attributes, kMostAttributes));
  }
}

}  // namespace tangere
