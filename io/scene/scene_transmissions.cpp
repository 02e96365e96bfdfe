// SPDX-License-Identifier: Apache-2.0
// Reads paths, wrenches and motors on bodies of a scene file.
#include <fmt/format.h>

#include <algorithm>

#include "engine/scene/scene_faults.hpp"
#include "io/scene/scene_sections.hpp"

namespace tangere {

namespace {

/// Returns the body that an attribute names; "" if it is left out: the world.
std::string body_or_world(const Scene& scene, const SceneNode& node, const char* attribute) {
  if (!node.has(attribute)) return "";
  find_body(scene, node, attribute);
  return node.text(attribute);
}

PathPart read_part(const Scene& scene, const SceneElement& node) {
  node.check();
  PathPart part;
  if (node.of() == kPulley) {
    part.kind = PathPart::Kind::pulley;
    part.divisor = node.number("divisor");
    return part;
  }
  part.body = body_or_world(scene, node, "body");
  part.position = node.vector("pos");
  if (node.of() == kPoint) return part;
  part.kind = node.has("axis") ? PathPart::Kind::cylinder : PathPart::Kind::sphere;
  part.radius = node.number("radius");
  if (node.has("axis")) part.axis = node.direction("axis");
  if (node.has("side")) part.side = node.vector("side");
  return part;
}

void read_path(const Scene& scene, const SceneElement& node, TransmissionDescription& d) {
  for (const SceneNode& child : children_of(node)) {
    const Element of = child.name() == "point" ? kPoint : child.name() == "wrap" ? kWrap : kPulley;
    d.path.push_back(read_part(scene, SceneElement(child, of)));
  }
}

void read_wrench(const Scene& scene, const SceneElement& node, TransmissionDescription& d) {
  d.kind = TransmissionDescription::Kind::wrench;
  find_body(scene, node, "body");
  d.body = node.text("body");
  d.position = node.vector("pos");
  const std::vector<double> force = node.numbers("force", 3);
  d.force = {force[0], force[1], force[2]};
  d.torque = node.vector("torque");
  if (!node.has("reference")) {
    if (node.has("pos2")) node.warn("'pos2' has no effect without 'reference'");
    return;
  }
  const bool world = node.text("reference") == "world";
  if (!world) find_body(scene, node, "reference");
  d.reference = world ? "" : node.text("reference");
  d.reference_position = node.vector("pos2");
}

}  // namespace

void read_transmissions(Scene& scene, const SceneNode& section) {
  for (const SceneElement& node : elements_in(section)) {
    node.check();
    TransmissionDescription d;
    d.source = node.source();
    find_joint(scene, node, "joint");
    d.joint = node.text("joint");
    node.of() == kPath ? read_path(scene, node, d) : read_wrench(scene, node, d);
    node.refuse(transmission_fault(d));
    scene.transmissions.push_back(std::move(d));
  }
}

std::size_t add_wrench_joint(Scene& scene, const std::string& name, const Source& source,
                             const TransmissionDescription& wrench) {
  LinkDescription link;
  link.name = link.body.name = link.joint.name = name;
  link.joint.source = link.body.source = source;
  link.joint.type = wrench.force == Vector3{0, 0, 0} ? JointType::revolute : JointType::prismatic;
  link.joint.axis0 = {1, 0, 0};
  link.body.shape = AbstractShape{};
  scene.links.push_back(link);
  scene.transmissions.push_back(wrench);
  return scene.links.size() - 1;
}

std::size_t read_motor_place(Scene& scene, const SceneElement& node) {
  if (node.has("joint")) node.fail("both 'joint' and 'body'; expected one");
  if (!node.has("name")) node.fail("a motor on a body has no name; expected one");
  TransmissionDescription d;
  d.kind = TransmissionDescription::Kind::wrench;
  d.source = node.source();
  d.joint = node.text("name");
  find_body(scene, node, "body");
  d.body = node.text("body");
  d.position = node.vector("pos");
  const std::vector<double> gear = node.numbers("gear", 6);
  const double length = node.context().length;
  d.force = {gear[0], gear[1], gear[2]};
  d.torque = {length * gear[3], length * gear[4], length * gear[5]};
  node.refuse(transmission_fault(d));
  return add_wrench_joint(scene, d.joint, d.source, d);
}

}  // namespace tangere
