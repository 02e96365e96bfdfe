// SPDX-License-Identifier: Apache-2.0
// Reads the start of a run, its controls and its variation: <initial>, <control>, <randomize>.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "engine/model/scene_number.hpp"
#include "engine/model/shapes.hpp"
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

PiecewiseControl read_piecewise(const Scene& scene, const SceneNode& node) {
  PiecewiseControl control;
  node.check_attributes({"end"});
  control.end = node.has("end") ? node.positive("end") : 0;
  for (const SceneNode& at : node.children({"at"})) {
    at.check_attributes({"time", "value"});
    const double time = at.not_negative("time");
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
  const char* const kinds[] = {"uniform", "log_uniform", "normal", "list"};
  int found = 0;
  for (int k = 0; k < 4; ++k) {
    if (!node.has(kinds[k])) continue;
    ++found;
    d.kind = static_cast<Distribution::Kind>(k);
    std::vector<double> x = node.numbers(kinds[k], k < 3 ? 2 : 0);
    for (double& value : x) value *= scale;
    if (k == 3) {
      if (x.empty()) node.fail("list=\"\"; expected one value or more");
      d.values = x;
      continue;
    }
    d.a = x[0];
    d.b = x[1];
    if (k < 2 && !(d.a <= d.b)) node.fail(fmt::format("{}: expected low, then high", kinds[k]));
    if (k == 1 && !(d.a > 0)) node.fail("log_uniform: expected positive bounds");
    if (k == 2 && !(d.b >= 0))
      node.fail("normal: expected mean, then a standard deviation of zero or more");
  }
  if (found != 1) node.fail("expected exactly one of uniform, log_uniform, normal, list");
  return d;
}

/// Refuses a normal distribution, because every draw of a coefficient must be zero or more.
void check_coefficient(const SceneNode& node, const Distribution& d) {
  if (d.kind == Distribution::Kind::normal)
    node.fail("normal can draw a negative coefficient; expected uniform, log_uniform or list");
  bool negative = d.a < 0;
  for (double x : d.values) negative = negative || x < 0;
  if (negative) node.fail("a coefficient may not be negative");
}

/// Reads the attribute `field`: one of the owner's fields from `first` to `last`.
NumberField read_field(const SceneNode& node, NumberOwner owner, NumberField first,
                       NumberField last) {
  std::vector<std::string> names;
  for (int k = 0; k <= offset_from(first, last); ++k)
    names.emplace_back(number_kind(owner, NumberField(int(first) + k)).name);
  return static_cast<NumberField>(static_cast<int>(first) + int(node.choice("field", names)));
}

/// Reads a distribution in the unit of a number.
Distribution read_distribution(const Scene& scene, const SceneNode& node, const SceneNumber& n) {
  return read_distribution(node, node.context().factor(unit_of(scene, n)));
}

/// Reads damping, armature, stiffness, lim_stiffness of a joint, or P, D of its motor.
void read_joint_variation(const Scene& scene, const SceneNode& node, RandomizationDescription& d) {
  const bool motor = node.name() == "motor";
  const char* by = motor ? "joint" : "name";
  const JointDescription& joint = scene.links[std::size_t(find_joint(scene, node, by))].joint;
  node.check_attributes({by, "field", "uniform", "log_uniform", "normal", "list"});
  d.number.name = joint.name;
  if (motor) {
    d.number.owner = NumberOwner::motor;
    d.number.field = read_field(node, NumberOwner::motor, NumberField::P, NumberField::D);
    bool position = false;
    for (const MotorDescription& m : scene.motors)
      position = position || (m.joint == joint.name && m.control == MotorControl::position);
    if (!position)
      node.fail("joint '" + joint.name + "' has no position motor; force motors have no gains");
  } else {
    d.number.field =
        read_field(node, NumberOwner::joint, NumberField::damping, NumberField::lim_stiffness);
    if (joint.type == JointType::fixed)
      node.fail("joint '" + joint.name + "' is fixed; nothing of it can vary");
    if (d.number.field == NumberField::lim_stiffness && !joint.limits)
      node.fail("joint '" + joint.name + "' has no 'lim'");
    const bool mixed = joint.type == JointType::free || joint.type == JointType::free2d;
    if (mixed && node.context().length != 1)
      node.fail("joint '" + joint.name +
                "' slides and turns: one number has two units; use unit=\"m-kg\"");
  }
  d.distribution = read_distribution(scene, node, d.number);
  check_coefficient(node, d.distribution);
}

/// Reads a coordinate or velocity at the start, or the place of a joint.
void read_state_variation(const Scene& scene, const SceneNode& node, RandomizationDescription& d) {
  node.check_attributes({"name", "q", "v", "pos", "uniform", "log_uniform", "normal", "list"});
  const int joint = find_joint(scene, node, "name");
  const JointType type = scene.links[std::size_t(joint)].joint.type;
  if (int{node.has("q")} + int{node.has("v")} + int{node.has("pos")} != 1)
    node.fail("expected exactly one of q, v, pos (the index of what varies) and field");
  d.number.name = node.text("name");
  if (node.has("pos")) {
    if (type == JointType::fixed)
      node.fail("joint '" + d.number.name + "' is fixed; expected one that moves");
    d.number.field = NumberField::pos;
    d.number.component = node.integer("pos", 0, 2);
  } else {
    const bool position = node.has("q");
    const int count = position ? position_count(type) : dof_count(type);
    if (count == 0) node.fail("joint '" + d.number.name + "' is fixed; nothing of it can vary");
    d.number.field = position ? NumberField::q : NumberField::v;
    d.number.component = node.integer(position ? "q" : "v", 0, count - 1);
  }
  d.distribution = read_distribution(scene, node, d.number);
}

/// Requires positive draws for masses and sizes.
void check_positive(const SceneNode& node, const RandomizationDescription& of) {
  const Distribution& d = of.distribution;
  if (d.kind == Distribution::Kind::normal)
    node.fail("normal can draw a negative '" + name_of(of.number) +
              "'; expected uniform, log_uniform or list");
  double least = d.a;
  if (d.kind == Distribution::Kind::list)
    least = *std::min_element(d.values.begin(), d.values.end());
  if (!(least > 0))
    node.fail(fmt::format("'{}' can be {:g}, in SI units; expected positive values only",
                          name_of(of.number), least));
}

/// Reads the density of a body, or a number of its size.
void read_body_variation(const Scene& scene, const SceneNode& node, RandomizationDescription& d) {
  node.check_attributes({"name", "field", "size", "uniform", "log_uniform", "normal", "list"});
  const BodyDescription& body = scene.links[std::size_t(find_body(scene, node, "name"))].body;
  if (node.has("field") == node.has("size"))
    node.fail("expected exactly one of field and size (the index of an edge)");
  constexpr NumberField kFields[] = {NumberField::radius, NumberField::length, NumberField::density,
                                     NumberField::scale};
  std::vector<std::string> fields;
  for (const NumberField field : kFields)
    fields.emplace_back(number_kind(NumberOwner::body, field).name);
  d.number = {NumberOwner::body, NumberField::size, body.name};
  if (node.has("size")) {
    d.number.component = node.integer("size", 0, 2);
  } else {
    d.number.field = kFields[node.choice("field", fields)];
  }
  if (d.number.field != NumberField::density) {
    Shape shape = body.shape;
    if (size_number(shape, size_index(d.number)) == nullptr)
      node.fail(fmt::format("there is no '{}': body '{}' is {}; expected a body that has one",
                            name_of(d.number), body.name, with_article(shape_name(shape))));
  } else {
    if (std::holds_alternative<AbstractShape>(body.shape))
      node.fail("body '" + body.name + "' is known by its mass; nothing of it can vary");
    if (!(body.density > 0))
      node.fail("body '" + body.name + "' is massless; expected a positive density");
  }
  d.distribution = read_distribution(scene, node, d.number);
  check_positive(node, d);
}

void read_coefficient_variation(const Scene& scene, const SceneNode& node,
                                RandomizationDescription& d) {
  std::vector<std::string> attributes = {"field", "uniform", "log_uniform", "normal", "list"};
  const auto declared = [&](const auto& list, const auto& matches) {
    if (std::none_of(list.begin(), list.end(), matches))
      node.fail("no such contact is declared in <contact>");
  };
  SceneNumber& n = d.number;
  if (node.name() == "general_primitive_contact") {
    attributes.insert(attributes.end(), {"general_body", "primitive_body"});
    find_body(scene, node, "general_body");
    find_body(scene, node, "primitive_body");
    n.owner = NumberOwner::contact;
    n.name = node.text("general_body");
    n.second_name = node.text("primitive_body");
    declared(scene.pair_contacts, [&](const PairContactDescription& c) {
      return c.first_name() == n.name && c.primitive_body == n.second_name;
    });
  } else if (node.name() == "ground_contact") {
    attributes.emplace_back("body");
    find_body(scene, node, "body");
    n.owner = NumberOwner::ground;
    n.name = node.text("body");
    declared(scene.ground_contacts,
             [&](const GroundContactDescription& c) { return c.body == n.name; });
  } else {
    attributes.emplace_back("name");
    n.owner = NumberOwner::tactile;
    n.name = node.text("name");
    std::vector<std::string> names;
    for (const auto& s : scene.sensors) names.push_back(s.name);
    if (std::find(names.begin(), names.end(), n.name) == names.end())
      node.fail("no tactile sensor is named '" + n.name + "'" + suggestion(n.name, names));
    for (const PairContactDescription& c : scene.pair_contacts)
      if (c.sensor == n.name)
        node.fail("tactile sensor '" + n.name +
                  "' has feedback, so its coefficients act on the motion as well; they cannot vary "
                  "between environments");
  }
  node.check_attributes(attributes);
  n.field = coefficient_field(node.choice("field", with_coefficients({})));
  d.distribution = read_distribution(scene, node, n);
  check_coefficient(node, d.distribution);
}

}  // namespace

