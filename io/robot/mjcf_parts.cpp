// SPDX-License-Identifier: Apache-2.0
// <frame>, <replicate> and <attach> stand for more parts, in the frame of the same body.
#include "io/robot/mjcf_parts.hpp"

#include <fmt/format.h>

#include <optional>

#include "io/robot/mjcf_words.hpp"

namespace tangere {
namespace {

const Words kWorldParts = {{"body"},
                           {"geom"},
                           {"frame"},
                           {"site"},
                           {"replicate"},
                           {"attach"},
                           {"camera", Fate::idle, kSight},
                           {"light", Fate::idle, kSight},
                           {"composite", Fate::lost, "bodies made by MuJoCo; write them out"},
                           {"flexcomp", Fate::lost, "bodies that bend; scenes have none"},
                           {"plugin", Fate::lost, "plug-ins of MuJoCo"}};
const Words& body_words() {
  static const Words words = [] {
    Words all = kWorldParts;
    for (const char* name : {"joint", "freejoint", "inertial"}) all.push_back({name});
    return all;
  }();
  return words;
}

class Gathering {
 public:
  Gathering(MjcfWhole& whole, std::vector<MjcfPart>& out) : whole_(whole), out_(out) {}

  void add(const MjcfPart& outer, const Words& known, int depth) {
    if (depth > kDeepestBodies)
      outer.node.fail(fmt::format("frames nested deeper than {}", kDeepestBodies));
    for (const RobotNode& node : outer.node.parts(known)) {
      const MjcfPart part = child(outer, node);
      if (node.name() == "frame") {
        add(inside(part), known, depth + 1);
      } else if (node.name() == "replicate") {
        for (const MjcfReplica& copy : replicas(whole_, node, *part.scope))
          add({node, compose(part.frame, copy.pose), part.own_class(), copy.scope}, kWorldParts,
              depth + 1);
      } else if (node.name() == "attach") {
        attach(part, depth);
      } else {
        out_.push_back(part);
      }
    }
  }

  void add_world(const MjcfPart& world, int depth) {
    world.node.check({{"name", Fate::idle, kSight}});
    add(world, kWorldParts, depth);
  }

 private:
  static MjcfPart child(const MjcfPart& outer, const RobotNode& node) {
    return {node, outer.frame, outer.defaults, outer.scope};
  }

  /// A frame whose contents are to be read.
  static MjcfPart inside(const MjcfPart& frame) {
    frame.node.check(with_rotations({{"name"}, {"childclass"}}));
    return {frame.node, compose(frame.frame, frame.file().read_pose(frame.node)), frame.own_class(),
            frame.scope};
  }

  /// Adds a body, the contents of a frame, or those of the world of a model. As MuJoCo, leaves out
  /// the frames around the body or the frame.
  void attach(const MjcfPart& place, int depth) {
    const MjcfScope& scope = attached_scope(whole_, place.node, *place.scope);
    const bool whole = place.node.text("body", "world") == "world" && !place.node.has("frame");
    std::vector<std::string> names;
    for (const RobotNode& section : scope.file->sections) {
      if (section.name() != "worldbody") continue;
      const MjcfPart world{section, place.frame, "main", &scope};
      if (whole) {
        add_world(world, depth + 1);
      } else if (const auto found = find(world, place.node, names, 0)) {
        if (found->node.name() == "body")
          out_.push_back(*found);
        else
          add(inside(*found), kWorldParts, depth + 1);
        return;
      }
    }
    if (whole) return;
    const char* const kind = place.node.has("body") ? "body" : "frame";
    const std::string name = place.node.text(kind);
    const std::string model =
        place.node.has("model") ? fmt::format("model '{}'", place.node.text("model")) : "this file";
    place.node.fail(fmt::format("{}=\"{}\": no {} of {} has this name{}", kind, name, kind, model,
                                suggestion(name, names)));
  }

  /// Finds the body or the frame that an <attach> names, and keeps the names of the others.
  static std::optional<MjcfPart> find(const MjcfPart& outer, const RobotNode& attach,
                                      std::vector<std::string>& names, int depth) {
    if (depth > kDeepestBodies)
      outer.node.fail(fmt::format("bodies nested deeper than {}", kDeepestBodies));
    const char* const kind = attach.has("body") ? "body" : "frame";
    for (const RobotNode& node : outer.node.parts(body_words())) {
      if (node.name() != "body" && node.name() != "frame") continue;
      MjcfPart part = child(outer, node);
      if (node.name() == kind && node.has("name")) {
        if (node.text("name") == attach.text(kind)) return part;
        names.push_back(node.text("name"));
      }
      part.defaults = part.own_class();
      if (auto found = find(part, attach, names, depth + 1)) return found;
    }
    return std::nullopt;
  }

  MjcfWhole& whole_;
  std::vector<MjcfPart>& out_;
};

}  // namespace

MjcfPart MjcfPart::with_class() const {
  return {file().with_class(node, defaults), frame, defaults, scope};
}

std::string MjcfPart::own_class() const {
  return node.has("childclass") ? file().known_class(node, "childclass") : defaults;
}

std::vector<MjcfPart> body_parts(MjcfWhole& whole, const MjcfPart& body) {
  std::vector<MjcfPart> out;
  Gathering(whole, out).add(body, body_words(), 0);
  return out;
}

std::vector<MjcfPart> world_parts(MjcfWhole& whole, const MjcfPart& world) {
  std::vector<MjcfPart> out;
  Gathering(whole, out).add_world(world, 0);
  return out;
}

}  // namespace tangere
