// SPDX-License-Identifier: Apache-2.0
// Values are checked in the unit of the file, so that messages show its numbers.
#include "io/scene/scene_element.hpp"

#include <algorithm>
#include <sstream>

namespace tangere {

void SceneElement::check(std::string_view type) const {
  std::vector<std::string> used, pictures, idle;
  for (const Attribute& a : schema()) {
    if ((a.elements & of_) == 0) continue;
    (a.has(kPicture) ? pictures : a.serves(type) ? used : idle).emplace_back(a.name);
  }
  check_attributes(used, pictures, idle);
}

void SceneElement::check_default() const {
  std::vector<std::string> used, idle;
  for (const Attribute& a : schema()) {
    if ((a.elements & of_) == 0) continue;
    if (a.has(kInDefault)) used.emplace_back(a.name);
    if (a.has(kIgnored)) idle.emplace_back(a.name);
  }
  check_attributes(used, {}, idle);
}

bool SceneElement::is_there(const Attribute& row) const {
  if (has(row.name)) return true;
  if (row.default_text == nullptr) static_cast<void>(text(row.name));  // fails
  return *row.default_text != '\0';
}

std::vector<double> SceneElement::values(const Attribute& row, std::size_t count,
                                         bool turns_or_linear) const {
  std::vector<double> x;
  if (has(row.name) || row.default_text == nullptr || *row.default_text == '\0') {
    x = SceneNode::numbers(row.name, count);  // fails if it is missing
  } else {
    std::istringstream usual(row.default_text);
    for (double value; usual >> value;) x.push_back(value);
  }
  const double factor = context().factor(row.unit_of(turns_or_linear));
  for (double& value : x) {
    if (const std::string fault = row.fault(value); !fault.empty()) fail_at(row.name, fault);
    value *= factor;
  }
  return x;
}

double SceneElement::number(const char* name, bool turns_or_linear) const {
  return values(row(name), 1, turns_or_linear)[0];
}

std::vector<double> SceneElement::numbers(const char* name, std::size_t count,
                                          bool turns_or_linear) const {
  return values(row(name), count, turns_or_linear);
}

Vector3 SceneElement::vector(const char* name) const {
  const std::vector<double> x = values(row(name), 3, false);
  return {x[0], x[1], x[2]};
}

std::size_t SceneElement::word(const char* name) const {
  const std::vector<std::string> words = words_of(row(name).words);
  const char* const usual = row(name).default_text;
  if (!has(name) && usual != nullptr)
    return std::size_t(std::ranges::find(words, usual) - words.begin());
  return std::size_t(choice(name, words));
}

static std::vector<Element> elements_of(std::uint64_t bits) {
  std::vector<Element> out;
  for (int k = 0; k < kElements; ++k)
    if ((bits & 1ULL << k) != 0) out.push_back(static_cast<Element>(1ULL << k));
  return out;
}

std::vector<std::string> element_names(std::uint64_t elements) {
  std::vector<std::string> names;
  for (const Element element : elements_of(elements)) names.emplace_back(to_string(element));
  return names;
}

std::vector<SceneNode> children_of(const SceneNode& node) {
  return node.children(element_names(elements_inside(node.name())));
}

std::vector<SceneElement> elements_in(const SceneNode& section) {
  section.check_attributes({});
  const std::vector<Element> kinds = elements_of(elements_inside(section.name()));
  std::vector<SceneElement> out;
  for (const SceneNode& node : children_of(section))
    for (const Element kind : kinds)
      if (node.name() == to_string(kind)) out.emplace_back(node, kind);
  return out;
}

}  // namespace tangere
