// SPDX-License-Identifier: Apache-2.0
// Robot files have elements by the hundred that mean nothing to a simulator of motion and touch.
// The tables name each, so that a misspelt one is noticed.
#include "io/robot/robot_node.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <filesystem>

#include "io/files/text_file.hpp"
#include "io/scene/included_file.hpp"
#include "io/scene/xml_document.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

constexpr const char* kOtherSoftware = "a setting of other software";

std::vector<std::string> names_of(const Words& words) {
  std::vector<std::string> names;
  for (const Word& w : words) names.emplace_back(w.name);
  return names;
}

const Word* word_in(const Words& words, std::string_view name) {
  const auto at =
      std::find_if(words.begin(), words.end(), [&](const Word& w) { return name == w.name; });
  return at == words.end() ? nullptr : &*at;
}

/// The root of the file that an <include> names. MuJoCo takes a file once in a model, from the
/// folder of the model's file. So does this, and rings cannot be.
RobotNode included_root(const RobotNode& include) {
  include.check({{"file"}});
  Robot& robot = include.robot();
  SceneContext& model = include.context().outermost();
  const std::string path = path_beside(include, include.text("file"));
  bool known = same_file(path, model.file);
  for (const auto& other : robot.included) {
    if (other->element == &include.element())  // of copies
      return {*other->document.RootElement(), other->context, robot};
    known |= &other->context.outermost() == &model && same_file(path, other->context.file);
  }
  if (known) include.fail(fmt::format("{} is there already; MuJoCo includes a file once", path));
  return read_mjcf_root(include, path, &model);
}

}  // namespace

std::string path_beside(const RobotNode& node, const std::string& name) {
  const fs::path folder = fs::path(node.context().outermost().file).parent_path();
  return (folder / name).lexically_normal().string();
}

RobotNode read_mjcf_root(const RobotNode& node, const std::string& path, SceneContext* includer) {
  Robot& robot = node.robot();
  const auto file = std::make_shared<RobotFile>();
  robot.included.push_back(file);
  file->element = &node.element();
  file->context.file = path;
  file->context.includer = includer;
  file->context.allow_unknown = node.context().allow_unknown;
  try {
    const std::string text = read_text_file(path, kLargestInclude, "a MJCF file");
    const RobotNode root(
        parse_xml(file->document, text, path, "the root <mujoco>", file->context.warnings),
        file->context, robot);
    if (root.name() != "mujoco" && root.name() != "mujocoinclude")
      root.fail("no part of a MJCF file; expected the root <mujoco> or <mujocoinclude>");
    root.check({{"model"}});
    return root;
  } catch (const IoError& e) {
    throw IoError(node.source().prefix() + "<" + node.name() + ">: " + e.what());
  }
}

bool RobotNode::given(const char* attribute) const {
  return element().Attribute(attribute) != nullptr;
}

void RobotNode::check(const Words& attributes) const {
  for (const tinyxml2::XMLAttribute* a = element().FirstAttribute(); a != nullptr; a = a->Next()) {
    const std::string_view name = a->Name();
    if (name.starts_with("xmlns")) continue;
    const Word* const word = word_in(attributes, name);
    if (word == nullptr) {
      if (is_of_other_software(name)) {
        idle(fmt::format("<{}> {}: {}", this->name(), name, kOtherSoftware));
        continue;
      }
      if (!context().allow_unknown)
        fail(fmt::format("unknown attribute '{}'{} (--allow-unknown ignores it)", name,
                         suggestion(name, names_of(attributes))));
      warn(fmt::format("unknown attribute '{}' is ignored", name));
      continue;
    }
    if (word->fate == Fate::read) continue;
    const std::string text = fmt::format("<{}> {}: {}", this->name(), name, word->why);
    if (word->fate == Fate::idle) {
      idle(text);
    } else {
      const auto all_zero = [&] {
        const std::vector<double> x = numbers(word->name);
        return std::all_of(x.begin(), x.end(), [](double n) { return n == 0; });
      };
      if (word->fate == Fate::lost || !all_zero()) lost(text);
    }
  }
}

std::vector<RobotNode> RobotNode::parts(const Words& known) const {
  std::vector<RobotNode> out;
  add_parts(known, out);
  return out;
}

void RobotNode::add_parts(const Words& known, std::vector<RobotNode>& out) const {
  for (const tinyxml2::XMLNode* n = element().FirstChild(); n != nullptr; n = n->NextSibling()) {
    if (const tinyxml2::XMLText* t = n->ToText()) {
      const std::string text = t->Value();
      if (!std::all_of(text.begin(), text.end(),
                       [](unsigned char c) { return std::isspace(c) != 0; }))
        context().warnings.push_back(fmt::format("{}:{}: stray text inside <{}> is ignored",
                                                 context().file, n->GetLineNum(), name()));
    }
    const tinyxml2::XMLElement* const e = n->ToElement();
    if (e == nullptr) continue;
    const RobotNode child(*e, context(), *robot_);
    if (child.name() == "include" && robot_->format == "MJCF") {
      included_root(child).add_parts(known, out);
      continue;
    }
    if (child.name().starts_with("xacro:"))
      child.fail("a macro of xacro; expected plain XML, which 'xacro FILE' writes");
    const Word* const word = word_in(known, child.name());
    if (word == nullptr && is_of_other_software(child.name())) {
      child.idle(fmt::format("<{}>: {}", child.name(), kOtherSoftware));
    } else if (word == nullptr) {
      if (!context().allow_unknown)
        child.fail(fmt::format("unknown element inside <{}>{} (--allow-unknown ignores it)", name(),
                               suggestion(child.name(), names_of(known))));
      child.warn("unknown element is ignored");
    } else if (word->fate == Fate::read) {
      out.push_back(child);
    } else {
      const std::string text = fmt::format("<{}>: {}", child.name(), word->why);
      word->fate == Fate::idle ? child.idle(text) : child.lost(text);
    }
  }
}

bool RobotNode::is_of_other_software(std::string_view name) const {
  return robot_->format == "URDF" && name.find(':') != std::string_view::npos;
}

bool RobotNode::flag(const char* attribute, bool fallback) const {
  if (!has(attribute)) return fallback;
  return choice(attribute, {"true", "false", "1", "0"}) % 2 == 0;
}

}  // namespace tangere
