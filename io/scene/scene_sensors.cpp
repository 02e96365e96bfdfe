// SPDX-License-Identifier: Apache-2.0
// Reads sensors of a scene file, by layout, and which of their readings are wanted.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/model/field_form.hpp"
#include "engine/model/sensed_bodies.hpp"
#include "io/files/name_list.hpp"
#include "io/files/nearest_name.hpp"
#include "io/scene/scene_sections.hpp"
#include "io/scene/tactile_layouts.hpp"

namespace tangere {
namespace {

constexpr int kLargestArray = 4096;  // rows or columns of a tactile array
constexpr double kFlatness = 1e-4;   // distance of a corner from an array's plane, by its diagonal
const std::vector<std::string> kTypes = {"rect_array", "abstract", "hemisphere", "cylinder",
                                         "mesh"};
using Names = std::vector<std::string>;

/// Attributes that only some layouts use, each with these layouts.
Names attributes_of(int type) {
  switch (type) {
    case 0: return {"rect_pos0", "rect_pos1", "axis0", "axis1", "resolution", "pos", "quat"};
    case 1: return {"spec", "pos", "quat"};
    case 2: return {"radius", "count", "resolution", "pos", "quat"};
    case 3: return {"radius", "length", "resolution", "pos", "quat"};
    default: return {"filename", "pitch", "scale", "pos", "quat"};
  }
}

void check_attributes(const SceneNode& node, int type) {
  Names used = with_coefficients({"name", "body", "type", "law", "every", "pressure_sign",
                                  "feedback", "memory", "feels", "ignores"}),
        idle;
  const Names own = attributes_of(type);
  used.insert(used.end(), own.begin(), own.end());
  for (int other = 0; other < static_cast<int>(kTypes.size()); ++other)
    for (const std::string& name : attributes_of(other))
      if (std::find(used.begin(), used.end(), name) == used.end() &&
          std::find(idle.begin(), idle.end(), name) == idle.end())
        idle.push_back(name);
  node.check_attributes(used, {"render"}, idle);
}

/// Reads rows and columns.
std::array<int, 2> read_resolution(const SceneNode& node) {
  const std::vector<double> n = node.numbers("resolution", 2);
  for (double k : n)
    if (k != std::floor(k) || k < 1 || k > kLargestArray)
      node.fail(fmt::format("resolution has {}; expected integers from 1 to {}", k, kLargestArray));
  return {static_cast<int>(n[0]), static_cast<int>(n[1])};
}

/// Refuses corners of which the second does not lie in the plane of the axes through the first.
void check_in_plane(const SceneNode& node, const RectArray& array) {
  const Vector3 &a = array.axis0, &b = array.axis1;
  const Vector3 normal = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                          a[0] * b[1] - a[1] * b[0]};
  double off = 0, square = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double way = array.corner1[i] - array.corner0[i];
    off += way * normal[i];
    square += way * way;
  }
  if (std::abs(off) > kFlatness * std::sqrt(square))
    node.fail(fmt::format(
        "rect_pos1=\"{}\" lies {:.3g} m outside the plane of axis0 and axis1 through rect_pos0; "
        "expected it in this plane",
        node.text("rect_pos1"), std::abs(off)));
}

RectArray read_array(const SceneNode& node) {
  const double length = node.context().length;
  RectArray array;
  array.corner0 = scaled(node.vector("rect_pos0"), length);
  array.corner1 = scaled(node.vector("rect_pos1"), length);
  array.axis0 = node.direction("axis0");
  array.axis1 = node.direction("axis1");
  double slant = 0;
  for (int i = 0; i < 3; ++i) slant += array.axis0[i] * array.axis1[i];
  if (std::abs(slant) > 1e-6) node.fail("axis0 and axis1 are not perpendicular");
  check_in_plane(node, array);
  const auto [rows, cols] = read_resolution(node);
  array.rows = rows, array.cols = cols;
  if (!node.has("pos") && !node.has("quat")) return array;
  const Pose pose{scaled(node.vector("pos", Vector3{0, 0, 0}), length), node.quaternion("quat")};
  for (Vector3* corner : {&array.corner0, &array.corner1}) *corner = outer_point(pose, *corner);
  for (Vector3* axis : {&array.axis0, &array.axis1}) *axis = outer_direction(pose, *axis);
  return array;
}

std::vector<TactilePoint> read_spec(const SceneNode& node, double length) {
  std::vector<TactilePoint> points = read_beside(node, "spec", read_tactile_points);
  for (TactilePoint& p : points) p.position = scaled(p.position, length);
  return points;
}

