// SPDX-License-Identifier: Apache-2.0
// The schema of scenes in Python, from which python/scene_elements.py makes the classes that build
// scenes.
#include <fmt/format.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "engine/scene/schema.hpp"
#include "engine/scene/shapes.hpp"
#include "python/module/module.hpp"

namespace tangere::python {
namespace nb = nanobind;
namespace {

std::string unit_text(const Attribute& a) {
  std::string text = a.unit == Unit::one ? "" : to_string(a.unit);
  if (a.other_unit != Unit::one) text += std::string(" or ") + to_string(a.other_unit);
  return text;
}

std::vector<std::string> words_in(const Attribute& a) {
  if (a.words != nullptr) return words_of(a.words);
  std::vector<std::string> types;
  if (a.elements == kBody && std::string_view(a.name) == "type")
    for (const ShapeRow& shape : shape_rows()) types.emplace_back(shape.name);
  return types;
}

nb::dict attribute(const Attribute& a) {
  nb::dict d;
  d["name"] = a.name;
  d["needed"] = a.default_text == nullptr;
  d["default"] = a.default_text == nullptr ? "" : a.default_text;
  d["unit"] = unit_text(a);
  d["text"] = a.has(kPicture) ? "for pictures" : a.text;
  d["types"] = a.types == nullptr ? std::vector<std::string>{} : words_of(a.types);
  d["words"] = words_in(a);
  return d;
}

/// An element inside a holder. In <default> it has the attributes that may stand there.
nb::dict element_in(const Holder& holder, Element element) {
  const bool is_default = std::string_view(holder.name) == "default";
  nb::list attributes;
  for (const Attribute& a : schema())
    if ((a.elements & element) != 0 && !a.has(kIgnored) && (!is_default || a.has(kInDefault)))
      attributes.append(attribute(a));
  // Those of <randomize> and <default> have only the names of others.
  const bool holds = !is_default && (element & kVarying) == 0;
  nb::dict d;
  d["name"] = to_string(element);
  d["holds"] = holds && elements_inside(to_string(element)) != 0;
  d["attributes"] = attributes;
  return d;
}

nb::list scene_schema() {
  nb::list out;
  for (const Holder& holder : holders()) {
    nb::list elements;
    for (int k = 0; k < kElements; ++k)
      if (const auto e = static_cast<Element>(1ULL << k); (holder.elements & e) != 0)
        elements.append(element_in(holder, e));
    nb::dict d;
    d["name"] = holder.name;
    d["section"] = holder.section;
    d["elements"] = elements;
    out.append(d);
  }
  return out;
}

}  // namespace

void add_scene_schema(nb::module_& m) {
  m.def(
      "scene_schema", &scene_schema,
      "Elements and attributes of scenes: the root, sections and elements that hold others, each\n"
      "with what it holds.");
}

}  // namespace tangere::python
