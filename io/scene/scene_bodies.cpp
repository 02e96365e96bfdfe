// SPDX-License-Identifier: Apache-2.0
// Reads bodies of a scene file, by type.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/model/scene_number.hpp"
#include "engine/model/shapes.hpp"
#include "io/scene/convex_hull.hpp"
#include "io/scene/scene_sections.hpp"
#include "io/scene/surface_files.hpp"
#include "io/scene/tactile_layouts.hpp"

namespace tangere {

namespace {

constexpr int kLargestResolution = 1000;  // contact points along one edge or around one ring
constexpr int kMostSpread = 4096;         // contact points spread over a mesh

using Names = std::vector<std::string>;

/// The attributes that this element's type uses. The other attributes of bodies have no effect.
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

  Attributes() { idle.insert(idle.end(), kLeftOver.begin(), kLeftOver.end()); }

  Names used = {"name", "type", "pos", "quat", "density", "mass", "rgba"};
  Names idle = {"scale",
                "general_contact_resolution",
                "general_contact_angle_resolution",
                "general_contact_radius_resolution",
                "size",
                "radius",
                "length",
                "filename",
                "hull",
                "transform_type",
                "inertia",
                "mesh",
                "resolution",
                "error",
                "count",
                "pitch"};
};

/// Reads a shape that its size and the numbers of its contact points define completely.
void read_sized(const SceneNode& node, const ShapeRow& row, Shape& shape, Attributes& attributes) {
  const double length = node.context().length;
  for (const SizeNumber& n : row.sizes) {
    if (n.which < 2) {  // radius, length
      const char* const name = number_kind(NumberOwner::body, size_of_body("", n.which).field).name;
      attributes.use({name});
      *n.at(shape) = node.positive(name) * length;
      continue;
    }
    if (n.which == 2) attributes.use({"size"});
    const double edge = scaled(node.vector("size"), length)[std::size_t(n.which - 2)];
    if (!(edge > 0))
      node.fail(fmt::format("size has the edge {} m; expected positive lengths", edge));
    *n.at(shape) = edge;
  }
  for (const PointCounts& c : row.counts) {
    attributes.use({c.attribute});
    std::vector<int> n;
    for (const auto& at : c.at) n.push_back(*at(shape));
    if (n.size() == 1) {
      n[0] = node.integer(c.attribute, c.least, kLargestResolution, n[0]);
    } else {
      n = node.integers(c.attribute, n, c.least, kLargestResolution);
    }
    for (std::size_t k = 0; k < n.size(); ++k) *c.at[k](shape) = n[k];
  }
  if (row.mass == nullptr) attributes.leave("density");
  if (const std::string fault = slenderness_fault(shape); !fault.empty()) node.fail(fault);
}

/// Reads contact points of a <collision> in the scene's unit, from a file or for a hemisphere.
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

/// Appends contact points in the frame `at` of the body, in metres.
void place_points(const std::vector<double>& points, const Pose& at, double length,
                  std::vector<double>& out) {
  for (std::size_t k = 0; k < points.size(); k += 3) {
    const Vector3 p =
        outer_point(at, {length * points[k], length * points[k + 1], length * points[k + 2]});
    out.insert(out.end(), p.begin(), p.end());
  }
}

/// Reads the contact points of an abstract body: those of its attribute `contacts`, which are in
/// the body's frame, or those of its child <collision>.
void read_contact_places(const SceneNode& node, double length, std::vector<double>& out) {
  if (node.has("contacts"))
    place_points(read_beside(node, "contacts", read_contact_points), Pose{}, length, out);
  for (const SceneNode& child : node.children({"visual", "collision"})) {
    if (child.name() == "visual") {
      child.check_attributes({}, {"mesh", "pos", "quat"});
      continue;
    }
    child.check_attributes({"contacts", "radius", "count", "pos", "quat"});
    if (!out.empty())
      child.fail(node.has("contacts") ? "the body has the attribute 'contacts' too; expected one"
                                      : "given twice; expected once");
    place_points(read_collision(child),
                 {scaled(child.vector("pos", Vector3{0, 0, 0}), length), child.quaternion("quat")},
                 length, out);
  }
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
        fmt::format("no solid body of mass {1} has inertia=\"{0}\"; expected positive moments, "
                    "each at most the sum of the other two, or zeros with mass 0",
                    node.text("inertia"), node.text("mass")));
  read_contact_places(node, length, shape.contact_points);
  return shape;
}