void read_initial(Scene& scene, const SceneNode& section) {
  section.check_attributes({});
  for (const SceneNode& node : section.children({"joint"})) {
    node.check_attributes({"name", "q", "v"});
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
  section.check_attributes({});
  const std::vector<SceneNode> kinds = section.children({"constant", "piecewise", "csv", "random"});
  if (kinds.size() != 1)
    section.fail(fmt::format("{} ways to drive the scene; expected one", kinds.size()));
  const SceneNode& node = kinds.front();
  if (node.name() == "constant") {
    node.check_attributes({"value"});
    scene.control = ConstantControl{read_controls(scene, node)};
  } else if (node.name() == "piecewise") {
    scene.control = read_piecewise(scene, node);
  } else if (node.name() == "csv") {
    node.check_attributes({"file"});
    const std::filesystem::path beside = std::filesystem::path(node.context().file).parent_path();
    CsvControl control;
    control.path = (beside / node.text("file")).string();
    if (!std::filesystem::exists(control.path))
      node.fail(fmt::format("file=\"{}\": there is no {}", node.text("file"), control.path));
    control.rows = read_csv(control.path, std::size_t(control_count(scene)));
    scene.control = std::move(control);
  } else {
    node.check_attributes({"amplitude", "period"});
    scene.control =
        RandomControl{node.not_negative("amplitude", 1.0), node.positive("period", 0.1)};
  }
}

void read_randomize(Scene& scene, const SceneNode& section) {
  section.check_attributes({});
  const std::vector<std::string> kinds = {
      "joint", "motor", "ground_contact", "general_primitive_contact", "tactile", "body"};
  for (const SceneNode& node : section.children(kinds)) {
    RandomizationDescription d;
    d.source = node.source();
    if (node.name() == "motor" || (node.name() == "joint" && node.has("field"))) {
      read_joint_variation(scene, node, d);
    } else if (node.name() == "joint") {
      read_state_variation(scene, node, d);
    } else if (node.name() == "body") {
      read_body_variation(scene, node, d);
    } else {
      read_coefficient_variation(scene, node, d);
    }
    for (const RandomizationDescription& other : scene.randomizations)
      if (other.number == d.number) node.fail("'" + name_of(d.number) + "' already varies");
    scene.randomizations.push_back(std::move(d));
  }
}

}  // namespace tangere
