// SPDX-License-Identifier: Apache-2.0
// Parses attributes. Values must be complete and finite, and have double precision.
#include "io/scene/scene_node.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdlib>

#include "io/scene/included_file.hpp"

namespace tangere {
namespace {

constexpr const char* kAllow = " (--allow-unknown ignores it)";

}  // namespace

void SceneContext::use_centimetres_and_grams() { length = kUnits[static_cast<int>(Unit::m)].in_si; }

Source SceneContext::source(int line) const {
  const bool made = line >= 1 && std::size_t(line) <= origins.size();
  return made ? origins[std::size_t(line) - 1] : Source{file, line};
}

double SceneContext::factor(Unit unit) const {
  return length == 1 ? 1 : kUnits[static_cast<int>(unit)].in_si;
}

void SceneNode::fail(const std::string& message) const {
  throw InputError(source().prefix() + "<" + name() + ">: " + message);
}

void SceneNode::fail_at(const char* attribute, const std::string& message) const {
  const SceneContext::Default* given =
      find_own(attribute) == nullptr ? find_default(attribute) : nullptr;
  if (include_ != nullptr && include_->Attribute(attribute) != nullptr)
    fail(fmt::format("{} (from the <include>, line {})", message,
                     context_->includer->source(include_->GetLineNum()).line));
  fail(given == nullptr ? message
                        : fmt::format("{} (from <default>, line {})", message, given->line));
}

void SceneNode::fail_count(const char* attribute, std::size_t found,
                           const std::string& expected) const {
  fail_at(attribute, fmt::format("{}=\"{}\" has {} numbers; expected {}", attribute,
                                 text(attribute).substr(0, 80), found, expected));
}

void SceneNode::warn(const std::string& message) const {
  context_->outermost().warnings.push_back(source().prefix() + "<" + name() + ">: " + message);
}

void SceneNode::check_attributes(const std::vector<std::string>& used,
                                 const std::vector<std::string>& pictures,
                                 const std::vector<std::string>& unused) const {
  const auto in = [](const std::vector<std::string>& list, const std::string& word) {
    return std::find(list.begin(), list.end(), word) != list.end();
  };
  const auto check = [&](const tinyxml2::XMLElement& of, const std::string& skipped) {
    const SceneNode at(of, &of == element_ ? *context_ : *context_->includer);
    for (const tinyxml2::XMLAttribute* a = of.FirstAttribute(); a != nullptr; a = a->Next()) {
      const std::string attribute = a->Name();
      if (attribute == skipped || in(used, attribute) || in(pictures, attribute)) continue;
      if (in(unused, attribute)) {
        warn("attribute '" + attribute + "' has no effect here");
      } else if (context_->allow_unknown) {
        warn("unknown attribute '" + attribute + "' is ignored");
      } else {
        std::vector<std::string> known = used;
        known.insert(known.end(), pictures.begin(), pictures.end());
        at.fail("unknown attribute '" + attribute + "'" +
                (&of == element_ ? "" : " of <" + name() + ">") + suggestion(attribute, known) +
                kAllow);
      }
    }
  };
  check(*element_, "");
  if (include_ != nullptr) check(*include_, "file");
}

std::vector<SceneNode> SceneNode::children(const std::vector<std::string>& known) const {
  std::vector<SceneNode> out;
  add_children(known, nullptr, out);
  return out;
}

void SceneNode::add_children(const std::vector<std::string>& known,
                             const tinyxml2::XMLElement* include,
                             std::vector<SceneNode>& out) const {
  for (const tinyxml2::XMLNode* n = element_->FirstChild(); n != nullptr; n = n->NextSibling()) {
    if (const tinyxml2::XMLElement* e = n->ToElement()) {
      const SceneNode child(*e, *context_, include);
      if (std::find(known.begin(), known.end(), child.name()) != known.end()) {
        out.push_back(child);
      } else if (child.name() == "include") {
        if (include != nullptr)
          child.fail(
              fmt::format("the <include> of line {} gives attributes to this one; expected "
                          "them here",
                          context_->includer->source(include->GetLineNum()).line));
        const IncludedFile& file = include_file(child, *this);
        const bool gives = e->FirstAttribute()->Next() != nullptr;  // more than the file's name
        SceneNode(*file.root, *file.context).add_children(known, gives ? e : nullptr, out);
      } else if (context_->allow_unknown) {
        child.warn("unknown element is ignored");
      } else {
        child.fail("unknown element inside <" + name() + ">" + suggestion(child.name(), known) +
                   kAllow);
      }
    } else if (const tinyxml2::XMLText* t = n->ToText()) {
      const std::string text = t->Value();
      if (!std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isspace(c); }))
        context_->outermost().warnings.push_back(
            fmt::format("{}stray text inside <{}> is ignored",
                        context_->source(n->GetLineNum()).prefix(), name()));
    }
  }
}

const char* SceneNode::find_own(const char* attribute) const {
  const std::string_view name = attribute;
  if (include_ != nullptr && name != "file")
    if (const char* value = include_->Attribute(attribute)) return value;
  return element_->Attribute(attribute);
}

