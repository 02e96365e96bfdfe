// SPDX-License-Identifier: Apache-2.0
// Bounds of single values are those of the schema. Values in messages are in SI.
#include "engine/scene/scene_faults.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/scene/scene_number.hpp"
#include "engine/scene/schema.hpp"
#include "engine/scene/shapes.hpp"

namespace tangere {
namespace {

using Field = NumberField;

const LinkDescription* link_with_body(const Scene& scene, const std::string& body) {
  const auto at =
      std::ranges::find_if(scene.links, [&](const auto& l) { return l.body.name == body; });
  return at == scene.links.end() ? nullptr : &*at;
}
const LinkDescription* link_with_joint(const Scene& scene, const std::string& joint) {
  const auto at =
      std::ranges::find_if(scene.links, [&](const auto& l) { return l.joint.name == joint; });
  return at == scene.links.end() ? nullptr : &*at;
}

/// Returns the first fault that is one.
template <class... Faults>
std::string first_of(std::string fault, const Faults&... more) {
  (static_cast<void>(fault.empty() ? fault = more : fault), ...);
  return fault;
}

std::string limits_fault(const JointEffects& e) {
  if (!e.limits || (*e.limits)[0] <= (*e.limits)[1]) return "";
  return fmt::format("lim=\"{} {}\": expected low, then high", (*e.limits)[0], (*e.limits)[1]);
}

std::string points_fault(const char* role, const std::string& body, const Shape& shape) {
  if (has_contact_points(shape) || is_ball(shape)) return "";
  return fmt::format(
      "{} '{}' is {} body, which has no contact points; {}", role, body,
      with_article(shape_name(shape)),
      has_distance(shape) ? "swap the two bodies" : "give it a <collision contacts>");
}

/// Least and largest value that may be drawn; a normal distribution has none.
double least_of(const Distribution& d) {
  if (d.kind != Distribution::Kind::list) return d.a;
  return d.values.empty() ? 0 : *std::ranges::min_element(d.values);
}

double most_of(const Distribution& d) {
  if (d.kind != Distribution::Kind::list) return d.b;
  return d.values.empty() ? 0 : *std::ranges::max_element(d.values);
}

constexpr const char* kTurnsFreely =
    "friction of a joint that turns freely; expected a joint of another type";

bool turns_freely(JointType type) {
  return type == JointType::spherical || type == JointType::free;
}

std::string friction_fault(const JointDescription& joint) {
  const bool dry = joint.friction != 0 || (joint.turning && joint.turning->friction != 0);
  return turns_freely(joint.type) && dry ? kTurnsFreely : "";
}

std::string joint_variation_fault(const JointDescription& joint, const SceneNumber& n) {
  const int count = n.field == Field::pos ? 3
                    : n.field == Field::q ? position_count(joint.type)
                                          : dof_count(joint.type);
  if (dof_count(joint.type) == 0) return "the joint is fixed; expected one that moves";
  if (is_of_start(n) && !joint.follows.empty())
    return fmt::format("its place is that of '{}', which it follows", joint.follows[0]);
  if (is_of_start(n) || n.field == Field::pos)
    return n.component >= 0 && n.component < count
               ? ""
               : fmt::format("index {} is none of 0 to {}", n.component, count - 1);
  if (joint.turning) return "its dofs do not share one number";
  if (n.field == Field::friction && turns_freely(joint.type)) return kTurnsFreely;
  if (n.field == Field::lim_stiffness && !joint.limits) return "the joint has no 'lim'";
  return effect_index(n.field) < kJointEffects ? ""
                                               : "no dof of the joint turns by a number of its own";
}

std::string body_variation_fault(const BodyDescription& body, const SceneNumber& n) {
  Shape shape = body.shape;
  if (n.field != Field::density)
    return size_number(shape, size_index(n)) == nullptr
               ? fmt::format("{} has none", with_article(shape_name(shape)))
               : "";
  if (std::holds_alternative<AbstractShape>(shape))
    return "its mass is given; expected a body with volume";
  return body.density > 0 ? "" : "it is massless; expected a positive density";
}

/// What is wrong with the number that varies.
std::string varying_number_fault(const Scene& scene, const SceneNumber& n) {
  const LinkDescription* const with_joint = link_with_joint(scene, n.name);
  const LinkDescription* const with_body = link_with_body(scene, n.name);
  switch (n.owner) {
    case NumberOwner::joint:
      return with_joint == nullptr ? "" : joint_variation_fault(with_joint->joint, n);
    case NumberOwner::body:
      return with_body == nullptr ? "" : body_variation_fault(with_body->body, n);
    case NumberOwner::motor:
      return std::ranges::any_of(
                 scene.motors,
                 [&](const MotorDescription& m) {
                   return m.joint == n.name && m.has_gains() &&
                          (n.field == Field::D || m.control == MotorControl::position);
                 })
                 ? ""
                 : "the joint has no position motor; force motors have no P, and D if they give it";
    case NumberOwner::tactile:
      return std::ranges::any_of(scene.pair_contacts,
                                 [&](const auto& c) { return c.sensor == n.name; })
                 ? "the sensor has feedback, so its coefficients act on the motion as well"
                 : "";
    case NumberOwner::loop:
      return std::ranges::any_of(scene.loops,
                                 [&](const LoopDescription& loop) {
                                   return loop.name == n.name &&
                                          (loop.weld || loop_index(n.field) < 2);
                                 })
                 ? ""
                 : "the scene has no such loop, or it is no weld";
    case NumberOwner::camera:
      return std::ranges::find(scene.cameras, n.name, &CameraDescription::name) ==
                     scene.cameras.end()
                 ? "the scene has no such camera"
                 : (n.component >= 0 && n.component < 3
                        ? ""
                        : fmt::format("index {} is none of 0 to 2", n.component));
    default: return "";
  }
}

/// What keeps a number from being drawn with the first one of its tie.
std::string tie_fault(const Scene& scene, const RandomizationDescription& d) {
  const auto first = std::ranges::find(scene.randomizations, d.tie, &RandomizationDescription::tie);
  if (d.tie.empty() || first == scene.randomizations.end()) return "";
  const Distribution &own = d.distribution, &other = first->distribution;
  const auto fault = [&](const std::string& found, const std::string& expected) {
    return fmt::format("tie=\"{}\" has {}; expected {} as '{}' with the same tie", d.tie, found,
                       expected, name_of(first->number));
  };
  if (own.kind != other.kind) return fault(to_string(own.kind), to_string(other.kind));
  const auto length = [](const Distribution& of) {
    return fmt::format("a list of {}", of.values.size());
  };
  return own.values.size() == other.values.size() ? "" : fault(length(own), length(other));
}

std::string table_fault(const TactileDescription& d) {
  const PressureTable& table = *d.table;
  if (d.layer || d.material) return "a sensor with a material; expected one of them";
  constexpr std::size_t kMost = 1000;
  const std::size_t n = table.depth.size();
  if (n < 2 || n > kMost || table.pressure.size() != n)
    return fmt::format("{} depths and {} pressures; expected as many of both, 2 to {}", n,
                       table.pressure.size(), kMost);
  if (table.depth[0] != 0 || table.pressure[0] != 0)
    return fmt::format("begins with {} Pa at {} m; expected 0 at 0", table.pressure[0],
                       table.depth[0]);
  for (std::size_t k = 1; k < n; ++k) {
    if (!(table.depth[k] > table.depth[k - 1]))
      return fmt::format("depth {} m after {} m; expected ascending depths", table.depth[k],
                         table.depth[k - 1]);
    if (!(table.pressure[k] >= table.pressure[k - 1]))
      return fmt::format("{} Pa after {} Pa; expected pressures that do not fall",
                         table.pressure[k], table.pressure[k - 1]);
  }
  if (!(table.pressure[n - 1] > 0)) return "is 0 at all depths; expected a positive pressure";
  if (table.thickness != 0 && !(table.thickness >= table.depth[n - 1]))
    return fmt::format("depths up to {} m in a skin of {} m; expected a thickness of at least that",
                       table.depth[n - 1], table.thickness);
  return table.relaxation >= 0
             ? ""
             : fmt::format("relaxation {}; expected zero or more", table.relaxation);
}

}  // namespace

std::string joint_fault(const JointDescription& joint) {
  const JointEffects& turning = joint.turning ? *joint.turning : joint;
  if (!joint.rest.empty() && joint.rest.size() != std::size_t(dof_count(joint.type)))
    return fmt::format("rest has {} numbers; expected {}", joint.rest.size(),
                       dof_count(joint.type));
  return first_of(friction_fault(joint), value_fault<JointEffects>(kJoint, joint),
                  limits_fault(joint), value_fault(kJoint, turning), limits_fault(turning));
}

std::string body_fault(const BodyDescription& body) {
  if (const auto* const abstract = std::get_if<AbstractShape>(&body.shape)) {
    const auto& [xx, xy, xz, yy, yz, zz] = abstract->inertia;
    const bool none = std::ranges::all_of(abstract->inertia, [](double x) { return x == 0; });
    if (!none && (abstract->mass == 0 || !is_inertia(abstract->inertia)))
      return fmt::format(
          "inertia=\"{} {} {} {} {} {}\" of mass {}; expected positive principal moments, or "
          "zeros: "
          "of a point, or of mass 0",
          xx, xy, xz, yy, yz, zz, abstract->mass);
  }
  return slenderness_fault(body.shape);
}

/// Returns an error text for how a motor maps its control; "" if there is none. `link`: of its
/// joint, or null.
static std::string input_fault(const LinkDescription* link, const MotorDescription& motor) {
  if (motor.control == MotorControl::force && motor.D != 0 && !motor.scale)
    return "D of a force motor needs 'scale': its force is scale u + offset - D v";
  if (motor.control == MotorControl::force && motor.D != 0 && link != nullptr &&
      (turns_freely(link->joint.type) || link->joint.type == JointType::free2d))
    return "joint '" + motor.joint + "' turns freely, or slides and turns: expected no D";
  if (!motor.maps()) return "";
  if (!motor.scale && motor.control == MotorControl::force)
    return "offset and u_range of a force motor need 'scale': without it, u counts from -1 to 1 "
           "between the ends of ctrl_range";
  if (link != nullptr && link->joint.type == JointType::free2d)
    return "joint '" + motor.joint + "' slides and turns, so its dofs cannot share 'scale'";
  if (motor.scale && (*motor.scale == 0 || !std::isfinite(*motor.scale)))
    return fmt::format("scale=\"{}\"; expected a finite number other than 0", *motor.scale);
  if (!std::isfinite(motor.offset))
    return fmt::format("offset=\"{}\"; expected a finite number", motor.offset);
  const auto [low, high] = motor.u_range;
  return low < high ? "" : fmt::format("u_range=\"{} {}\": expected low, then high", low, high);
}

std::string motor_fault(const Scene& scene, const MotorDescription& motor) {
  const LinkDescription* const link = link_with_joint(scene, motor.joint);
  if (link != nullptr && dof_count(link->joint.type) == 0)
    return "joint '" + motor.joint + "' is fixed; a motor needs a joint that moves";
  const bool position = motor.control == MotorControl::position;
  for (const MotorDescription& other : scene.motors) {
    if (&other == &motor) break;
    if (motor.has_gains() && other.joint == motor.joint && other.has_gains())
      return "joint '" + motor.joint +
             "' already has a position motor, or a force motor with D; expected one at most";
    if (other.control_name() == motor.control_name())
      return "another motor has the name '" + motor.control_name() +
             "' already; expected a name of its own (a motor without one has that of its joint)";
  }
  if (std::string fault = first_of(value_fault(kMotor, motor), input_fault(link, motor));
      !fault.empty())
    return fault;
  const std::array<double, 2> sliding = {motor.low, motor.high};
  for (const auto& [low, high] : {sliding, motor.turning.value_or(sliding)}) {
    const std::string range = fmt::format("ctrl_range=\"{} {}\": expected ", low, high);
    if ((position || motor.scale) && !(low <= high)) return range + "low, then high";
    if (!position && !motor.scale && !(std::isfinite(low) && std::isfinite(high)))
      return range + "a finite range";
  }
  return "";
}

std::string contact_fault(const Scene& scene, const GroundContactDescription& d) {
  if (!scene.ground) return "the scene has no <ground> for '" + d.body + "' to touch";
  const LinkDescription* const link = link_with_body(scene, d.body);
  return first_of(link == nullptr ? "" : points_fault("body", d.body, link->body.shape),
                  value_fault(kGroundContact, d.coefficients));
}

std::string contact_fault(const Scene& scene, const PairContactDescription& d) {
  if (d.general_body == d.primitive_body)
    return "body '" + d.general_body + "' against itself; expected two bodies";
  if (d.on_ground && !scene.ground)
    return "the scene has no <ground> for '" + d.general_body + "' to touch";
  const LinkDescription *const one = link_with_body(scene, d.general_body),
                               *const two = link_with_body(scene, d.primitive_body);
  if (one == nullptr || two == nullptr) return "";
  const Shape &general = one->body.shape, &primitive = two->body.shape;
  if (d.points.empty())
    if (std::string fault = points_fault("general_body", d.general_body, general); !fault.empty())
      return fault;
  if (!has_distance(primitive))
    return fmt::format(
        "primitive_body '{}' is {} body, which has no distance; expected {}", d.primitive_body,
        with_article(shape_name(primitive)),
        std::holds_alternative<MeshShape>(primitive)
            ? "a resolution of 1 or more"
            : shapes_with([](const ShapeRow& row) { return row.distance.has_value(); }));
  if (d.points.empty() && !can_touch(general, primitive))
    return fmt::format(
        "general_body '{}' is a sphere, and primitive_body '{}' a mesh, whose distance is known "
        "only near its surface; expected <surface_contact>, in which the sphere has points, or the "
        "mesh as general_body"
        " with points nearer to each other than the sphere is wide",
        d.general_body, d.primitive_body);
  if (d.areas.size() != (d.per_area() ? d.points.size() / 3 : 0))
    return fmt::format("'{}' has {} areas for {} points; expected as many", d.first_name(),
                       d.areas.size(), d.points.size() / 3);
  return value_fault(d.per_area() ? kSurfaceContact : kPairContact, d.coefficients);
}

std::string loop_fault(const Scene& scene, const LoopDescription& loop) {
  if (loop.body1 == loop.body2) return "body '" + loop.body1 + "' with itself; expected two bodies";
  for (const LoopDescription& other : scene.loops) {
    if (&other == &loop) break;
    if (other.name == loop.name)
      return "another loop has the name '" + loop.name + "' already; expected a name of its own";
  }
  if (!loop.weld && (loop.orientation2 || loop.turning_stiffness != 0 || loop.turning_damping != 0))
    return "a point has no axes; expected a weld, or neither axes nor springs that turn";
  return value_fault(loop.weld ? kWeld : kConnect, loop);
}

std::string transmission_fault(const TransmissionDescription& transmission) {
  const auto is_zero = [](const Vector3& x) { return x == Vector3{0, 0, 0}; };
  if (transmission.kind == TransmissionDescription::Kind::wrench) {
    if (transmission.reference && !is_zero(transmission.torque))
      return "a torque along axes of another body has no length; expected a force alone";
    return is_zero(transmission.force) && is_zero(transmission.torque)
               ? "neither a force nor a torque; expected one"
               : "";
  }
  for (const PathPart& part : transmission.path) {
    const bool pulley = part.kind == PathPart::Kind::pulley;
    const double number = pulley ? part.divisor : part.radius;
    if (part.kind != PathPart::Kind::point && !(number > 0 && std::isfinite(number)))
      return fmt::format("{}=\"{}\"; expected a positive number", pulley ? "divisor" : "radius",
                         number);
    if (part.kind == PathPart::Kind::cylinder && is_zero(part.axis))
      return "axis=\"0 0 0\"; expected a direction";
  }
  return "";
}

std::string markers_fault(const TactileDescription& sensor) {
  return sensor.markers ? value_fault(kMarkers, *sensor.markers) : "";
}

std::string picture_fault(const TactileDescription& sensor) {
  const PictureDescription& of = *sensor.picture;
  if (!sensor.points.empty()) return "points in a list; expected a flat array, type=\"rect_array\"";
  if (sensor.array.rows < 2 || sensor.array.cols < 2)
    return fmt::format("{} x {} points; expected at least 2 x 2", sensor.array.rows,
                       sensor.array.cols);
  if (of.gel == nullptr) return "no gel; expected one, such as default_gel()";
  if (of.markers[0] > 0 && !sensor.markers)
    return "markers without <markers>, which says how they move; expected both";
  return value_fault(kGelPicture, of);
}

std::string channels_fault(const TactileDescription& sensor) {
  const ChannelsDescription& of = *sensor.channels;
  if (of.map == nullptr) return "no map; expected one";
  // A list may be the points of an array that were moved.
  const bool grid =
      sensor.points.empty() ||
      std::ssize(sensor.points) == std::ptrdiff_t{sensor.array.rows} * sensor.array.cols;
  std::string fault =
      channel_map_fault(*of.map, grid ? sensor.array.rows : 0, grid ? sensor.array.cols : 0);
  if (fault.empty()) fault = value_fault(kChannels, of);
  if (fault.empty() && of.saturation != 0 && of.quantisation > of.saturation)
    fault = fmt::format(
        "quantisation=\"{}\" with saturation=\"{}\": every channel is 0; expected a quantisation "
        "of "
        "no more than the saturation",
        of.quantisation, of.saturation);
  return fault;
}

std::string varying_value_fault(const SceneNumber& n, double value) {
  const Attribute& row = number_kind(n.owner, n.field);
  if (std::string fault = row.fault(value); !fault.empty()) return fault;
  return n.owner == NumberOwner::body && !(value > 0)
             ? fmt::format("{}=\"{}\"; expected a positive number", row.name, value)
             : "";
}

std::string variation_fault(const Scene& scene, const RandomizationDescription& d) {
  const SceneNumber& n = d.number;
  std::string fault = first_of(varying_number_fault(scene, n), tie_fault(scene, d));
  const bool bounded =
      !is_of_start(n) && n.field != Field::pos && n.field != Field::look && n.field != Field::light;
  if (fault.empty() && bounded && d.distribution.kind == Distribution::Kind::normal)
    fault = "normal can draw a negative value; expected uniform, log_uniform or list";
  if (fault.empty() && bounded)
    fault = first_of(varying_value_fault(n, least_of(d.distribution)),
                     varying_value_fault(n, most_of(d.distribution)));
  return fault.empty() ? "" : "'" + name_of(n) + "' varies, but " + fault;
}

void check_scene(const Scene& scene) {
  const auto check = [&](const Source& source, const std::string& of, const std::string& fault) {
    if (!fault.empty()) throw InputError(source.prefix() + of + fault);
  };
  const Source whole{scene.path, 0};
  check(whole, "", value_fault(kOption, scene));
  check(whole, "", value_fault(kSolver, scene.solver));
  for (const LinkDescription& link : scene.links) {
    check(link.joint.source, "joint '" + link.joint.name + "': ", joint_fault(link.joint));
    check(link.body.source, "body '" + link.body.name + "' is ", body_fault(link.body));
  }
  for (const MotorDescription& d : scene.motors)
    check(d.source, "motor of joint '" + d.joint + "': ", motor_fault(scene, d));
  for (const GroundContactDescription& d : scene.ground_contacts)
    check(d.source, "", contact_fault(scene, d));
  for (const PairContactDescription& d : scene.pair_contacts)
    check(d.source, "", contact_fault(scene, d));
  for (const LoopDescription& d : scene.loops)
    check(d.source, "loop '" + d.name + "': ", loop_fault(scene, d));
  for (const TransmissionDescription& d : scene.transmissions)
    check(d.source, "transmission '" + d.joint + "': ", transmission_fault(d));
  for (const TactileDescription& d : scene.sensors) {
    check(d.source, "tactile sensor '" + d.name + "': ", value_fault(kTactile, d.coefficients));
    if (d.markers) check(d.markers->source, "markers of '" + d.name + "': ", markers_fault(d));
    if (d.picture) check(d.picture->source, "picture of '" + d.name + "': ", picture_fault(d));
    if (d.channels) check(d.channels->source, "channels of '" + d.name + "': ", channels_fault(d));
    if (d.table) check(d.source, "pressure of '" + d.name + "': ", table_fault(d));
    if (d.layer)
      check(d.layer->source, "layer of '" + d.name + "': ", value_fault(kLayer, *d.layer));
  }
  for (const RandomizationDescription& d : scene.randomizations)
    check(d.source, "", variation_fault(scene, d));
}

}  // namespace tangere
