// SPDX-License-Identifier: Apache-2.0
// Bodies of a scene file: what each type is made of.
#include <fmt/format.h>

#include <algorithm>

#include "io/scene/scene_sections.hpp"
#include "io/scene/surface_files.hpp"
#include "io/scene/tactile_layouts.hpp"

namespace tangere {

namespace {

constexpr int kLargestResolution = 1000;  // contact points along one edge or around one ring
constexpr int kMostPoints = 1 << 20;      // of a hemisphere

using Names = std::vector<std::string>;

/// Which attributes this element's type uses; the rest of what bodies may have is without effect.
class Attributes {
 public:
  void use(std::initializer_list<const char*> names) {
    for (const char* name : names) {
      used.emplace_back(name);
      idle.erase(std::remove(idle.begin(), idle.end(), name), idle.end());
    }
  }
  void leave(const char* name) {
    used.erase(std::remove(used.begin(), used.end(), name), used.end());
    idle.emplace_back(name);
  }

  Names used = {"name", "type", "pos", "quat", "density", "mass", "rgba"};
  Names idle = {"scale",
                "general_contact_resolution",
                "general_contact_angle_resolution",
                "general_contact_radius_resolution",
                "size",
                "radius",
                "length",
                "filename",
                "transform_type",
                "inertia"};
};

CuboidShape read_cuboid(const SceneNode& node, double length) {
  CuboidShape shape;
  shape.size = scaled(node.vector("size"), length);
  for (double s : shape.size)
    if (!(s > 0)) node.fail(fmt::format("size has the edge {} m; expected positive lengths", s));
  const std::array<int, 3>& fallback = shape.contact_resolution;
  const std::vector<int> n = node.integers(
      "general_contact_resolution", {fallback.begin(), fallback.end()}, 2, kLargestResolution);
  std::copy(n.begin(), n.end(), shape.contact_resolution.begin());
  return shape;
}

CylinderShape read_cylinder(const SceneNode& node, double length) {
  CylinderShape shape{node.positive("length") * length, node.positive("radius") * length};
  int &angles = shape.contact_angles, &rings = shape.contact_rings;
  angles = node.integer("general_contact_angle_resolution", 3, kLargestResolution, angles);
  rings = node.integer("general_contact_radius_resolution", 1, kLargestResolution, rings);
  return shape;
}

CapsuleShape read_capsule(const SceneNode& node, double length) {
  CapsuleShape shape{node.positive("length") * length, node.positive("radius") * length};
  const std::vector<int> n =
      node.integers("general_contact_resolution", {shape.contact_rings, shape.contact_angles}, 2,
                    kLargestResolution);
  shape.contact_rings = n[0], shape.contact_angles = n[1];
  return shape;
}

/// Contact points of an abstract body, in the scene's unit: those of a file, or of a hemisphere.
std::vector<double> read_collision(const SceneNode& node) {
  const bool generated = node.has("radius") || node.has("count");
  if (generated == node.has("contacts"))
    node.fail(
        fmt::format("{}; expected 'contacts' (a file), or 'radius' and 'count' (a hemisphere)",
                    generated ? "both 'contacts' and a hemisphere" : "no contact points"));
  if (!generated) return read_beside(node, "contacts", read_contact_points);
  std::vector<double> points;
  for (const TactilePoint& p :
       hemisphere_points(node.positive("radius"), node.integer("count", 1, kMostPoints)))
    points.insert(points.end(), p.position.begin(), p.position.end());
  return points;
}

AbstractShape read_abstract(const SceneNode& node, double length) {
  const SceneContext& c = node.context();
  AbstractShape shape;
  shape.mass = node.not_negative("mass") * c.density * c.length * c.length * c.length;
  std::vector<double> inertia = node.numbers("inertia");
  if (inertia.size() == 3) inertia = {inertia[0], 0, 0, inertia[1], 0, inertia[2]};
  if (inertia.size() != 6)
    node.fail(fmt::format("inertia has {} numbers; expected 3 (xx yy zz) or 6 (xx xy xz yy yz zz)",
                          inertia.size()));
  for (std::size_t k = 0; k < 6; ++k) shape.inertia[k] = inertia[k] * c.torque;
  const bool weightless =
      std::all_of(shape.inertia.begin(), shape.inertia.end(), [](double x) { return x == 0; });
  if (shape.mass == 0 ? !weightless : !is_inertia(shape.inertia))
    node.fail(
        fmt::format("inertia=\"{}\" is that of no solid body of mass {}; expected positive "
                    "moments, none more than the sum of "
                    "the other two, or zeros with mass 0",
                    node.text("inertia"), node.text("mass")));
  for (const SceneNode& child : node.children({"visual", "collision"})) {
    if (child.name() == "visual") {
      child.check_attributes({}, {"mesh", "pos", "quat"});
      continue;
    }
    child.check_attributes({"contacts", "radius", "count", "pos", "quat"});
    if (!shape.contact_points.empty()) child.fail("given twice; expected once");
    const Pose at = {scaled(child.vector("pos", Vector3{0, 0, 0}), length),
                     child.quaternion("quat")};
    const std::vector<double> points = read_collision(child);
    for (std::size_t k = 0; k < points.size(); k += 3) {
      const Vector3 p =
          outer_point(at, {length * points[k], length * points[k + 1], length * points[k + 2]});
      shape.contact_points.insert(shape.contact_points.end(), p.begin(), p.end());
    }
  }
  return shape;
}

Shape read_shape(const SceneNode& node, Attributes& attributes) {
  const double length = node.context().length;
  switch (node.choice("type",
                      {"sphere", "cuboid", "cylinder", "capsule", "plane", "mesh", "abstract"})) {
    case 0: attributes.use({"radius"}); return SphereShape{node.positive("radius") * length};
    case 1:
      attributes.use({"size", "general_contact_resolution"});
      return read_cuboid(node, length);
    case 2:
      attributes.use({"length", "radius", "general_contact_angle_resolution",
                      "general_contact_radius_resolution"});
      return read_cylinder(node, length);
    case 3:
      attributes.use({"length", "radius", "general_contact_resolution"});
      return read_capsule(node, length);
    case 4: attributes.leave("density"); return PlaneShape{};
    case 5: attributes.use({"filename", "scale", "transform_type"}); return read_mesh(node, length);
    default: break;
  }
  attributes.use({"inertia"});
  attributes.leave("density");
  return read_abstract(node, length);
}

}  // namespace

MeshShape read_mesh(const SceneNode& node, double length) {
  const Vector3 scale = node.vector("scale", Vector3{1, 1, 1});
  for (double s : scale)
    if (!(s > 0)) node.fail(fmt::format("scale has {}; expected positive factors", s));
  MeshShape shape = read_beside(node, "filename", read_obj);
  for (std::size_t k = 0; k < shape.vertices.size(); ++k)
    shape.vertices[k] *= scale[k % 3] * length;
  return shape;
}

BodyDescription read_body(const SceneNode& node) {
  BodyDescription body;
  body.source = node.source();
  body.name = node.text("name");
  Attributes attributes;
  body.shape = read_shape(node, attributes);
  node.check_attributes(attributes.used, {"texture"}, attributes.idle);
  body.pose.position = scaled(node.vector("pos", Vector3{0, 0, 0}), node.context().length);
  body.pose.orientation = node.quaternion("quat");
  body.density = node.positive("density", 1.0) * node.context().density;
  if (node.has("mass") && !std::holds_alternative<AbstractShape>(body.shape)) {
    if (node.number("mass") != 0)
      node.fail("mass=\"" + node.text("mass") + "\"; expected 0 (massless), or a density");
    body.density = 0;
  }
  read_colour(node, body.rgba);
  return body;
}

bool placed_in_world(const SceneNode& node, const BodyDescription& body) {
  if (!std::holds_alternative<MeshShape>(body.shape)) return false;
  const int type = node.choice("transform_type", {"OBJ_TO_JOINT", "OBJ_TO_WORLD", "BODY_TO_JOINT"});
  if (type == 2)
    node.fail(
        "transform_type BODY_TO_JOINT places the mesh by its principal axes, whose directions are "
        "not determined; "
        "supported: OBJ_TO_JOINT, OBJ_TO_WORLD");
  return type == 1;
}

}  // namespace tangere