const char* SceneNode::find(const char* attribute) const {
  if (const char* value = find_own(attribute)) return value;
  const SceneContext::Default* given = find_default(attribute);
  return given == nullptr ? nullptr : given->value.c_str();
}

const SceneContext::Default* SceneNode::find_default(const char* attribute) const {
  const auto element = context_->defaults.find(name());
  if (element == context_->defaults.end()) return nullptr;
  const auto value = element->second.find(attribute);
  return value == element->second.end() ? nullptr : &value->second;
}

std::string SceneNode::text(const char* attribute) const {
  const char* value = find(attribute);
  if (value == nullptr) fail(fmt::format("attribute '{}' is missing", attribute));
  if (*value == '\0')
    fail_at(attribute, fmt::format("attribute '{}' is empty; expected a value", attribute));
  return value;
}

std::string SceneNode::text(const char* attribute, const std::string& fallback) const {
  return has(attribute) ? text(attribute) : fallback;
}

int SceneNode::choice(const char* attribute, const std::vector<std::string>& words,
                      std::optional<int> fallback) const {
  if (fallback && !has(attribute)) return *fallback;
  const std::string value = text(attribute);
  const auto it = std::find(words.begin(), words.end(), value);
  if (it == words.end())
    fail_at(attribute,
            fmt::format("{}=\"{}\" is not known{}", attribute, value, suggestion(value, words)));
  return static_cast<int>(it - words.begin());
}

std::vector<double> SceneNode::numbers(const char* attribute, std::size_t count) const {
  const std::string value = text(attribute);
  std::vector<double> out;
  const char* p = value.c_str();
  for (;;) {
    while (std::isspace(static_cast<unsigned char>(*p)) != 0 || *p == ',') ++p;
    if (*p == '\0') break;
    char* end = nullptr;
    const double x = std::strtod(p, &end);
    const bool whole = end != p && (*end == '\0' || *end == ',' ||
                                    std::isspace(static_cast<unsigned char>(*end)) != 0);
    if (!whole || !std::isfinite(x))
      fail_at(attribute, fmt::format("{}=\"{}\": expected finite numbers, found '{}'", attribute,
                                     value.substr(0, 80), std::string(p).substr(0, 20)));
    out.push_back(x);
    p = end;
  }
  if (count > 0 && out.size() != count) fail_count(attribute, out.size(), std::to_string(count));
  return out;
}

double SceneNode::number(const char* attribute, std::optional<double> fallback) const {
  if (fallback && !has(attribute)) return *fallback;
  return numbers(attribute, 1)[0];
}

double SceneNode::positive(const char* attribute, std::optional<double> fallback) const {
  const double x = number(attribute, fallback);
  if (!(x > 0))
    fail_at(attribute, fmt::format("{}=\"{}\"; expected a positive number", attribute, x));
  return x;
}

double SceneNode::not_negative(const char* attribute, std::optional<double> fallback) const {
  const double x = number(attribute, fallback);
  if (!(x >= 0)) fail_at(attribute, fmt::format("{}=\"{}\"; expected zero or more", attribute, x));
  return x;
}

int SceneNode::integer(const char* attribute, int lowest, int highest,
                       std::optional<int> fallback) const {
  if (fallback && !has(attribute)) return *fallback;
  const double x = number(attribute);
  if (x != std::floor(x) || x < lowest || x > highest)
    fail_at(attribute, fmt::format("{}=\"{}\"; expected an integer from {} to {}", attribute, x,
                                   lowest, highest));
  return static_cast<int>(x);
}

std::vector<int> SceneNode::integers(const char* attribute, const std::vector<int>& fallback,
                                     int lowest, int highest) const {
  if (!has(attribute)) return fallback;
  const std::vector<double> x = numbers(attribute, fallback.size());
  for (const double n : x)
    if (n != std::floor(n) || n < lowest || n > highest)
      fail_at(attribute, fmt::format("{} has {}; expected integers from {} to {}", attribute, n,
                                     lowest, highest));
  return {x.begin(), x.end()};
}

Vector3 SceneNode::vector(const char* attribute, std::optional<Vector3> fallback) const {
  if (fallback && !has(attribute)) return *fallback;
  const std::vector<double> x = numbers(attribute, 3);
  return {x[0], x[1], x[2]};
}

Vector3 SceneNode::direction(const char* attribute, std::optional<Vector3> fallback) const {
  Vector3 a = vector(attribute, fallback);
  const double length = std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
  if (!(length > 1e-100) || !std::isfinite(length))
    fail_at(attribute,
            fmt::format("{}=\"{} {} {}\" has no direction; expected a vector of positive length",
                        attribute, a[0], a[1], a[2]));
  if (std::abs(length - 1) > 1e-15)
    for (double& x : a) x /= length;
  return a;
}

Quaternion SceneNode::quaternion(const char* attribute) const {
  if (!has(attribute)) return {1, 0, 0, 0};
  const std::vector<double> q = numbers(attribute, 4);
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(length > 1e-100) || !std::isfinite(length))
    fail_at(attribute,
            fmt::format("{}=\"{} {} {} {}\" is not a rotation; expected w x y z, not all zero",
                        attribute, q[0], q[1], q[2], q[3]));
  return {q[0] / length, q[1] / length, q[2] / length, q[3] / length};
}

}  // namespace tangere
