// SPDX-License-Identifier: Apache-2.0
// Chooses what robot files do not define: stiffness of limits, contact pairs, poses of skins.
#include "io/robot/robot_import.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/model/model.hpp"
#include "engine/scene/outer_pose.hpp"
#include "engine/scene/shapes.hpp"
#include "engine/scene/surface_contact.hpp"
#include "engine/scene/surface_points.hpp"
#include "io/files/text_file.hpp"
#include "io/robot/joint_loads.hpp"
#include "io/robot/mjcf_reader.hpp"
#include "io/robot/robot_pads.hpp"
#include "io/robot/rotations.hpp"
#include "io/robot/scene_writer.hpp"
#include "io/robot/urdf_reader.hpp"
#include "io/scene/scene_reader.hpp"
#include "io/scene/xml_document.hpp"

namespace tangere {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestRobot = std::size_t{64} << 20;
constexpr const char* kRoots = "the root <robot> (URDF) or <mujoco> (MJCF)";
constexpr double kYieldAngle = 0.01, kYieldLength = 1e-3;  // of a limit under its load [rad], [m]
constexpr double kLoopGap = 1e-6;                          // of a loop under its load [m]
constexpr int kDeepestLinks = 200;                         // of a scene

/// Rounds up to two digits, because such a number is a choice.
double two_digits(double x) {
  const double unit = std::pow(10.0, std::floor(std::log10(x)) - 1);
  return std::ceil(x / unit - 1e-9) * unit;
}

/// Chooses the stiffness of limits that have none: under their load they yield by kYieldAngle or
/// kYieldLength.
void stiffen_limits(Robot& robot) {
  JointLoads loads(robot, JointLoads::Holder::limit);
  for (std::size_t i = 0; i < robot.scene.links.size(); ++i) {
    JointDescription& joint = robot.scene.links[i].joint;
    if (!joint.limits || joint.limit_stiffness != 0) continue;
    const double load = loads.load(i);
    const bool turns = joint.type == JointType::revolute;
    joint.limit_stiffness = two_digits(load / (turns ? kYieldAngle : kYieldLength));
  }
}

/// Chooses the stiffness of loops: under their load they yield by kLoopGap.
void stiffen_loops(Robot& robot) {
  if (robot.scene.loops.empty()) return;
  JointLoads loads(robot, JointLoads::Holder::loop);
  for (LoopDescription& loop : robot.scene.loops) {
    const auto link_of = [&](const std::string& body) {
      return std::size_t(std::ranges::find_if(robot.scene.links,
                                              [&](const auto& l) { return l.body.name == body; }) -
                         robot.scene.links.begin());
    };
    const std::size_t one = link_of(loop.body1);
    const Vector3 point = loads.place(one, loop.position1);
    double load = loads.load_at(one, point), reach = loads.distance(one, point);
    if (!loop.body2.empty()) {
      const std::size_t two = link_of(loop.body2);
      load = std::max(load, loads.load_at(two, point));
      reach = std::max(reach, loads.distance(two, point));
    }
    loop.stiffness = two_digits(load / kLoopGap);
    if (loop.weld)
      loop.turning_stiffness = two_digits(loop.turning_stiffness * loop.stiffness * reach * reach);
  }
}

/// The coordinate of a joint of one dof at the start. Followers that are read are in no circle.
double start_of_joint(const Scene& scene, const std::string& joint) {
  const auto link = std::ranges::find_if(
      scene.links, [&](const LinkDescription& l) { return l.joint.name == joint; });
  if (link != scene.links.end() && !link->joint.follows.empty()) {
    double q = link->joint.offset;
    for (std::size_t k = 0; k < link->joint.follows.size(); ++k)
      q += link->joint.share_of_leader(k, start_of_joint(scene, link->joint.follows[k]));
    return q;
  }
  for (const InitialState& s : scene.initial)
    if (s.joint == joint && s.q.size() == 1) return s.q[0];
  return 0;
}

/// A control with which a motor without keyframe value keeps its joint at the start.
double resting_control(const Scene& scene, const MotorDescription& motor) {
  return motor.control == MotorControl::position ? start_of_joint(scene, motor.joint) : 0;
}

void add_motors(Robot& robot, const std::vector<MotorRequest>& requests, const std::string& file) {
  for (const MotorRequest& request : requests) {
    std::vector<std::string> names;
    const LinkDescription* link = nullptr;
    for (const LinkDescription& l : robot.scene.links) {
      if (l.joint.type == JointType::fixed) continue;
      names.push_back(l.joint.name);
      if (l.joint.name == request.joint) link = &l;
    }
    if (link == nullptr)
      throw InputError(fmt::format("--motor {}: {} has no joint of this name that moves{}",
                                   request.joint, file, suggestion(request.joint, names)));
    for (const MotorDescription& m : robot.scene.motors)
      if (m.joint == request.joint)
        throw InputError(fmt::format("--motor {}: the joint has a motor already", request.joint));
    MotorDescription motor;
    motor.joint = request.joint;
    const auto effort = robot.efforts.find(request.joint);
    const bool bounded = effort != robot.efforts.end();
    if (!request.P && !bounded)
      throw InputError(
          fmt::format("--motor {}=force: {}the joint has no bound of its force (<limit effort> of "
                      "URDF, actuatorfrcrange of MJCF); "
                      "expected one, or {}=P,D",
                      request.joint, link->joint.source.prefix(), request.joint));
    motor.high = bounded ? effort->second : std::numeric_limits<double>::infinity();
    motor.low = -motor.high;
    if (request.P) {
      motor.control = MotorControl::position;
      motor.P = *request.P;
      motor.D = request.D;
    }
    robot.scene.motors.push_back(motor);
    if (robot.controls) robot.controls->push_back(resting_control(robot.scene, motor));
  }
}

/// The bodies of a link that have a shape, but for those that touch nothing in the file.
std::vector<std::string> shapes_of(const Robot& robot, const std::string& name,
                                   const std::string& what, const std::string& file) {
  std::vector<std::string> names, shapes;
  for (const LinkDescription& l : robot.scene.links) names.push_back(l.name);
  const auto link = std::find(names.begin(), names.end(), name);
  if (link == names.end())
    throw InputError(
        fmt::format("{}: {} has no link '{}'{}", what, file, name, suggestion(name, names)));
  const auto index = static_cast<int>(link - names.begin());
  const char* pictures = "";
  for (std::size_t k = 0; k < names.size(); ++k) {
    const LinkDescription& l = robot.scene.links[k];
    const bool piece = l.parent == index && robot.pieces.contains(l.name);
    if ((static_cast<int>(k) != index && !piece) ||
        std::holds_alternative<AbstractShape>(l.body.shape))
      continue;
    if (std::ranges::find(robot.untouched, l.body.name) == robot.untouched.end())
      shapes.push_back(l.body.name);
    else
      pictures = ": its geoms have contype and conaffinity 0";
  }
  if (shapes.empty())
    throw InputError(
        fmt::format("{}: link '{}' has no shape to touch with{}", what, name, pictures));
  return shapes;
}

/// Whether the link hangs on a joint that moves.
bool moves(const Scene& scene, const std::string& name) {
  auto at = std::find_if(scene.links.begin(), scene.links.end(),
                         [&](const LinkDescription& l) { return l.name == name; });
  while (at->joint.type == JointType::fixed) {
    if (at->parent < 0) return false;
    at = scene.links.begin() + at->parent;
  }
  return true;
}

std::string contact_text(const std::string& body1, const std::string& body2) {
  return fmt::format("    <surface_contact body1=\"{}\" body2=\"{}\"/>\n", attribute_text(body1),
                     attribute_text(body2));
}

std::string contacts_text(Robot& robot, const std::vector<TouchRequest>& requests,
                          const std::string& file) {
  std::string text;
  const auto shape_of = [&](const std::string& body) -> const Shape& {
    return std::find_if(robot.scene.links.begin(), robot.scene.links.end(),
                        [&](const LinkDescription& l) { return l.body.name == body; })
        ->body.shape;
  };
  for (const TouchRequest& request : requests) {
    const std::string what = fmt::format("--contact {}={}", request.first, request.second);
    const std::vector<std::string> first = shapes_of(robot, request.first, what, file);
    if (request.second == "ground") {
      if (!moves(robot.scene, request.first))
        throw InputError(fmt::format("{}: link '{}' stands in the world", what, request.first));
      if (!robot.scene.ground) robot.scene.ground = GroundDescription{};
      for (const std::string& body : first) text += contact_text(body, kGroundName);
      continue;
    }
    for (const std::string& a : first)
      for (const std::string& b : shapes_of(robot, request.second, what, file)) {
        if (!has_surface(shape_of(a)) && !has_surface(shape_of(b)))
          throw InputError(
              fmt::format("{}: neither of '{}' and '{}' has a surface with an end", what, a, b));
        text += contact_text(a, b);
      }
  }
  return text;
}

std::string end_effectors_text(const Robot& robot, const std::vector<std::string>& names,
                               const std::string& file) {
  std::string text;
  for (const std::string& name : names) {
    const RobotPlace place = find_place(robot, name, "--end-effector " + name, file);
    const Vector3& p = place.pose.position;
    text += fmt::format("    <endeffector name=\"{}\" joint=\"{}\" pos=\"{} {} {}\"/>\n",
                        attribute_text(name), attribute_text(place.link->joint.name),
                        number_text(p[0]), number_text(p[1]), number_text(p[2]));
  }
  return text;
}

/// Lists the sites that no option has used.
void list_sites(Robot& robot, const RobotOptions& options) {
  const auto used = [&](const std::string& name) {
    return std::find(options.end_effectors.begin(), options.end_effectors.end(), name) !=
               options.end_effectors.end() ||
           std::any_of(options.pads.begin(), options.pads.end(),
                       [&](const PadRequest& pad) { return pad.link == name; });
  };
  for (const auto& [name, site] : robot.sites)
    if (!used(name))
      robot.idle.add(
          site.source,
          "<site>: a place with a name; --end-effector SITE and --pad SITE=LAYOUT use it");
}

std::string list_text(const char* title, const std::vector<std::string>& lines) {
  if (lines.empty()) return "";
  std::string text = fmt::format("\n     {}\n", title);
  for (const std::string& line : lines) text += "       " + line + "\n";
  return text;
}

void refuse_deep(const Scene& scene) {
  std::vector<int> depth;
  for (const LinkDescription& link : scene.links) {
    depth.push_back(link.parent < 0 ? 0 : depth[std::size_t(link.parent)] + 1);
    if (depth.back() > kDeepestLinks)
      throw InputError(fmt::format("{}link '{}' is deeper than {} links", link.body.source.prefix(),
                                   link.name, kDeepestLinks));
  }
}

bool stands_still(const Scene& scene) {
  return std::all_of(scene.links.begin(), scene.links.end(), [](const LinkDescription& link) {
    return link.joint.type == JointType::fixed;
  });
}

Robot read_robot(const std::string& text, const std::string& name, const RobotOptions& options,
                 std::vector<std::string>& warnings) {
  Robot robot;
  robot.scene.path = name;
  robot.scene.gravity = {0, 0, -9.81};
  robot.scene.timestep = 5e-3;
  robot.scene.integrator = Integrator::bdf2;
  tinyxml2::XMLDocument document;
  SceneContext context;
  context.file = name;
  context.allow_unknown = options.allow_unknown;
  const tinyxml2::XMLElement& element = parse_xml(document, text, name, kRoots, context.warnings);
  const RobotNode root(element, context, robot);
  if (root.name() == "robot") {
    if (!options.keyframe.empty())
      throw InputError("--keyframe with " + name + ": a URDF file has no keyframes");
    read_urdf(root, options.free_base);
  } else if (root.name() == "mujoco") {
    read_mjcf(root, options.keyframe, options.free_base);
  } else {
    root.fail(
        std::string("no robot; expected ") + kRoots +
        (root.name() == "tangere" || root.name() == "redmax" ? ". This is a scene already" : ""));
  }
  if (robot.scene.links.empty()) root.fail("has no body: there is nothing to simulate");
  warnings = std::move(context.warnings);
  return robot;
}

}  // namespace