std::vector<TactilePoint> read_surface(const SceneNode& node, double length) {
  const MeshShape mesh = read_mesh(node, length);
  const double pitch = node.positive("pitch") * length;
  std::vector<TactilePoint> points = mesh_points(mesh, pitch, kMostPoints);
  if (points.empty())
    node.fail(fmt::format("pitch of {} m: more than {} points; expected a larger one", pitch,
                          kMostPoints));
  return points;
}

/// Reads a hemisphere. With a resolution, every point gets a pixel of its own.
std::vector<TactilePoint> read_hemisphere(const SceneNode& node, double radius) {
  std::vector<TactilePoint> points =
      hemisphere_points(radius, node.integer("count", 1, kMostPoints));
  if (!node.has("resolution")) return points;
  const auto [rows, cols] = read_resolution(node);
  if (static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols) < points.size())
    node.fail(
        fmt::format("resolution=\"{}\" has {} pixels for {} points; expected one for each at least",
                    node.text("resolution"), rows * cols, points.size()));
  draw_hemisphere(rows, cols, points);
  return points;
}

std::vector<TactilePoint> read_points(const SceneNode& node, int type) {
  const double length = node.context().length;
  const auto points = [&] {
    if (type == 1) return read_spec(node, length);
    if (type == 4) return read_surface(node, length);
    const double radius = node.positive("radius") * length;
    if (type == 2) return read_hemisphere(node, radius);
    const auto [along, around] = read_resolution(node);
    return cylinder_points(radius, node.positive("length") * length, along, around);
  };
  std::vector<TactilePoint> all = points();
  move_points({scaled(node.vector("pos", Vector3{0, 0, 0}), length), node.quaternion("quat")}, all);
  return all;
}

double factor_of(const SceneContext& context, std::string_view unit) {
  return unit == "N" ? context.force : context.factor(unit);
}

/// Reads a coefficient of one or two numbers: for the third component of a field and for the first
/// two.
NormalAndShear read_coefficient(const SceneNode& node, const ImperfectionKind& kind) {
  if (!node.has(kind.name)) return {};
  const std::vector<double> x = node.numbers(kind.name);
  const std::size_t most = kind.pair != nullptr ? 2 : 1;
  if (x.empty() || x.size() > most)
    node.fail_at(kind.name,
                 fmt::format("{}=\"{}\" has {} numbers; expected {}", kind.name,
                             node.text(kind.name), x.size(), most == 2 ? "1 or 2" : "1"));
  return {x.front(), x.back()};
}

void read_imperfections(const SceneNode& node, const SceneNode& part, TactileDescription& sensor) {
  std::vector<std::string> names;
  for (const ImperfectionKind& kind : imperfection_kinds()) names.emplace_back(kind.name);
  part.check_attributes(names);
  SensorImperfections& of = sensor.imperfections;
  of.source = part.source();
  for (const ImperfectionKind& kind : imperfection_kinds()) {
    const NormalAndShear value = read_coefficient(part, kind);
    const double factor = factor_of(node.context(), kind.unit);
    if (kind.pair != nullptr)
      of.*kind.pair = {factor * value.normal, factor * value.shear};
    else
      of.*kind.number = factor * value.normal;
  }
  check_imperfections(of, sensor.name, sensor.points.empty());
}

void read_markers(const SceneNode& node, const SceneNode& part, TactileDescription& sensor) {
  part.check_attributes({"stiffness", "thickness", "spread"});
  MarkersDescription of;
  of.source = part.source();
  const auto read = [&](const char* name, double factor) {
    return part.has(name) ? factor * part.positive(name) : 0;
  };
  of.stiffness = read("stiffness", factor_of(node.context(), "N/m"));
  of.thickness = read("thickness", node.context().length);
  of.spread = read("spread", node.context().length);
  sensor.markers = of;
}

/// Reads what <tactile> holds, each at most once.
void read_parts(const SceneNode& node, TactileDescription& sensor) {
  bool imperfections = false;
  for (const SceneNode& part : node.children({"imperfections", "markers"})) {
    const bool marks = part.name() == "markers";
    if (marks ? sensor.markers.has_value() : imperfections)
      part.fail("a second time in one <tactile>; expected one");
    if (marks)
      read_markers(node, part, sensor);
    else
      read_imperfections(node, part, sensor), imperfections = true;
  }
}

