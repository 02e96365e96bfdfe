// SPDX-License-Identifier: Apache-2.0
// A joint changes a path if some bodies of the path, but not all, are beyond the joint.
#include "engine/scene/actuated_joints.hpp"

#include <algorithm>

namespace tangere {
namespace {

class ActuatedJoints {
 public:
  explicit ActuatedJoints(const Scene& scene) : links_(scene.links), found_(links_.size(), false) {
    for (const MotorDescription& motor : scene.motors) add(motor.joint);
    for (const TransmissionDescription& transmission : scene.transmissions)
      if (has(transmission.joint)) add_moved(transmission);
    while (add_leaders()) {
    }
    while (add_followers()) {
    }
  }

  [[nodiscard]] std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (std::size_t i = 0; i < links_.size(); ++i)
      if (found_[i]) names.push_back(links_[i].joint.name);
    return names;
  }

 private:
  /// Whether it added any, as below.
  bool add(const std::string& joint) {
    for (std::size_t i = 0; i < links_.size(); ++i)
      if (links_[i].joint.name == joint && !found_[i]) return found_[i] = true;
    return false;
  }
  [[nodiscard]] bool has(const std::string& joint) const {
    for (std::size_t i = 0; i < links_.size(); ++i)
      if (links_[i].joint.name == joint) return found_[i];
    return false;
  }

  bool add_leaders() {
    bool added = false;
    for (std::size_t i = 0; i < links_.size(); ++i)
      if (found_[i])
        for (const std::string& leader : links_[i].joint.follows) added |= add(leader);
    return added;
  }
  bool add_followers() {
    bool added = false;
    for (const LinkDescription& link : links_) {
      const std::vector<std::string>& leaders = link.joint.follows;
      if (!leaders.empty() && std::all_of(leaders.begin(), leaders.end(),
                                          [&](const std::string& name) { return has(name); }))
        added |= add(link.joint.name);
    }
    return added;
  }

  void add_moved(const TransmissionDescription& transmission) {
    std::vector<std::string> bodies;
    for (const PathPart& part : transmission.path)
      if (part.kind != PathPart::Kind::pulley) bodies.push_back(part.body);
    if (transmission.kind == TransmissionDescription::Kind::wrench)
      bodies = {transmission.body, transmission.reference.value_or("")};
    std::vector<std::size_t> beyond(links_.size(), 0);  // bodies of the path, of each joint
    for (const std::string& body : bodies)
      for (int i = link_of(body); i >= 0; i = links_[static_cast<std::size_t>(i)].parent)
        ++beyond[static_cast<std::size_t>(i)];
    for (std::size_t i = 0; i < links_.size(); ++i) {
      const JointType type = links_[i].joint.type;
      const bool holds = type != JointType::free && type != JointType::free2d;
      if (holds && beyond[i] > 0 && beyond[i] < bodies.size()) found_[i] = true;
    }
  }
  /// -1: the world.
  [[nodiscard]] int link_of(const std::string& body) const {
    for (std::size_t i = 0; i < links_.size() && !body.empty(); ++i)
      if (links_[i].body.name == body) return static_cast<int>(i);
    return -1;
  }

  const std::vector<LinkDescription>& links_;
  std::vector<bool> found_;
};

}  // namespace

std::vector<std::string> actuated_joints(const Scene& scene) {
  return ActuatedJoints(scene).names();
}

}  // namespace tangere
