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

std::vector<SceneElement> elements_in(const SceneNode& section, std::uint32_t kinds) {
  section.check_attributes({});
  std::vector<std::string> names;
  std::vector<Element> found;
  for (int k = 0; k < kElements; ++k)
    if (const auto element = static_cast<Element>(1U << k); (kinds & element) != 0)
      found.push_back(element), names.emplace_back(to_string(element));
  std::vector<SceneElement> out;
  for (const SceneNode& node : section.children(names))
    out.emplace_back(node,
                     found[std::size_t(std::ranges::find(names, node.name()) - names.begin())]);
  return out;
}

}  // namespace tangere
