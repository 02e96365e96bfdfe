// SPDX-License-Identifier: Apache-2.0
// Changes a document in place, so that a written layout differs by what was set alone.
#include "io/scene/layout_file.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "io/scene/xml_document.hpp"

namespace tangere {

const tinyxml2::XMLElement& parse_layout(tinyxml2::XMLDocument& document, const std::string& text,
                                         SceneContext& context) {
  const tinyxml2::XMLElement& root =
      parse_xml(document, text, context.file, "the root <sensor>", context.warnings);
  const SceneNode node(root, context);
  if (node.name() != "sensor") node.fail("not a layout; expected the root <sensor unit=\"m-kg\">");
  node.check_attributes({"unit", "name"});
  if (node.choice("unit", {"cm-g", "m-kg"}, 0) != 1)
    node.fail("unit=\"cm-g\"; expected unit=\"m-kg\", the unit of scenes that are written");
  return root;
}

std::string parts_text(const tinyxml2::XMLElement& sensor) {
  std::string text;
  for (const auto* child = sensor.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    tinyxml2::XMLPrinter printer(nullptr, true);
    child->Accept(&printer);
    text += fmt::format("      {}\n", printer.CStr());
  }
  return text;
}

struct LayoutFile::Impl {
  tinyxml2::XMLDocument document;
  SceneContext context;
  tinyxml2::XMLElement* sensor = nullptr;
  Source source;  // copies of a document have no lines
};

LayoutFile::LayoutFile(const std::string& text, const std::string& name)
    : impl_(std::make_unique<Impl>()) {
  impl_->context.file = name;
  const SceneNode root(parse_layout(impl_->document, text, impl_->context), impl_->context);
  if (root.children({"tactile"}).size() != 1)
    root.fail(fmt::format("{} sensors; expected one <tactile>", root.children({"tactile"}).size()));
  impl_->sensor = impl_->document.RootElement()->FirstChildElement("tactile");
  if (impl_->sensor == nullptr) root.fail("a sensor from another file; expected one <tactile>");
  impl_->source = SceneNode(*impl_->sensor, impl_->context).source();
}
LayoutFile::LayoutFile(const LayoutFile& other) : impl_(std::make_unique<Impl>()) {
  impl_->context.file = other.impl_->context.file;
  impl_->source = other.impl_->source;
  other.impl_->document.DeepCopy(&impl_->document);
  impl_->sensor = impl_->document.RootElement()->FirstChildElement("tactile");
}
LayoutFile::~LayoutFile() = default;
LayoutFile::LayoutFile(LayoutFile&&) noexcept = default;
LayoutFile& LayoutFile::operator=(LayoutFile&&) noexcept = default;

std::string LayoutFile::name() const {
  return SceneNode(*impl_->sensor, impl_->context).text("name", "skin");
}

bool LayoutFile::has(const std::string& attribute) const {
  return impl_->sensor->Attribute(attribute.c_str()) != nullptr;
}

std::string LayoutFile::get(const std::string& attribute) const {
  const char* const text = impl_->sensor->Attribute(attribute.c_str());
  return text == nullptr ? "" : text;
}
std::string LayoutFile::get(const std::string& part, const std::string& attribute) const {
  const auto* const element = impl_->sensor->FirstChildElement(part.c_str());
  const char* const text = element == nullptr ? nullptr : element->Attribute(attribute.c_str());
  return text == nullptr ? "" : text;
}

void LayoutFile::set(const std::string& attribute, const std::string& value) {
  impl_->sensor->SetAttribute(attribute.c_str(), value.c_str());
}

void LayoutFile::set(const std::string& part, const std::string& attribute,
                     const std::string& value) {
  tinyxml2::XMLElement* element = impl_->sensor->FirstChildElement(part.c_str());
  if (element == nullptr) element = impl_->sensor->InsertNewChildElement(part.c_str());
  element->SetAttribute(attribute.c_str(), value.c_str());
}

void LayoutFile::remove(const std::string& attribute) {
  impl_->sensor->DeleteAttribute(attribute.c_str());
}

Source LayoutFile::source() const { return impl_->source; }

std::string LayoutFile::tactile_text(const std::string& body,
                                     std::span<const std::string> without) const {
  tinyxml2::XMLPrinter printer(nullptr, true);
  printer.OpenElement("tactile", true);
  printer.PushAttribute("body", body.c_str());
  for (const auto* a = impl_->sensor->FirstAttribute(); a != nullptr; a = a->Next())
    if (std::string_view(a->Name()) != "body" && std::ranges::count(without, a->Name()) == 0)
      printer.PushAttribute(a->Name(), a->Value());
  for (const auto* child = impl_->sensor->FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement())
    if (std::ranges::count(without, child->Name()) == 0) child->Accept(&printer);
  printer.CloseElement(true);
  return printer.CStr();
}

void LayoutFile::add_comment(const std::string& text) {
  std::string plain = " " + text + " ";
  for (std::size_t at = plain.find("--"); at != std::string::npos; at = plain.find("--", at))
    plain.replace(at, 2, "- -");  // "--" would end it
  impl_->document.RootElement()->InsertFirstChild(impl_->document.NewComment(plain.c_str()));
}

std::string LayoutFile::text() const {
  tinyxml2::XMLPrinter printer;
  impl_->document.Accept(&printer);
  return printer.CStr();
}

}  // namespace tangere
