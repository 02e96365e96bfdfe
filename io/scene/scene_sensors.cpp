// SPDX-License-Identifier: Apache-2.0
// Reads sensors of a scene file, by layout, and which of their readings are requested.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/scene/field_form.hpp"
#include "engine/scene/imperfection_checks.hpp"
#include "engine/scene/outer_pose.hpp"
#include "engine/scene/sensed_bodies.hpp"
#include "engine/scene/sensor_contacts.hpp"
#include "engine/scene/skin_material.hpp"
#include "io/files/name_list.hpp"
#include "io/files/nearest_name.hpp"
#include "io/scene/channel_file.hpp"
#include "io/scene/gel_file.hpp"
#include "io/scene/scene_cameras.hpp"
#include "io/scene/scene_sections.hpp"
#include "io/scene/tactile_layouts.hpp"

namespace tangere {
namespace {

constexpr double kFlatness = 1e-4;  // distance of a corner from an array's plane, by its diagonal

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

RectArray read_array(const SceneElement& node) {
  RectArray array;
  array.corner0 = node.vector("rect_pos0");
  array.corner1 = node.vector("rect_pos1");
  array.axis0 = node.direction("axis0");
  array.axis1 = node.direction("axis1");
  double slant = 0;
  for (int i = 0; i < 3; ++i) slant += array.axis0[i] * array.axis1[i];
  if (std::abs(slant) > 1e-6) node.fail("axis0 and axis1 are not perpendicular");
  check_in_plane(node, array);
  const std::vector<double> counts = node.numbers("resolution", 2);
  array.rows = int(counts[0]), array.cols = int(counts[1]);
  if (!node.has("pos") && !node.has("quat")) return array;
  Pose pose;
  node.read(pose);
  for (Vector3* corner : {&array.corner0, &array.corner1}) *corner = outer_point(pose, *corner);
  for (Vector3* axis : {&array.axis0, &array.axis1}) *axis = outer_direction(pose, *axis);
  return array;
}

/// Returns the area for which a point of an array stands [m²].
double cell_of(const SceneElement& node, const RectArray& a) {
  const Vector3 way = a.corner1 - a.corner0;
  const double cell =
      std::abs(dot(way, a.axis0) * dot(way, a.axis1)) / ((a.rows - 1.0) * (a.cols - 1.0));
  if (!(cell > 0) || !std::isfinite(cell))
    node.fail(
        fmt::format("per=\"area\" with {} x {} points; expected rows and columns that cover "
                    "an area",
                    a.rows, a.cols));
  return cell;
}

/// The same of a hemisphere 2 π r² or of a cylinder 2 π r l with n points.
double cell_of(const SceneElement& node, const std::string& type, std::size_t n) {
  const double r = node.number("radius");
  return 2 * std::numbers::pi * r * (type == "hemisphere" ? r : node.number("length")) / double(n);
}

/// Turns coefficients by area into those of points that stand for `cell` [m²]. Those that the
/// element does not give itself follow from its material or its table, if it has one.
void share_area(const SceneElement& node, double cell, TactileDescription& d) {
  d.cell = cell;
  std::optional<ContactCoefficients> springs;
  if (d.material) springs = skin_springs(*d.material);
  if (d.table) springs.emplace().kn = d.table->stiffness();
  static constexpr const char* kNames[] = {"kn", "kt", "mu", "damping", "ks"};
  for (std::size_t k = 0; k < kCoefficients; ++k) {
    if (!scales_with_area(k)) continue;
    if (springs && !node.gives(kNames[k]))
      d.coefficients[k] = (*springs)[k] * cell;
    else
      d.coefficients[k] *= node.context().area(cell);
  }
}

void refuse_per_point(const SceneElement& node, const char* with) {
  if (node.has("per") && node.text("per") == "point")
    node.fail(fmt::format(
        "{} and per=\"point\": a skin's coefficients count per area; expected one of them", with));
}

/// Reads `pressure` and `pressure_depth`, with `thickness` and `relaxation`, if they are there.
std::optional<PressureTable> read_pressures(const SceneElement& node, const std::string& type) {
  if (!node.row("pressure").serves(type)) return std::nullopt;
  if (node.has("pressure") != node.has("pressure_depth"))
    node.fail("pressure or pressure_depth alone; expected both or none");
  if (!node.has("pressure")) return std::nullopt;
  if (node.has("modulus")) node.fail("modulus and pressure; expected one of them");
  refuse_per_point(node, "pressure");
  PressureTable table{.depth = node.numbers("pressure_depth"),
                      .pressure = node.numbers("pressure"),
                      .relaxation = node.number("relaxation")};
  if (node.has("thickness")) table.thickness = node.number("thickness");
  if (table.depth.size() < 2 || table.depth.size() != table.pressure.size())
    node.fail(fmt::format("{} numbers of pressure_depth and {} of pressure; expected as many",
                          table.depth.size(), table.pressure.size()));
  if (const auto last = table.pressure.end() - 1; last[0] == last[-1] && last[0] > 0)
    node.warn(
        fmt::format("pressure ends level: {} Pa from {} m on, so a body that goes deeper "
                    "presses no harder; expected a last pressure above the one before",
                    last[0], table.depth.end()[-2]));
  return table;
}

/// Reads `modulus`, `thickness` and `relaxation`, if there are any.
std::optional<SkinMaterial> read_material(const SceneElement& node, const std::string& type) {
  if (!node.row("modulus").serves(type)) return std::nullopt;
  if (!node.has("modulus")) {
    if (node.has("pressure")) return std::nullopt;
    for (const char* part : {"thickness", "relaxation"})
      if (node.has(part)) node.fail(fmt::format("{} without modulus; expected both", part));
    return std::nullopt;
  }
  if (!node.has("thickness")) node.fail("modulus without thickness; expected both");
  refuse_per_point(node, "modulus");
  SkinMaterial material;
  node.read(material, false, type);
  return material;
}

std::vector<TactilePoint> read_spec(const SceneElement& node) {
  std::vector<TactilePoint> points = read_beside(node, "spec", read_tactile_points);
  for (TactilePoint& p : points) p.position = scaled(p.position, node.context().length);
  return points;
}

/// Reads the points that an element itself has.
std::vector<TactilePoint> read_list(const SceneElement& node) {
  constexpr std::size_t kNumbers = 9;
  const std::vector<double> x = node.numbers("points");
  if (x.empty() || x.size() % kNumbers != 0)
    node.fail(fmt::format(
        "points has {} numbers; expected position, normal and axis0 of each, three numbers each",
        x.size()));
  std::vector<TactilePoint> points;
  for (std::size_t k = 0; k < x.size(); k += kNumbers) {
    const auto three = [&](std::size_t i) { return Vector3{x[k + i], x[k + i + 1], x[k + i + 2]}; };
    const Vector3 normal = three(3), across = cross(normal, three(6));
    if (!(dot(across, across) > 0))
      node.fail(
          fmt::format("points: the normal and axis0 of point {} have no length or lie along "
                      "each other; expected two directions",
                      k / kNumbers));
    points.push_back(listed_point(node.context().length * three(0), unit(normal), unit(across)));
  }
  return points;
}

std::vector<TactilePoint> read_surface(const SceneElement& node) {
  const MeshShape mesh = read_mesh(node);
  const double pitch = node.number("pitch");
  const int most = static_cast<int>(node.row("count").most);
  std::vector<TactilePoint> points = mesh_points(mesh, pitch, most);
  if (points.empty())
    node.fail(
        fmt::format("pitch of {} m: more than {} points; expected a larger one", pitch, most));
  return points;
}

/// Reads a hemisphere. With a resolution, every point gets a pixel of its own.
std::vector<TactilePoint> read_hemisphere(const SceneElement& node) {
  std::vector<TactilePoint> points =
      hemisphere_points(node.number("radius"), node.integer("count"));
  if (!node.has("resolution")) return points;
  const std::vector<double> counts = node.numbers("resolution", 2);
  const int rows = int(counts[0]), cols = int(counts[1]);
  if (static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols) < points.size())
    node.fail(
        fmt::format("resolution=\"{}\" has {} pixels for {} points; expected one for each at least",
                    node.text("resolution"), rows * cols, points.size()));
  draw_hemisphere(rows, cols, points);
  return points;
}

std::vector<TactilePoint> read_points(const SceneElement& node, const std::string& type) {
  std::vector<TactilePoint> points;
  if (type == "abstract") points = node.has("points") ? read_list(node) : read_spec(node);
  if (type == "mesh") points = read_surface(node);
  if (type == "hemisphere") points = read_hemisphere(node);
  if (type == "cylinder") {
    const std::vector<double> n = node.numbers("resolution", 2);
    points = cylinder_points(node.number("radius"), node.number("length"), int(n[0]), int(n[1]));
  }
  Pose at;
  node.read(at);
  move_points(at, points);
  return points;
}

PictureDescription read_picture(const SceneElement& node) {
  PictureDescription picture;
  node.read(picture);
  picture.source = node.source();
  if (node.has("size")) {
    const std::vector<double> size = node.numbers("size", 2);
    picture.size = {size[0], size[1]};
  }
  picture.mirror = node.word("mirror") == 1;
  if (node.has("markers")) {
    const std::vector<double> counts = node.numbers("markers", 2);
    picture.markers = {int(counts[0]), int(counts[1])};
  } else {
    for (const char* const name : {"marker_pitch", "marker_radius"})
      if (node.has(name))
        node.fail(fmt::format("{} without markers; expected markers=\"COLUMNS ROWS\"", name));
  }
  const auto read = [&](const std::string& path) {
    return read_gel(path, node.context().outermost().warnings);
  };
  picture.gel =
      std::make_shared<const Gel>(node.has("gel") ? read_beside(node, "gel", read) : default_gel());
  return picture;
}

/// Warns of a gel whose background shows another size than the picture.
void check_gel_size(const SceneElement& node, const TactileDescription& d) {
  constexpr double kMostApart = 0.2;
  const PictureDescription& picture = *d.picture;
  const Gel& gel = *picture.gel;
  if (gel.pixel == 0 || !d.points.empty()) return;
  const RectArray& a = d.array;
  const Vector3 way = a.corner1 - a.corner0;
  const std::array<double, 2> shown = shown_size(
      picture, a.rows, a.cols,
      {dot(way, a.axis0) / std::max(a.rows - 1, 1), dot(way, a.axis1) / std::max(a.cols - 1, 1)});
  const std::array<double, 2> whole{gel.pixel * gel.background.rows,
                                    gel.pixel * gel.background.cols};
  if (std::abs(whole[0] - shown[0]) <= kMostApart * shown[0] &&
      std::abs(whole[1] - shown[1]) <= kMostApart * shown[1])
    return;
  constexpr double kMillimetre = 1e-3;
  node.warn(fmt::format(
      "the picture shows {:.3g} x {:.3g} mm, and the background of the gel '{}', by its pixel, "
      "{:.3g} x {:.3g} mm; the background is stretched to the picture. Expected a size within {} %",
      shown[0] / kMillimetre, shown[1] / kMillimetre, gel.name, whole[0] / kMillimetre,
      whole[1] / kMillimetre, 100 * kMostApart));
}

ChannelsDescription read_channels(const SceneElement& node) {
  ChannelsDescription channels;
  node.read(channels);
  channels.source = node.source();
  channels.map =
      std::make_shared<const ChannelMap>(read_beside(node, "file", [&](const std::string& path) {
        return read_channel_map(path, node.context().outermost().warnings);
      }));
  return channels;
}

/// Reads what <tactile> holds, each at most once.
void read_parts(const SceneNode& node, TactileDescription& sensor) {
  std::vector<std::string> found;
  for (const SceneNode& part : children_of(node)) {
    if (std::ranges::count(found, part.name()) > 0)
      part.fail("a second time in one <tactile>; expected one");
    found.push_back(part.name());
    const bool marks = part.name() == "markers", couples = part.name() == "layer",
               shows = part.name() == "picture", returns = part.name() == "channels";
    const SceneElement element(part, marks     ? kMarkers
                                     : couples ? kLayer
                                     : shows   ? kGelPicture
                                     : returns ? kChannels
                                               : kImperfections);
    element.check();
    if (marks) {
      element.read(sensor.markers.emplace());
      sensor.markers->source = part.source();
    } else if (couples) {
      element.read(sensor.layer.emplace());
      sensor.layer->source = part.source();
      sensor.layer->feedback = element.word("feedback") == 1;
      sensor.layer->load_control = element.word("load") == 1;
    } else if (shows) {
      sensor.picture = read_picture(element);
      check_gel_size(element, sensor);
    } else if (returns) {
      sensor.channels = read_channels(element);
    } else {
      element.read(sensor.imperfections);
      sensor.imperfections.source = part.source();
      check_imperfections(sensor.imperfections, sensor.name, sensor.points.empty());
    }
  }
}

/// Whether a declared contact is one of two bodies.
bool is_contact_of(const PairContactDescription& c, const std::string& one,
                   const std::string& other) {
  return c.sensor.empty() && !c.second_half &&
         ((c.general_body == one && c.primitive_body == other) ||
          (c.general_body == other && c.primitive_body == one && c.per_area()));
}

const char* element_of(const PairContactDescription& c) {
  return c.per_area() ? "surface_contact" : "general_primitive_contact";
}

/// Lets the points of a sensor touch as springs.
void add_feedback(Scene& scene, const SceneNode& node, const TactileDescription& d) {
  if (d.coefficients.ks != 0)
    node.fail(
        "feedback and ks: the contact and the reading of its skin would have anchors of their own, "
        "which differ; expected one of them");
  if (d.layer)
    node.fail("feedback and <layer>: the contact would have springs; expected feedback in <layer>");
  if (d.table)
    node.fail("feedback and pressure: the contact would have springs; expected one of them");
  for (const int other : sensed_bodies(scene, d))
    for (const PairContactDescription& c : scene.pair_contacts)
      if (const std::string& touched = scene.links[std::size_t(other)].body.name;
          is_contact_of(c, d.body, touched))
        node.context().warnings.push_back(fmt::format(
            "{}<{}>: '{}' and '{}' touch by the body's points and by those "
            "of its tactile sensor '{}', which has feedback. Where both lie, the contact is as "
            "many times stiffer, and the field shows its own share alone",
            c.source.prefix(), element_of(c), d.body, touched, d.name));
  add_sensor_contacts(scene, d);
}

/// Warns of a kn that has no effect: the load of a layer follows from its material.
void warn_of_idle_kn(const SceneElement& node, const TactileDescription& d) {
  constexpr double kNear = 0.01;
  if (!node.gives("kn") || !d.material || !d.points.empty()) return;
  const double area = cell_of(node, d.array), own = skin_springs(*d.material).kn;
  if (std::abs(d.coefficients.kn - own * area) > kNear * own * area)
    node.warn(fmt::format(
        "kn of {:.4g} N/m³ beside <layer>, whose load follows from modulus and thickness "
        "({:.4g} N/m³): unless it varies it has no effect on the load; expected another modulus",
        d.coefficients.kn / area, own));
}

/// Lets the layer of a sensor be its contact. Its normal force relaxes by itself.
void add_layer_feedback(Scene& scene, const SceneElement& node, TactileDescription& d) {
  const auto fail = [&](const std::string& what) {
    throw InputError(d.layer->source.prefix() + "<layer> of '" + d.name + "': feedback and " +
                     what);
  };
  if (node.word("feedback") == 1) fail("feedback=\"true\" of the sensor; expected that of <layer>");
  if (node.gives("kn")) fail("kn; expected modulus, which is the layer's");
  if (node.gives("damping")) fail("damping; expected relaxation, by which the layer damps");
  if (d.shear_at_readings) fail("memory=\"read\"; expected friction that advances at every step");
  for (const int other : sensed_bodies(scene, d)) {
    const BodyDescription& touched = scene.links[std::size_t(other)].body;
    if (std::holds_alternative<MeshShape>(touched.shape))
      fail(
          fmt::format("the mesh '{}', whose distance is known near its surface alone; expected "
                      "another shape, or ignores=\"{}\"",
                      touched.name, touched.name));
    for (const PairContactDescription& c : scene.pair_contacts)
      if (is_contact_of(c, d.body, touched.name) || is_contact_of(c, touched.name, d.body))
        fail(fmt::format("{}<{}> of '{}' and '{}', which would count twice; expected one of them",
                         c.source.prefix(), element_of(c), c.general_body, c.primitive_body));
  }
  d.coefficients.damping = 0;
  add_sensor_contacts(scene, d);
}

/// Refuses a layer that carries the loads of contacts that there are not.
void check_load_contacts(const Scene& scene, const TactileDescription& d) {
  for (const int other : sensed_bodies(scene, d)) {
    const std::string& name = scene.links[std::size_t(other)].body.name;
    if (std::ranges::none_of(scene.pair_contacts, [&](const PairContactDescription& c) {
          return (c.general_body == d.body && c.primitive_body == name) ||
                 (c.general_body == name && c.primitive_body == d.body);
        }))
      throw InputError(fmt::format(
          "{}<layer> of '{}': load=\"contact\", but no contact of '{}' with '{}', which it senses; "
          "expected <surface_contact> or <general_primitive_contact> of both, or ignores=\"{}\"",
          d.layer->source.prefix(), d.name, d.body, name, name));
  }
}

/// Reads names between commas; blanks beside a comma do not count.
std::vector<std::string> body_names(const SceneNode& node, const char* attribute) {
  std::vector<std::string> names =
      split_names(node.source().prefix() + "<tactile>: " + attribute, node.text(attribute));
  for (std::string& name : names) {
    name.erase(0, std::min(name.find_first_not_of(' '), name.size()));
    name.erase(name.find_last_not_of(' ') + 1);
  }
  return names;
}

}  // namespace