ImportedScene import_robot(const fs::path& path, const fs::path& output,
                           const RobotOptions& options) {
  const std::string name = path.string();
  ImportedScene out;
  Robot robot = read_robot(read_text_file(name, kLargestRobot, "a robot's file"), name, options,
                           out.warnings);
  refuse_deep(robot.scene);
  check_followers(robot);
  add_motors(robot, options.motors, name);
  const bool still = stands_still(robot.scene);
  if (!still) stiffen_limits(robot);
  if (!still) stiffen_loops(robot);
  SceneSections sections;
  sections.contacts = contacts_text(robot, options.touches, name);
  if (!sections.contacts.empty())
    sections.defaults =
        "    <!-- a guess, per area: set them for your materials -->\n"
        "    <surface_contact kn=\"1e8\" kt=\"1e6\" mu=\"1\" damping=\"1e8\"/>\n";
  // Skins feel what the file excludes where a contact is requested.
  std::erase_if(robot.excluded, [&](const auto& pair) {
    return std::ranges::any_of(options.touches, [&](const TouchRequest& t) {
      return (t.first == pair[0] && t.second == pair[1]) ||
             (t.first == pair[1] && t.second == pair[0]);
    });
  });
  sections.sensors = pads_text(robot, options.pads, name);
  sections.places = end_effectors_text(robot, options.end_effectors, name);
  list_sites(robot, options);
  out.idle = robot.idle.lines();
  out.changed = robot.changed.lines();
  out.lost = robot.lost.lines();
  sections.head = fmt::format(
      "Made by 'tangere import' from {} ({}). All numbers are in SI units; line numbers are those "
      "of that file.\n",
      path.filename().string(), robot.format);
  sections.head += list_text("Left out, and the motion differs by it:", out.lost) +
                   list_text("Said in another way:", out.changed) +
                   list_text("Left out, and of no effect on the motion:", out.idle);
  out.text = write_scene(robot, sections, output.parent_path().string());
  out.format = robot.format;
  SceneFile scene = parse_scene(out.text, output.string());
  for (std::string& warning : scene.warnings) out.warnings.push_back(std::move(warning));
  out.links = scene.scene.links.size();
  for (const LinkDescription& link : scene.scene.links)
    if (link.joint.type != JointType::fixed) ++out.joints;
  out.motors = scene.scene.motors.size();
  out.sensors = scene.scene.sensors.size();
  out.end_effectors = scene.scene.end_effectors.size();
  if (still)
    out.warnings.push_back(
        fmt::format("{}: nothing in it moves, so it cannot be simulated alone; <include> the scene "
                    "in another{}",
                    name, options.free_base ? "" : ", or let it move with --base free"));
  else
    static_cast<void>(
        Model(scene.scene));  // whatever it would refuse is refused before it is written
  return out;
}

}  // namespace tangere