/// Reads with which points a mesh touches: with some of its vertices, or with points that are
/// spread over its area. Without a number, it touches with all vertices.
void read_contact_count(const SceneNode& node, double length, MeshShape& mesh) {
  const char* given = nullptr;
  for (const char* name : {"general_contact_resolution", "count", "pitch"}) {
    if (!node.has(name)) continue;
    if (given != nullptr)
      node.fail(fmt::format("both '{}' and '{}'; expected one of them", given, name));
    given = name;
  }
  if (node.has("count")) {
    mesh.contact_points = points_by_area(mesh, node.integer("count", 1, kMostSpread));
    return;
  }
  if (node.has("pitch")) {
    const double pitch = node.positive("pitch") * length, area = area_of(mesh),
                 count = std::round(area / (pitch * pitch));
    if (!(count >= 1 && count <= kMostSpread))
      node.fail(
          fmt::format("a pitch of {:g} m on an area of {:g} m² takes {:g} points; expected 1 "
                      "to {}",
                      pitch, area, count, kMostSpread));
    mesh.contact_points = points_by_area(mesh, static_cast<int>(count));
    return;
  }
  if (!node.has("general_contact_resolution")) return;
  const auto vertices = static_cast<int>(mesh.vertices.size() / 3);
  const int count = node.integer("general_contact_resolution", 1, kLargestResolution);
  if (count > vertices)
    node.fail(
        fmt::format("general_contact_resolution=\"{}\"; expected at most the {} vertices of "
                    "the mesh",
                    count, vertices));
  mesh.contact_points = spread_points(mesh.vertices, count);
}

/// Reads a mesh that the scene itself gives: x y z of each vertex, and three of them, from 0, for
/// each triangle.
MeshShape read_written_mesh(const SceneNode& node, bool hull) {
  if (node.has("filename")) node.fail("both 'filename' and 'vertices'; expected one of them");
  RawMesh raw;
  const std::vector<double> at = node.numbers("vertices");
  if (at.size() % 3 != 0)
    node.fail(fmt::format("vertices has {} numbers; expected x y z for each", at.size()));
  for (std::size_t k = 0; k < at.size(); k += 3)
    raw.positions.push_back({at[k], at[k + 1], at[k + 2]});
  const std::vector<double> corners =
      node.has("triangles") ? node.numbers("triangles") : std::vector<double>{};
  if (corners.size() % 3 != 0)
    node.fail(fmt::format("triangles has {} numbers; expected three for each", corners.size()));
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const auto vertex = static_cast<int>(std::clamp(corners[k], -1.0, 1e9));
    if (vertex != corners[k] || vertex < 0 || std::size_t(vertex) >= raw.positions.size())
      node.fail(fmt::format("triangles has the vertex {}; expected one of 0 to {}", corners[k],
                            raw.positions.size() - 1));
    if (k % 3 == 0) raw.triangles.emplace_back();
    raw.triangles.back()[k % 3] = vertex;
  }
  const FileSurface surface = surface_of(raw, "vertices");
  if (!hull && !surface.fault.empty()) node.fail(surface.fault);
  MeshShape out = hull ? convex_hull(surface.points) : surface.closed;
  if (out.triangles.empty())
    node.fail("all vertices lie in a plane; expected a hull with a volume");
  return out;
}

Shape read_shape(const SceneNode& node, Attributes& attributes) {
  const double length = node.context().length;
  Names names;
  for (const ShapeRow& row : shape_rows()) names.emplace_back(row.name);
  const ShapeRow& row = shape_rows()[std::size_t(node.choice("type", names))];
  Shape shape = row.make();
  if (std::holds_alternative<MeshShape>(shape)) {
    attributes.use({"filename", "vertices", "triangles", "scale", "hull", "transform_type",
                    "general_contact_resolution", "resolution", "error", "count", "pitch"});
    MeshShape mesh = read_mesh(node, length);
    mesh.resolution = node.integer("resolution", 0, MeshShape::kMostCells, mesh.resolution);
    if (node.has("error")) {
      if (node.has("resolution"))
        node.fail("error chooses the cells; expected error or resolution, not both");
      mesh.error = node.positive("error", 1.0) * length;
    }
    read_contact_count(node, length, mesh);
    return mesh;
  }
  if (std::holds_alternative<AbstractShape>(shape)) {
    attributes.use({"inertia", "contacts", "mesh"});
    attributes.leave("density");
    return read_abstract(node, length);
  }
  read_sized(node, row, shape, attributes);
  return shape;
}

}  // namespace

MeshShape read_mesh(const SceneNode& node, double length) {
  const Vector3 scale = node.vector("scale", Vector3{1, 1, 1});
  for (const double s : scale)
    if (s == 0) node.fail("scale has 0; expected factors other than 0");
  const bool hull = node.has("hull") && node.choice("hull", {"true", "false"}) == 0;
  MeshShape shape = node.has("vertices")
                        ? read_written_mesh(node, hull)
                        : read_beside(node, "filename", hull ? read_hull : read_surface);
  scale_surface(shape, scaled(scale, length));
  return shape;
}

BodyDescription read_body(const SceneNode& node) {
  BodyDescription body;
  body.source = node.source();
  body.name = node.text("name", "");
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