void read_sensors(Scene& scene, const SceneNode& section) {
  for (const SceneElement& node : elements_in(section)) {
    if (node.of() == kCamera) {
      read_camera(scene, node);
      continue;
    }
    TactileDescription d;
    d.source = node.source();
    find_body(scene, node, "body");
    d.body = node.text("body");
    d.name = node.text("name", d.body);
    if (d.name.find('/') != std::string::npos)
      node.fail("name \"" + d.name + "\" holds '/', which files use as a separator");
    for (const TactileDescription& other : scene.sensors)
      if (other.name == d.name) node.fail("tactile name '" + d.name + "' is used twice");
    check_free_name(scene, node, d.name);
    static_cast<void>(node.word("type"));  // checks it
    const std::string type = node.text("type");
    node.check(type);
    d.law = static_cast<ContactLaw>(node.word("law"));
    node.read(d.coefficients);
    node.read(d);
    d.shear_at_readings = node.word("memory") == 1;
    if (d.shear_at_readings && d.every == 0)
      node.fail(
          "memory=\"read\" without every; expected both: memory advances every so many steps");
    if (node.has("pressure_sign")) {
      d.pressure_sign = node.integer("pressure_sign");
      if (std::abs(*d.pressure_sign) != 1)
        node.fail(fmt::format("pressure_sign=\"{}\"; expected 1 or -1", *d.pressure_sign));
    }
    if (type == "rect_array") {
      d.array = read_array(node);
    } else {
      d.points = read_points(node, type);
    }
    d.material = read_material(node, type);
    d.table = read_pressures(node, type);
    if (d.material || d.table || (node.word("per") == 1 && node.row("per").serves(type)))
      share_area(node,
                 d.points.empty() ? cell_of(node, d.array) : cell_of(node, type, d.points.size()),
                 d);
    read_parts(node, d);
    for (const auto& [name, list] : {std::pair{"feels", &d.feels}, {"ignores", &d.ignores}})
      if (node.has(name)) *list = body_names(node, name);
    static_cast<void>(sensed_bodies(scene, d));  // checks the names
    if (d.layer && !d.layer->feedback) warn_of_idle_kn(node, d);
    if (d.layer && d.layer->feedback)
      add_layer_feedback(scene, node, d);
    else if (node.word("feedback") == 1)
      add_feedback(scene, node, d);
    scene.sensors.push_back(std::move(d));
  }
  for (const TactileDescription& d : scene.sensors)
    if (d.layer && d.layer->load_control) check_load_contacts(scene, d);
}

void read_outputs(Scene& scene, const SceneNode& section) {
  SceneElement(section, kOutputs).check();
  OutputsDescription outputs;
  outputs.source = section.source();
  outputs.record =
      split_names(section.source().prefix() + "<outputs>: record", section.text("record"));
  for (const std::string& word : outputs.record) {
    std::string name;
    try {
      name = split_times(word).name;
    } catch (const InputError& error) {
      section.fail(fmt::format("record has {}", error.what()));
    }
    if (const std::optional<FieldOutput> of = find_output(scene, name)) {
      if (const std::string reason = reason_against(scene, *of); !reason.empty())
        section.fail(fmt::format("record has '{}', but {}", word, reason));
    } else if (!is_plain_output(name) && !find_body_output(scene, name)) {
      section.fail(fmt::format("record has '{}'{}", name, suggestion(name, output_names(scene))));
    }
  }
  scene.outputs = std::move(outputs);
}

}  // namespace tangere