/// Lets the points of a sensor touch what they feel: a pair with every body that it feels.
void add_feedback(Scene& scene, const SceneNode& node, const TactileDescription& d) {
  if (d.coefficients.ks != 0)
    node.fail(
        "feedback and ks: a contact and the reading of its skin would each remember a touch "
        "in their own way; expected one of them");
  PairContactDescription pair;
  for (const TactilePoint& p : tactile_points(d)) {
    if (p.factors != TactilePoint{}.factors)
      node.fail(
          "feedback needs points with the sensor's own coefficients, and this layout has "
          "factors of them");
    pair.points.insert(pair.points.end(), p.position.begin(), p.position.end());
  }
  pair.general_body = d.body;
  pair.sensor = d.name;
  pair.coefficients = d.coefficients;
  pair.law = d.law;
  pair.source = d.source;
  const std::vector<int> felt = sensed_bodies(scene, d);
  for (const int other : felt) {
    const BodyDescription& touched = scene.links[std::size_t(other)].body;
    for (const PairContactDescription& c : scene.pair_contacts)
      if (c.points.empty() && c.general_body == d.body && c.primitive_body == touched.name)
        node.context().warnings.push_back(fmt::format(
            "{}<general_primitive_contact>: '{}' and '{}' touch by the body's points and by those "
            "of its tactile sensor '{}', which has feedback. Where both lie, the contact is as "
            "many times stiffer, and the field shows its own share alone",
            c.source.prefix(), d.body, touched.name, d.name));
    pair.primitive_body = touched.name;
    scene.pair_contacts.push_back(pair);
  }
  if (felt.empty())
    node.fail(
        fmt::format("feedback of '{}' would touch nothing; expected a body with a distance "
                    "that moves against '{}'",
                    d.name, d.body));
}

/// Reads names between commas; blanks beside a comma do not count.
Names body_names(const SceneNode& node, const char* attribute) {
  Names names =
      split_names(node.source().prefix() + "<tactile>: " + attribute, node.text(attribute));
  for (std::string& name : names) {
    name.erase(0, std::min(name.find_first_not_of(' '), name.size()));
    name.erase(name.find_last_not_of(' ') + 1);
  }
  return names;
}

}  // namespace

void read_sensors(Scene& scene, const SceneNode& section) {
  section.check_attributes({});
  for (const SceneNode& node : section.children({"tactile"})) {
    TactileDescription d;
    d.source = node.source();
    find_body(scene, node, "body");
    d.body = node.text("body");
    d.name = node.text("name", d.body);
    if (d.name.find('/') != std::string::npos)
      node.fail("name \"" + d.name + "\" holds '/', which files use as a separator");
    for (const TactileDescription& other : scene.sensors)
      if (other.name == d.name) node.fail("tactile name '" + d.name + "' is used twice");
    const int type = node.choice("type", kTypes);
    check_attributes(node, type);
    constexpr ContactLaw kTactileLaws[] = {ContactLaw::clamped, ContactLaw::paper};
    d.law = kTactileLaws[node.choice("law", {"clamped", "paper"}, 0)];
    d.coefficients = read_coefficients(node, d.law);
    d.every = node.integer("every", 1, 1000000000, 0);
    d.remembers_readings = node.choice("memory", {"step", "read"}, 0) == 1;
    if (d.remembers_readings && d.every == 0)
      node.fail(
          "memory=\"read\" without every; expected both: memory advances every so many steps");
    if (node.has("pressure_sign")) {
      const double sign = node.number("pressure_sign");
      if (sign != 1 && sign != -1)
        node.fail(fmt::format("pressure_sign=\"{}\"; expected 1 or -1", sign));
      d.pressure_sign = static_cast<int>(sign);
    }
    if (type == 0) {
      d.array = read_array(node);
    } else {
      d.points = read_points(node, type);
    }
    read_parts(node, d);
    for (const auto& [name, list] : {std::pair{"feels", &d.feels}, {"ignores", &d.ignores}})
      if (node.has(name)) *list = body_names(node, name);
    static_cast<void>(sensed_bodies(scene, d));  // checks the names
    if (node.choice("feedback", {"false", "true"}, 0) == 1) add_feedback(scene, node, d);
    scene.sensors.push_back(std::move(d));
  }
}

void read_outputs(Scene& scene, const SceneNode& section) {
  section.check_attributes({"record"});
  OutputsDescription outputs;
  outputs.source = section.source();
  outputs.record =
      split_names(section.source().prefix() + "<outputs>: record", section.text("record"));
  const std::vector<std::string> sensors = sensor_names(scene);
  for (const std::string& word : outputs.record) {
    std::string name;
    try {
      name = split_times(word).name;
    } catch (const InputError& error) {
      section.fail(fmt::format("record has {}", error.what()));
    }
    if (const std::optional<FieldOutput> of = find_output(sensors, name)) {
      if (const std::string reason = reason_against(scene, *of); !reason.empty())
        section.fail(fmt::format("record has '{}', but {}", word, reason));
    } else if (!is_plain_output(name) && !find_body_output(scene, name)) {
      section.fail(fmt::format("record has '{}'{}", name, suggestion(name, output_names(scene))));
    }
  }
  scene.outputs = std::move(outputs);
}

}  // namespace tangere
