// SPDX-License-Identifier: Apache-2.0
// Reads the start of a run, its controls and its variation: <initial>, <control>, <randomize>.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "engine/scene/scene_faults.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/shapes.hpp"
#include "io/files/csv.hpp"
#include "io/scene/scene_sections.hpp"

namespace tangere {

namespace {

std::vector<double> read_coordinates(const SceneNode& node, const char* attribute, JointType type,
                                     int count) {
  std::vector<double> x = node.numbers(attribute, std::size_t(count));
  for (int i = 0; i < count; ++i) x[std::size_t(i)] *= coordinate_scale(type, i, node.context());
  return x;
}

/// Reads `value`: one number per control. Targets of position motors use the scene's lengths.
std::vector<double> read_controls(const Scene& scene, const SceneNode& node) {
  std::vector<double> values = node.numbers("value");
  const std::vector<double> scales = control_scales(scene, node.context());
  if (values.size() != scales.size())
    node.fail(fmt::format("{} control values; the motors take {}", values.size(), scales.size()));
  for (std::size_t k = 0; k < values.size(); ++k) values[k] *= scales[k];
  return values;
}

PiecewiseControl read_piecewise(const Scene& scene, const SceneElement& node) {
  PiecewiseControl control;
  node.read(control);
  for (const SceneNode& child : children_of(node)) {
    const SceneElement at(child, kAt);
    at.check();
    const double time = at.number("time");
    if (control.times.empty() && time != 0)
      at.fail(fmt::format("time=\"{}\"; the first must be 0", time));
    if (!control.times.empty() && !(time > control.times.back()))
      at.fail(fmt::format("time=\"{}\" does not come after {}", time, control.times.back()));
    control.times.push_back(time);
    control.values.push_back(read_controls(scene, at));
  }
  if (control.times.empty()) node.fail("no <at time value>; expected at least one");
  if (control.end > 0 && !(control.end > control.times.back()))
    node.fail(fmt::format("end=\"{}\" does not come after the last time {}", control.end,
                          control.times.back()));
  return control;
}

/// Reads exactly one of uniform, log_uniform, normal, list, with numbers times `scale`.
Distribution read_distribution(const SceneNode& node, double scale) {
  Distribution d;
  int found = 0;
  for (int k = 0; k < 4; ++k) {
    const auto kind = static_cast<Distribution::Kind>(k);
    const char* const name = to_string(kind);
    if (!node.has(name)) continue;
    ++found;
    d.kind = kind;
    std::vector<double> x = node.numbers(name, k < 3 ? 2 : 0);
    for (double& value : x) value *= scale;
    if (k == 3) {
      if (x.empty()) node.fail("list=\"\"; expected one value or more");
      d.values = x;
      continue;
    }
    d.a = x[0];
    d.b = x[1];
    if (k < 2 && !(d.a <= d.b)) node.fail(fmt::format("{}: expected low, then high", name));
    if (k == 1 && !(d.a > 0)) node.fail("log_uniform: expected positive bounds");
    if (k == 2 && !(d.b >= 0))
      node.fail("normal: expected mean, then a standard deviation of zero or more");
  }
  if (found != 1) node.fail("expected exactly one of uniform, log_uniform, normal, list");
  return d;
}

/// Reads the attribute `field`: one of the numbers of an owner that may vary.
NumberField read_field(const SceneNode& node, NumberOwner owner) {
  std::vector<std::string> names;
  std::vector<NumberField> fields;
  for (const Attribute& row : schema()) {
    if ((row.elements & element_of(owner)) == 0 || !row.has(kVaries) || row.has(kIndexed)) continue;
    names.emplace_back(row.name);
    fields.push_back(*row.field);
  }
  return fields[std::size_t(node.choice("field", names))];
}

/// Reads a distribution in the unit of a number.
Distribution read_distribution(const Scene& scene, const SceneNode& node, const SceneNumber& n) {
  const std::vector<Unit> units = units_of(scene, n);
  double factor = units.size() == 1 ? node.context().factor(units[0]) : 1;
  for (const TactileDescription& sensor : scene.sensors)
    if (n.owner == NumberOwner::tactile && sensor.name == n.name && sensor.cell > 0 &&
        scales_with_area(std::size_t(coefficient_index(n.field))))
      factor *= node.context().area(sensor.cell);
  return read_distribution(node, factor);
}

/// Reads damping, armature, stiffness, lim_stiffness of a joint, or P, D of its motor.
void read_joint_variation(const Scene& scene, const SceneElement& node,
                          RandomizationDescription& d) {
  const bool motor = node.of() == kVaryMotor;
  const JointDescription& joint =
      scene.links[std::size_t(find_joint(scene, node, motor ? "joint" : "name"))].joint;
  d.number.name = joint.name;
  d.number.owner = motor ? NumberOwner::motor : NumberOwner::joint;
  d.number.field = read_field(node, d.number.owner);
  const bool mixed = joint.type == JointType::free || joint.type == JointType::free2d;
  if (!motor && mixed && node.context().length != 1)
    node.fail("joint '" + joint.name +
              "' slides and turns: one number has two units; use unit=\"m-kg\"");
}

/// Reads a coordinate or velocity at the start, or the place of a joint.
void read_state_variation(const Scene& scene, const SceneElement& node,
                          RandomizationDescription& d) {
  const int joint = find_joint(scene, node, "name");
  const JointType type = scene.links[std::size_t(joint)].joint.type;
  if (int{node.has("q")} + int{node.has("v")} + int{node.has("pos")} != 1)
    node.fail("expected exactly one of q, v, pos (the index of what varies) and field");
  d.number.name = node.text("name");
  if (node.has("pos")) {
    d.number.field = NumberField::pos;
    d.number.component = node.integer("pos");
  } else {
    const bool position = node.has("q");
    const int count = std::max(1, position ? position_count(type) : dof_count(type));
    d.number.field = position ? NumberField::q : NumberField::v;
    d.number.component = node.SceneNode::integer(position ? "q" : "v", 0, count - 1);
  }
}

/// Reads the density of a body, or a number of its size.
void read_body_variation(const Scene& scene, const SceneElement& node,
                         RandomizationDescription& d) {
  const BodyDescription& body = scene.links[std::size_t(find_body(scene, node, "name"))].body;
  if (node.has("field") == node.has("size"))
    node.fail("expected exactly one of field and size (the index of an edge)");
  d.number = {NumberOwner::body, NumberField::size, body.name};
  if (node.has("size")) {
    d.number.component = node.integer("size");
  } else {
    d.number.field = read_field(node, NumberOwner::body);
  }
}

/// Reads a number of a loop.
void read_loop_variation(const Scene& scene, const SceneElement& node,
                         RandomizationDescription& d) {
  const bool weld = node.of() == kVaryWeld;
  d.number.owner = NumberOwner::loop;
  d.number.name = node.text("name");
  std::vector<std::string> names;
  for (const LoopDescription& loop : scene.loops)
    if (loop.weld == weld) names.push_back(loop.name);
  if (std::ranges::find(names, d.number.name) == names.end())
    node.fail("no " + node.name() + " of <loop> is named '" + d.number.name + "'" +
              suggestion(d.number.name, names));
  d.number.field = read_field(node, NumberOwner::loop);
}

/// Reads a number of a camera's pose or light.
void read_camera_variation(const Scene& scene, const SceneElement& node,
                           RandomizationDescription& d) {
  d.number.owner = NumberOwner::camera;
  d.number.name = node.text("name");
  std::vector<std::string> names;
  for (const CameraDescription& camera : scene.cameras) names.push_back(camera.name);
  if (std::ranges::find(names, d.number.name) == names.end())
    node.fail("no camera is named '" + d.number.name + "'" + suggestion(d.number.name, names));
  int found = int{node.has("field")};
  const auto indexed = [&](const char* attribute, NumberField field) {
    if (!node.has(attribute)) return;
    ++found;
    d.number.field = field;
    d.number.component = node.integer(attribute);
  };
  indexed("pos", NumberField::pos);
  indexed("look", NumberField::look);
  indexed("light", NumberField::light);
  if (found != 1)
    node.fail("expected exactly one of pos, look, light (the index of an axis) and field");
  if (node.has("field")) d.number.field = read_field(node, NumberOwner::camera);
}

/// Points of a contact of surfaces follow the kn of the scene. Warns where far larger ones are
/// drawn.
void warn_of_stiffer_draws(const Scene& scene, const SceneElement& node,
                           const RandomizationDescription& d) {
  if (d.number.field != NumberField::kn) return;
  const double given = number_in(scene, d.number);
  double most = std::max(d.distribution.a, d.distribution.b);
  for (const double x : d.distribution.values) most = std::max(most, x);
  if (most > 4 * given)
    node.warn(
        fmt::format("kn of '{}' and '{}' is up to {:.2g}, and their points are as near as {:.2g} "
                    "needs; expected the largest in the contact, or a pitch",
                    d.number.name, d.number.second_name, most, given));
}

/// Warns of ties that only one number has, which is then drawn alone.
void warn_of_single_ties(const Scene& scene, const std::vector<SceneElement>& elements) {
  for (std::size_t k = 0; k < elements.size(); ++k) {
    const std::string& tie = scene.randomizations[k].tie;
    if (tie.empty() ||
        std::ranges::count(scene.randomizations, tie, &RandomizationDescription::tie) > 1)
      continue;
    std::vector<std::string> others;
    for (const RandomizationDescription& d : scene.randomizations)
      if (!d.tie.empty() && d.tie != tie) others.push_back(d.tie);
    elements[k].warn(
        fmt::format("tie=\"{}\" of '{}' alone ties nothing; expected another number "
                    "with it{}",
                    tie, name_of(scene.randomizations[k].number), suggestion(tie, others)));
  }
}

void read_coefficient_variation(const Scene& scene, const SceneElement& node,
                                RandomizationDescription& d) {
  const auto declared = [&](const auto& list, const auto& matches) {
    if (std::none_of(list.begin(), list.end(), matches))
      node.fail("no such contact is declared in <contact>");
  };
  SceneNumber& n = d.number;
  if (node.of() == kVarySurface) {
    n.owner = NumberOwner::contact;
    const std::string one = node.text("body1"), two = node.text("body2");
    declared(scene.pair_contacts, [&](const PairContactDescription& c) {
      const auto connects = [&](const std::string& a, const std::string& b) {
        return c.general_body == a && c.primitive_body == b;
      };
      if (!c.per_area() || c.second_half || !(connects(one, two) || connects(two, one)))
        return false;
      n.name = c.general_body, n.second_name = c.primitive_body;
      return true;
    });
  } else if (node.of() == kVaryPair) {
    find_body(scene, node, "general_body");
    find_body(scene, node, "primitive_body");
    n.owner = NumberOwner::contact;
    n.name = node.text("general_body");
    n.second_name = node.text("primitive_body");
    declared(scene.pair_contacts, [&](const PairContactDescription& c) {
      return !c.per_area() && c.first_name() == n.name && c.primitive_body == n.second_name;
    });
  } else if (node.of() == kVaryGround) {
    find_body(scene, node, "body");
    n.owner = NumberOwner::ground;
    n.name = node.text("body");
    declared(scene.ground_contacts,
             [&](const GroundContactDescription& c) { return c.body == n.name; });
  } else {
    n.owner = NumberOwner::tactile;
    n.name = node.text("name");
    std::vector<std::string> names;
    for (const auto& s : scene.sensors) names.push_back(s.name);
    if (std::find(names.begin(), names.end(), n.name) == names.end())
      node.fail("no tactile sensor is named '" + n.name + "'" + suggestion(n.name, names));
  }
  n.field = read_field(node, n.owner);
}

}  // namespace

void read_initial(Scene& scene, const SceneNode& section) {
  for (const SceneElement& node : elements_in(section)) {
    node.check();
    const int joint = find_joint(scene, node, "name");
    const JointType type = scene.links[std::size_t(joint)].joint.type;
    InitialState state;
    state.source = node.source();
    state.joint = node.text("name");
    for (const InitialState& other : scene.initial)
      if (other.joint == state.joint) node.fail("joint '" + state.joint + "' is given twice");
    if (type == JointType::fixed)
      node.fail("joint '" + state.joint + "' is fixed; it has no state");
    if (node.has("q")) state.q = read_coordinates(node, "q", type, position_count(type));
    if (node.has("v")) state.v = read_coordinates(node, "v", type, dof_count(type));
    if (type == JointType::spherical || type == JointType::free) {
      double square = 0;
      for (std::size_t k = 0; k < 4 && !state.q.empty(); ++k)
        square += std::pow(state.q[state.q.size() - 4 + k], 2);
      if (!state.q.empty() && !(square > 1e-100))
        node.fail("q ends in a quaternion of zero length");
    }
    scene.initial.push_back(std::move(state));
  }
}

void read_control(Scene& scene, const SceneNode& section) {
  const std::vector<SceneElement> kinds = elements_in(section);
  if (kinds.size() != 1)
    section.fail(fmt::format("{} ways to drive the scene; expected one", kinds.size()));
  const SceneElement& node = kinds.front();
  node.check();
  if (node.of() == kConstant) {
    scene.control = ConstantControl{read_controls(scene, node)};
  } else if (node.of() == kPiecewise) {
    scene.control = read_piecewise(scene, node);
  } else if (node.of() == kCsv) {
    const std::filesystem::path beside = std::filesystem::path(node.context().file).parent_path();
    CsvControl control;
    control.path = (beside / node.text("file")).string();
    if (!std::filesystem::exists(control.path))
      node.fail(fmt::format("file=\"{}\": there is no {}", node.text("file"), control.path));
    control.rows = read_csv(control.path, std::size_t(control_count(scene)));
    scene.control = std::move(control);
  } else {
    node.read(scene.control.emplace().emplace<RandomControl>());
  }
}

void read_randomize(Scene& scene, const SceneNode& section) {
  const std::vector<SceneElement> elements = elements_in(section);
  for (const SceneElement& node : elements) {
    node.check();
    RandomizationDescription d;
    d.source = node.source();
    if (node.of() == kVaryMotor || (node.of() == kVaryJoint && node.has("field"))) {
      read_joint_variation(scene, node, d);
    } else if (node.of() == kVaryJoint) {
      read_state_variation(scene, node, d);
    } else if (node.of() == kVaryConnect || node.of() == kVaryWeld) {
      read_loop_variation(scene, node, d);
    } else if (node.of() == kVaryCamera) {
      read_camera_variation(scene, node, d);
    } else if (node.of() == kVaryBody) {
      read_body_variation(scene, node, d);
    } else {
      read_coefficient_variation(scene, node, d);
    }
    d.distribution = read_distribution(scene, node, d.number);
    if (node.has("tie")) d.tie = node.text("tie");
    node.refuse(variation_fault(scene, d));
    if (node.of() == kVarySurface) warn_of_stiffer_draws(scene, node, d);
    for (const RandomizationDescription& other : scene.randomizations)
      if (other.number == d.number) node.fail("'" + name_of(d.number) + "' already varies");
    scene.randomizations.push_back(std::move(d));
  }
  warn_of_single_ties(scene, elements);
}

}  // namespace tangere
