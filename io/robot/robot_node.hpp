// SPDX-License-Identifier: Apache-2.0
// One element of a robot file. A table classifies every attribute and child: read, ignored without
// an effect, or ignored with an effect. Unknown ones are errors.
#pragma once

#include <tinyxml2.h>

#include <string>
#include <string_view>
#include <vector>

#include "io/robot/robot.hpp"
#include "io/scene/scene_node.hpp"

namespace tangere {

/// A file that an <include>, or a <model> that is attached, has brought in. Its elements refer to
/// the document and the context.
struct RobotFile {
  tinyxml2::XMLDocument document;
  SceneContext context;
  const tinyxml2::XMLElement* element = nullptr;  ///< which names the file
};

/// What becomes of an attribute or a child element.
enum class Fate {
  read,
  idle,  ///< of no effect on the motion
  lost,  ///< matters, and scenes have no such thing
  zero   ///< an attribute: idle if its numbers are all zero, else lost
};

struct Word {
  const char* name;
  Fate fate = Fate::read;
  const char* why = "";  ///< what it is, for the list: "pictures only"
};
using Words = std::vector<Word>;

class RobotNode : public SceneNode {
 public:
  RobotNode(const tinyxml2::XMLElement& element, SceneContext& context, Robot& robot)
      : SceneNode(element, context), robot_(&robot) {}

  [[nodiscard]] Robot& robot() const { return *robot_; }
  /// Whether the element itself has the attribute; has() counts defaults too.
  [[nodiscard]] bool given(const char* attribute) const;

  /// Checks the element's own attributes against the table and lists those that are left out. An
  /// unknown one is an error, or a warning with --allow-unknown.
  void check(const Words& attributes) const;
  /// Returns the children that are read, in order, and lists the others likewise. In MJCF the
  /// children of a file that an <include> names stand in its place.
  [[nodiscard]] std::vector<RobotNode> parts(const Words& known) const;
  /// The same in another context, which has defaults of its own.
  [[nodiscard]] RobotNode in(SceneContext& context) const { return {element(), context, *robot_}; }

  void idle(const std::string& text) const { robot_->idle.add(source(), text); }
  void changed(const std::string& text) const { robot_->changed.add(source(), text); }
  void lost(const std::string& text) const { robot_->lost.add(source(), text); }

  /// Whether the attribute is "true" or "1"; "false" and "0" are the others.
  [[nodiscard]] bool flag(const char* attribute, bool fallback) const;

 private:
  /// Whether a name of URDF has a prefix, as drake:acceleration: other software adds such words.
  [[nodiscard]] bool is_of_other_software(std::string_view name) const;
  void add_parts(const Words& known, std::vector<RobotNode>& out) const;

  Robot* robot_;
};

/// Reads the MJCF file that lies at `path` beside the file of the model in which `node` stands, and
/// returns its root. The robot keeps the file. `includer`: the context of the model of which the
/// file is a part; null: the file is a model. Throws what reading and parsing a file throws, each
/// with the line of the node.
RobotNode read_mjcf_root(const RobotNode& node, const std::string& path, SceneContext* includer);
/// The path of a file that `name` gives beside the file of the model in which the node stands.
std::string path_beside(const RobotNode& node, const std::string& name);

}  // namespace tangere
