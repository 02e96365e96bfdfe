// SPDX-License-Identifier: Apache-2.0
// Reads bodies of a scene file, by type.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/scene/outer_pose.hpp"
#include "engine/scene/scene_faults.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/schema.hpp"
#include "engine/scene/shapes.hpp"
#include "io/scene/convex_hull.hpp"
#include "io/scene/scene_sections.hpp"
#include "io/scene/surface_files.hpp"
#include "io/scene/tactile_layouts.hpp"

namespace tangere {

namespace {

/// Reads a shape that its size and the numbers of its contact points define completely.
void read_sized(const SceneElement& node, const ShapeRow& row, Shape& shape) {
  for (const SizeNumber& n : row.sizes) {
    const SceneNumber number = size_of_body("", n.which);
    const char* const name = number_kind(number.owner, number.field).name;
    *n.at(shape) = number.field == NumberField::size
                       ? node.vector(name)[std::size_t(number.component)]
                       : node.number(name);
  }
  for (const PointCounts& c : row.counts) {
    std::vector<int> n;
    for (const auto& at : c.at) n.push_back(*at(shape));
    n = node.integers(c.attribute, n, c.least, int(node.row(c.attribute).most));
    for (std::size_t k = 0; k < n.size(); ++k) *c.at[k](shape) = n[k];
  }
}

/// Reads the file of contact points that an element names [m].
std::vector<double> read_points_beside(const SceneNode& node) {
  std::vector<double> points = read_beside(node, "contacts", read_contact_points);
  for (double& x : points) x *= node.context().length;
  return points;
}

/// Reads contact points of a <collision>, from a file or for a hemisphere [m].
std::vector<double> read_collision(const SceneElement& node) {
  const bool generated = node.has("radius") || node.has("count");
  if (generated == node.has("contacts"))
    node.fail(
        fmt::format("{}; expected 'contacts' (a file), or 'radius' and 'count' (a hemisphere)",
                    generated ? "both 'contacts' and a hemisphere" : "no contact points"));
  if (!generated) return read_points_beside(node);
  std::vector<double> points;
  for (const TactilePoint& p : hemisphere_points(node.number("radius"), node.integer("count")))
    points.insert(points.end(), p.position.begin(), p.position.end());
  return points;
}

/// Reads the contact points of an abstract body: those of its attribute `contacts`, which are in
/// the body's frame, or those of its child <collision>.
void read_contact_places(const SceneNode& node, std::vector<double>& out) {
  if (node.has("contacts")) out = read_points_beside(node);
  for (const SceneNode& child : children_of(node)) {
    const SceneElement part(child, child.name() == "visual" ? kVisual : kCollision);
    part.check();
    if (part.of() == kVisual) continue;
    if (!out.empty())
      part.fail(node.has("contacts") ? "the body has the attribute 'contacts' too; expected one"
                                     : "given twice; expected once");
    Pose at;
    part.read(at);
    const std::vector<double> points = read_collision(part);
    for (std::size_t k = 0; k < points.size(); k += 3) {
      const Vector3 p = outer_point(at, {points[k], points[k + 1], points[k + 2]});
      out.insert(out.end(), p.begin(), p.end());
    }
  }
}

AbstractShape read_abstract(const SceneElement& node) {
  AbstractShape shape;
  shape.mass = node.number("mass");
  std::vector<double> inertia = node.numbers("inertia");
  if (inertia.size() == 3) inertia = {inertia[0], 0, 0, inertia[1], 0, inertia[2]};
  if (inertia.size() != 6)
    node.fail(fmt::format("inertia has {} numbers; expected 3 (xx yy zz) or 6 (xx xy xz yy yz zz)",
                          inertia.size()));
  std::copy(inertia.begin(), inertia.end(), shape.inertia.begin());
  read_contact_places(node, shape.contact_points);
  return shape;
}

/// Reads with which points a mesh touches: with some of its vertices, or with points that are
/// spread over its area. Without a number, it touches with all vertices.
void read_contact_count(const SceneElement& node, MeshShape& mesh) {
  const char* given = nullptr;
  for (const char* name : {"general_contact_resolution", "count", "pitch"}) {
    if (!node.has(name)) continue;
    if (given != nullptr)
      node.fail(fmt::format("both '{}' and '{}'; expected one of them", given, name));
    given = name;
  }
  if (node.has("count")) {
    mesh.contact_points = points_by_area(mesh, node.integer("count"));
    return;
  }
  if (node.has("pitch")) {
    const double pitch = node.number("pitch"), area = area_of(mesh),
                 count = std::round(area / (pitch * pitch)), most = node.row("count").most;
    if (!(count >= 1 && count <= most))
      node.fail(
          fmt::format("a pitch of {:g} m on an area of {:g} m² takes {:g} points; expected 1 "
                      "to {}",
                      pitch, area, count, most));
    mesh.contact_points = points_by_area(mesh, static_cast<int>(count));
    return;
  }
  if (!node.has("general_contact_resolution")) return;
  const auto vertices = static_cast<int>(mesh.vertices.size() / 3);
  const int count = node.integer("general_contact_resolution");
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

Shape read_shape(const SceneElement& node, const ShapeRow& row) {
  Shape shape = row.make();
  if (std::holds_alternative<MeshShape>(shape)) {
    MeshShape mesh = read_mesh(node);
    mesh.resolution = node.integer("resolution");
    if (node.has("error")) {
      if (node.has("resolution"))
        node.fail("error chooses the cells; expected error or resolution, not both");
      mesh.error = node.number("error");
    }
    read_contact_count(node, mesh);
    return mesh;
  }
  if (std::holds_alternative<AbstractShape>(shape)) return read_abstract(node);
  read_sized(node, row, shape);
  return shape;
}

}  // namespace

MeshShape read_mesh(const SceneNode& node) {
  const Vector3 scale = node.vector("scale", Vector3{1, 1, 1});
  for (const double s : scale)
    if (s == 0) node.fail("scale has 0; expected factors other than 0");
  const bool hull = node.has("hull") && node.choice("hull", {"true", "false"}) == 0;
  MeshShape shape = node.has("vertices")
                        ? read_written_mesh(node, hull)
                        : read_beside(node, "filename", hull ? read_hull : read_surface);
  scale_surface(shape, scaled(scale, node.context().length));
  return shape;
}

BodyDescription read_body(const SceneNode& child) {
  const SceneElement node(child, kBody);
  BodyDescription body;
  body.source = node.source();
  body.name = node.text("name", "");
  std::vector<std::string> names;
  for (const ShapeRow& row : shape_rows()) names.emplace_back(row.name);
  const ShapeRow& row = shape_rows()[std::size_t(node.choice("type", names))];
  node.check(row.name);
  body.shape = read_shape(node, row);
  node.refuse(body_fault(body));
  node.read(body.pose);
  node.read(body, false, row.name);
  if (node.has("mass") && !std::holds_alternative<AbstractShape>(body.shape)) {
    if (node.number("mass") != 0)
      node.fail("mass=\"" + node.text("mass") + "\"; expected 0 (massless), or a density");
    body.density = 0;
  }
  return body;
}

bool placed_in_world(const SceneNode& node, const BodyDescription& body) {
  if (!std::holds_alternative<MeshShape>(body.shape)) return false;
  const std::size_t type = SceneElement(node, kBody).word("transform_type");
  if (type == 2)
    node.fail(
        "transform_type BODY_TO_JOINT places the mesh by its principal axes, whose directions are "
        "not determined; "
        "supported: OBJ_TO_JOINT, OBJ_TO_WORLD");
  return type == 1;
}

}  // namespace tangere
