// SPDX-License-Identifier: Apache-2.0
// A link's frame is that of the joint which carries it. All numbers are in SI, angles in radians.
#include "io/robot/urdf_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "io/robot/mesh_files.hpp"
#include "io/robot/mjcf_words.hpp"
#include "io/robot/rotations.hpp"
#include "io/robot/urdf_parts.hpp"
#include "io/robot/urdf_skins.hpp"

namespace tangere {
namespace {

constexpr int kDeepestChain = 150;  // links of a chain; a scene's limit is 200, and some take two

const char* const kPictures = "for pictures only";
const char* const kSoftware = "a setting of other software";
const char* const kOtherLaw = "coefficients of another contact law";

const Words kRobotChildren = {
    {"link"},
    {"joint"},
    {"material", Fate::idle, kPictures},
    {"transmission", Fate::idle, "a setting of other software; --motor JOINT=… drives a joint"},
    {"gazebo", Fate::idle, kSoftware},
    {"mujoco"},
    {"drake", Fate::idle, kSoftware},
    {"ros2_control", Fate::idle, kSoftware},
    {"sensor"},
    {"group", Fate::idle, kSoftware},
    {"disable_collisions", Fate::idle, kSoftware},
    {"deformable", Fate::lost, "a body that bends; scenes have none"}};
const Words kLinkChildren = {{"inertial"},
                             {"collision"},
                             {"visual", Fate::idle, kPictures},
                             {"contact", Fate::idle, kOtherLaw},
                             {"surface", Fate::idle, kOtherLaw},
                             {"origin", Fate::idle, "a link is where its joint puts it"},
                             {"gravity", Fate::idle, kSoftware},
                             {"kinematic", Fate::idle, kSoftware},
                             {"self_filter", Fate::idle, kSoftware},
                             {"collision_checking", Fate::idle, kSoftware},
                             {"self_collision_checking", Fate::idle, kSoftware}};
const Words kJointChildren = {{"origin"},
                              {"parent"},
                              {"child"},
                              {"axis"},
                              {"limit"},
                              {"dynamics"},
                              {"mimic"},
                              {"calibration", Fate::idle, kSoftware},
                              {"joint_properties", Fate::idle, kSoftware},
                              {"safety_controller", Fate::idle, kSoftware}};

/// What MuJoCo reads in the <mujoco> of a URDF file.
const Words kExtension = {{"compiler"},
                          {"option"},
                          {"size", Fate::idle, "sizes of MuJoCo's memory"},
                          {"visual", Fate::idle, kPictures},
                          {"statistic", Fate::idle, kPictures},
                          {"custom", Fate::idle, "numbers for other programs"},
                          {"asset", Fate::idle, kPictures},
                          {"sensor", Fate::idle, "readings of MuJoCo"},
                          {"keyframe", Fate::idle, "stored states"},
                          {"default", Fate::lost, "what elements of MuJoCo inherit"},
                          {"worldbody", Fate::lost, "bodies beside the robot"},
                          {"actuator", Fate::lost, "actuators; --motor JOINT=… drives a joint"},
                          {"contact", Fate::lost, "contacts; --contact A=B adds one"},
                          {"equality", Fate::lost, "constraints; scenes have none"},
                          {"tendon", Fate::lost, "tendons; scenes have none"},
                          {"deformable", Fate::lost, "bodies that bend; scenes have none"},
                          {"extension", Fate::lost, "plug-ins of MuJoCo"}};
const Words kMujocoCompiler = {
    {"meshdir"},
    {"assetdir"},
    {"balanceinertia"},
    {"settotalmass"},
    {"inertiafromgeom"},
    {"boundmass", Fate::zero, "raises masses"},
    {"boundinertia", Fate::zero, "raises inertias"},
    {"strippath", Fate::idle, "meshes are looked for with and without"},
    {"angle", Fate::idle, "angles of URDF are radians"},
    {"eulerseq", Fate::idle, "angles of URDF are roll, pitch, yaw"},
    {"autolimits", Fate::idle, "joints of URDF say what limits them"},
    {"alignfree", Fate::idle, "bodies keep the frames that the file gives"},
    {"coordinate", Fate::idle, kSoftware},
    {"inertiagrouprange", Fate::idle, "URDF has no groups"},
    {"texturedir", Fate::idle, kPictures},
    {"discardvisual", Fate::idle, kPictures},
    {"fusestatic", Fate::idle, "fixed joints cost nothing here"},
    {"convexhull", Fate::idle, "meshes are not replaced by hulls"},
    {"exactmeshinertia", Fate::idle, "meshes of URDF have no mass"},
    {"fitaabb", Fate::idle, "no primitive is fitted to a mesh"},
    {"usethread", Fate::idle, kSolverSetting},
    {"saveinertial", Fate::idle, kSolverSetting},
    {"conflict", Fate::idle, kSolverSetting}};

/// A joint of the file, with the names of its links.
struct Joint {
  JointDescription joint;
  std::string type, parent, child;
  RobotNode node;
  bool used = false;
};

class UrdfReader {
 public:
  UrdfReader(const RobotNode& root, bool free_base)
      : root_(root), robot_(root.robot()), free_base_(free_base) {}

  void read() {
    root_.check({{"name"}, {"version", Fate::read}});
    robot_.scene.name = root_.text("name", "robot");
    std::vector<RobotNode> links;
    const std::vector<RobotNode> parts = root_.parts(kRobotChildren);
    for (const RobotNode& node : parts)
      if (node.name() == "mujoco") read_extension(node);
    for (const RobotNode& node : parts) {
      if (node.name() == "mujoco" || node.name() == "sensor") continue;
      if (node.name() == "link") {
        node.check({{"name"}, {"type", Fate::idle, kSoftware}, {"concave", Fate::idle, kSoftware}});
        const std::string name = node.text("name");
        if (std::find(link_names_.begin(), link_names_.end(), name) != link_names_.end())
          node.fail("link name '" + name + "' is used twice");
        link_names_.push_back(name);
        links.push_back(node);
      } else {
        read_joint(node);
      }
    }
    if (links.empty()) root_.fail("has no <link>");
    for (const RobotNode& node : parts) {
      if (node.name() != "sensor") continue;
      if (is_skin(node))
        read_skin(node, link_names_);
      else
        node.idle("<sensor>: no sensor of touch; --pad LINK=LAYOUT adds one");
    }
    for (const Joint& joint : joints_) check_ends(joint);
    for (const std::string& name : link_names_) names_.keep(name);
    for (const Joint& joint : joints_) names_.keep(joint.joint.name);
    int roots = 0;
    for (std::size_t i = 0; i < links.size(); ++i) {
      const bool carried = std::any_of(joints_.begin(), joints_.end(),
                                       [&](const Joint& j) { return j.child == link_names_[i]; });
      if (carried) continue;
      if (++roots > 1)
        links[i].fail("link '" + link_names_[i] +
                      "' hangs on no joint, and neither does another; expected one root");
      JointDescription base;
      base.name = names_.free_name(link_names_[i] + "_base");
      base.type = free_base_ ? JointType::free : JointType::fixed;
      base.source = links[i].source();
      add(links, i, -1, base, free_base_ ? "moves freely" : "stands in the world", 0);
    }
    for (const Joint& joint : joints_)
      if (!joint.used)
        joint.node.fail("joint '" + joint.joint.name + "' is part of a ring of links, or of " +
                        "nothing that hangs on a root; expected a tree");
    hold_weightless();
    if (total_mass_ > 0) scale_masses(robot_.scene, total_mass_);
  }

 private:
  /// Reads the settings with which MuJoCo reads this file.
  void read_extension(const RobotNode& node) {
    node.check({{"model", Fate::idle, kSoftware}});
    mesh_folder_ = ".";
    for (const RobotNode& part : node.parts(kExtension))
      part.name() == "compiler" ? read_compiler(part) : read_option(part);
  }

  void read_compiler(const RobotNode& node) {
    node.check(kMujocoCompiler);
    static_cast<void>(node.parts({{"lengthrange", Fate::idle, kSolverSetting}}));
    mesh_folder_ = node.text("meshdir", node.text("assetdir", "."));
    balances_ = node.flag("balanceinertia", false);
    total_mass_ = std::max(node.number("settotalmass", 0.0), 0.0);
    if (total_mass_ > 0) node.changed("<compiler> settotalmass: all masses are scaled to it");
    if (node.choice("inertiafromgeom", {"auto", "false", "true"}, 0) == 2)
      node.lost("<compiler> inertiafromgeom: masses of the shapes take the place of the file's");
  }

  void read_option(const RobotNode& node) {
    Words words = {{"gravity"},
                   {"timestep"},
                   {"density", Fate::zero, "the air's or the water's"},
                   {"viscosity", Fate::zero, "the air's or the water's"},
                   {"wind", Fate::zero, "moves the air"}};
    for (const char* name : {"integrator", "solver", "cone", "jacobian", "iterations", "tolerance",
                             "impratio", "noslip_iterations", "ls_iterations"})
      words.push_back({name, Fate::idle, kSolverSetting});
    node.check(words);
    static_cast<void>(node.parts({{"flag", Fate::lost, "switches forces or contacts"}}));
    Scene& scene = robot_.scene;
    scene.gravity = node.vector("gravity", scene.gravity);
    scene.timestep = node.positive("timestep", scene.timestep);
    if (node.has("gravity") || node.has("timestep"))
      node.changed("<option> of <mujoco>: its gravity and timestep are the scene's");
  }

  void read_joint(const RobotNode& node) {
    node.check({{"name"}, {"type"}, {"dont_collapse", Fate::idle, kSoftware}});
    Joint out{{}, "", "", "", node};
    const std::vector<RobotNode> parts = node.parts(kJointChildren);
    static const std::vector<std::string> types = {
        "fixed", "revolute", "continuous", "prismatic", "floating", "planar", "spherical"};
    out.type = types[std::size_t(node.choice("type", types))];
    JointDescription& joint = out.joint;
    joint.name = node.text("name");
    joint.source = node.source();
    for (const Joint& other : joints_)
      if (other.joint.name == joint.name)
        node.fail(fmt::format("joint name '{}' is used twice, first in line {}", joint.name,
                              other.joint.source.line));
    const auto end_of = [&](const char* which) {
      const RobotNode end = required(node, parts, which);
      end.check({{"link"}});
      return end.text("link");
    };
    out.parent = end_of("parent");
    out.child = end_of("child");
    joint.pose = read_origin(last_of(parts, "origin"));
    const bool has_axis = out.type == "revolute" || out.type == "continuous" ||
                          out.type == "prismatic" || out.type == "planar";
    joint.axis0 = {1, 0, 0};
    if (const auto axis = last_of(parts, "axis")) {
      axis->check({{"xyz"}, {"rpy", Fate::idle, "an axis has a direction only"}});
      if (has_axis)
        joint.axis0 = axis->direction("xyz", joint.axis0);
      else
        axis->idle("<axis> of a joint that has none");
    }
    if (out.type == "revolute" || out.type == "continuous") joint.type = JointType::revolute;
    if (out.type == "prismatic") joint.type = JointType::prismatic;
    if (out.type == "planar") joint.type = JointType::free2d;
    if (out.type == "floating") joint.type = JointType::free;
    if (out.type == "spherical") joint.type = JointType::spherical;
    read_limit(node, parts, out);
    if (const auto dynamics = last_of(parts, "dynamics")) {
      Words words = {{"damping"}, {"friction"}};
      for (const char* other : {"D", "K", "mu_coulomb", "mu_viscous"})
        words.push_back({other, Fate::idle, kSoftware});
      dynamics->check(words);
      joint.damping = dynamics->not_negative("damping", 0.0);
      joint.friction = dynamics->not_negative("friction", 0.0);
      if (joint.friction != 0 &&
          (joint.type == JointType::free || joint.type == JointType::spherical)) {
        joint.friction = 0;
        dynamics->lost("<dynamics> friction: dry friction of a joint that turns freely");
      }
      if (joint.type == JointType::fixed && (joint.damping != 0 || joint.friction != 0)) {
        joint.damping = joint.friction = 0;
        dynamics->idle("<dynamics> of a fixed joint");
      }
    }
    if (const auto mimic = last_of(parts, "mimic")) {
      mimic->check({{"joint"}, {"multiplier"}, {"offset"}});
      joint.follows = {mimic->text("joint")};
      joint.ratio = {mimic->number("multiplier", 1.0)};
      joint.offset = mimic->number("offset", 0.0);
    }
    joints_.push_back(std::move(out));
  }

  void read_limit(const RobotNode& node, const std::vector<RobotNode>& parts, Joint& out) const {
    const auto limit = last_of(parts, "limit");
    const bool needed = out.type == "revolute" || out.type == "prismatic";
    if (!limit) {
      if (needed) node.fail("a " + out.type + " joint has no <limit>; expected one");
      return;
    }
    Words words = {{"lower"},
                   {"upper"},
                   {"effort"},
                   {"twist", Fate::lost, "the range of a spherical joint"},
                   {"velocity", Fate::idle, "the largest speed, which the controller keeps"}};
    for (const char* other : {"acceleration", "jerk", "command_effort", "current", "gear_velocity"})
      words.push_back({other, Fate::idle, kSoftware});
    limit->check(words);
    if (const double effort = limit->not_negative("effort", 0.0); effort > 0)
      robot_.efforts[out.joint.name] = effort;
    const bool bounded = limit->given("lower") || limit->given("upper");
    if (!needed) {
      if (bounded) limit->idle("<limit> lower, upper: of a " + out.type + " joint");
      return;
    }
    const double low = limit->number("lower", 0.0), high = limit->number("upper", 0.0);
    if (low > high)
      limit->changed("<limit> lower above upper: the joint is without limits, as in PyBullet");
    else if (low < high)
      out.joint.limits = {low, high};
    else
      limit->changed("<limit> lower and upper are equal, so the joint is without limits");
  }

  void check_ends(const Joint& joint) const {
    for (const std::string& end : {joint.parent, joint.child})
      if (std::find(link_names_.begin(), link_names_.end(), end) == link_names_.end())
        joint.node.fail(fmt::format("joint '{}': no link is named '{}'{}", joint.joint.name, end,
                                    suggestion(end, link_names_)));
    for (const Joint& other : joints_)
      if (&other != &joint && other.child == joint.child)
        joint.node.fail(fmt::format("link '{}' is the child of two joints, '{}' and '{}'",
                                    joint.child, other.joint.name, joint.joint.name));
  }

  /// Fixes joints that move no mass: their mass matrix would be singular.
  void hold_weightless() {
    std::vector<LinkDescription>& links = robot_.scene.links;
    std::vector<char> heavy(links.size());
    for (std::size_t i = links.size(); i-- > 0;) {
      const auto* const mass = std::get_if<AbstractShape>(&links[i].body.shape);
      heavy[i] |= mass != nullptr && mass->mass > 0;
      if (links[i].parent >= 0) heavy[std::size_t(links[i].parent)] |= heavy[i];
      JointDescription& joint = links[i].joint;
      if (heavy[i] || joint.type == JointType::fixed) continue;
      robot_.lost.add(joint.source,
                      "joint '" + joint.name + "' moves nothing that has a mass: it is held");
      JointDescription held;
      held.name = joint.name;
      held.pose = joint.pose;
      held.source = joint.source;
      joint = held;
    }
  }

  /// Adds link `i` and all that hang on it.
  void add(const std::vector<RobotNode>& links, std::size_t i, int parent, JointDescription joint,
           const std::string& how, int depth) {
    const RobotNode& node = links[i];
    if (depth > kDeepestChain)
      node.fail(fmt::format("more than {} links in a chain", kDeepestChain));
    const std::string& name = link_names_[i];
    const std::string origin = fmt::format("<link>, {}", how);
    // A planar joint moves across its axis, and a free2d joint across z.
    const Pose aligned{{0, 0, 0}, from_z(joint.axis0)};
    if (joint.type == JointType::free2d && aligned.orientation[0] < 1) {
      joint.pose = compose(joint.pose, aligned);
      JointDescription rest;
      rest.name = names_.free_name(name + "_turn");
      rest.pose = inverse(aligned);
      rest.source = joint.source;
      const std::string plane = names_.free_name(name + "_plane");
      parent = add_link(robot_, names_, plane, parent, joint, {}, "z across the plane of the joint",
                        joint.source);
      joint = rest;
    }
    const std::vector<RobotPiece> pieces = pieces_of(node, joint, parent);
    const int index =
        add_link(robot_, names_, name, parent, std::move(joint), pieces, origin, node.source());
    for (Joint& next : joints_) {
      if (next.parent != name) continue;
      next.used = true;
      const auto child = std::find(link_names_.begin(), link_names_.end(), next.child);
      add(links, std::size_t(child - link_names_.begin()), index, next.joint,
          fmt::format("on the {} joint '{}' of line {}", next.type, next.joint.name,
                      next.joint.source.line),
          depth + 1);
    }
  }

  /// Whether a link or one of its pieces has moments of inertia.
  [[nodiscard]] bool has_inertia(int link) const {
    const std::vector<LinkDescription>& links = robot_.scene.links;
    for (std::size_t k = 0; k < links.size(); ++k) {
      const bool own = static_cast<int>(k) == link,
                 piece = links[k].parent == link && robot_.pieces.contains(links[k].name);
      const auto* const mass = std::get_if<AbstractShape>(&links[k].body.shape);
      if ((own || piece) && mass != nullptr && is_inertia(mass->inertia)) return true;
    }
    return false;
  }

  /// Whether a link on `joint` of link `parent` needs moments of inertia, if its mass lies at
  /// `centre` of its frame. A point off the axis of its own joint moves whenever the joint does, so
  /// that the mass matrix stays positive.
  [[nodiscard]] Moments moments_of(const JointDescription& joint, int parent,
                                   const Vector3& centre) const {
    constexpr double kOff = 1e-3;  // [m]
    if (stands(robot_, joint, parent)) return Moments::idle;
    const Vector3& a = joint.axis0;
    const double along = centre[0] * a[0] + centre[1] * a[1] + centre[2] * a[2];
    const double off =
        std::hypot(centre[0] - along * a[0], centre[1] - along * a[1], centre[2] - along * a[2]);
    const bool moves =
        joint.type == JointType::prismatic || (joint.type == JointType::revolute && off > kOff);
    const bool carried = joint.type == JointType::fixed && has_inertia(parent);
    return moves || carried ? Moments::dispensable : Moments::needed;
  }

  /// Of a link on `joint` of link `parent`.
  [[nodiscard]] std::vector<RobotPiece> pieces_of(const RobotNode& node,
                                                  const JointDescription& joint, int parent) const {
    std::vector<RobotPiece> pieces;
    const std::vector<RobotNode> parts = node.parts(kLinkChildren);
    for (const RobotNode& part : parts) {
      if (part.name() != "collision") continue;
      if (auto piece = read_collision(part)) pieces.push_back(std::move(*piece));
    }
    const auto inertial = last_of(parts, "inertial");
    if (!inertial) return pieces;
    inertial->check({});
    const std::vector<RobotNode> inside = inertial->parts({{"origin"}, {"mass"}, {"inertia"}});
    const RobotNode mass = required(*inertial, inside, "mass");
    mass.check({{"value"}});
    std::array<double, 6> I{};
    if (const auto inertia = last_of(inside, "inertia")) {
      Words six;
      for (const char* name : {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"}) {
        I[six.size()] = inertia->number(name, 0.0);
        six.push_back({name});
      }
      inertia->check(six);
    }
    if (balances_ && balance_inertia(I))
      inertial->changed("<inertial>: all moments are their mean, as balanceinertia says");
    const Pose pose = read_origin(last_of(inside, "origin"));
    if (auto piece = inertial_piece(robot_, mass.number("value"), I, pose, "<inertial>",
                                    inertial->source(), moments_of(joint, parent, pose.position)))
      pieces.push_back(std::move(*piece));
    return pieces;
  }

  /// None if scenes cannot have its shape.
  [[nodiscard]] std::optional<RobotPiece> read_collision(const RobotNode& node) const {
    node.check({{"name", Fate::read},
                {"group", Fate::idle, kSoftware},
                {"mask", Fate::idle, kSoftware},
                {"concave", Fate::idle, kSoftware}});
    const std::vector<RobotNode> parts =
        node.parts({{"origin"},
                    {"geometry"},
                    {"verbose", Fate::idle, kSoftware},
                    {"material", Fate::idle, kPictures},
                    {"surface", Fate::idle, kOtherLaw},
                    {"contact_coefficients", Fate::idle, kOtherLaw}});
    RobotPiece piece;
    piece.pose = read_origin(last_of(parts, "origin"));
    piece.origin = "<collision>";
    piece.source = node.source();
    const RobotNode geometry = required(node, parts, "geometry");
    geometry.check({{"name", Fate::read}});
    const std::vector<RobotNode> shapes =
        geometry.parts({{"box"}, {"sphere"}, {"cylinder"}, {"capsule"}, {"mesh"}});
    if (shapes.size() != 1)
      geometry.fail(fmt::format("has {} shapes; expected one", shapes.size()));
    if (!read_shape(shapes[0], piece)) return std::nullopt;
    return piece;
  }

  [[nodiscard]] bool read_shape(const RobotNode& node, RobotPiece& piece) const {
    const std::string type = node.name();
    if (type == "box") {
      node.check({{"size"}});
      CuboidShape box;
      box.size = node.vector("size");
      for (const double edge : box.size)
        if (!(edge > 0)) node.fail(fmt::format("size has {}; expected positive lengths", edge));
      piece.shape = box;
    } else if (type == "sphere") {
      node.check({{"radius"}});
      piece.shape = SphereShape{node.positive("radius")};
    } else if (type == "mesh") {
      node.check({{"filename"}, {"scale"}});
      auto mesh = read_robot_mesh(node, node.text("filename"), "",
                                  node.vector("scale", Vector3{1, 1, 1}), mesh_folder_);
      if (!mesh) return false;
      piece.mesh = mesh->file;
      piece.shape = std::move(mesh->shape);
    } else {
      node.check({{"radius"}, {"length"}, {"name", Fate::read}});
      const double radius = node.positive("radius"), length = node.positive("length");
      if (type == "cylinder")
        piece.shape = CylinderShape{length, radius};
      else
        piece.shape = CapsuleShape{length, radius};
    }
    return true;
  }

  const RobotNode& root_;
  Robot& robot_;
  bool free_base_;
  // By <compiler> of MuJoCo: folder of meshes, whether impossible inertias are balanced, and the
  // sum of all masses [kg] (0: the file's).
  std::optional<std::string> mesh_folder_;
  bool balances_ = false;
  double total_mass_ = 0;
  RobotNames names_;
  std::vector<std::string> link_names_;
  std::vector<Joint> joints_;
};

}  // namespace

void read_urdf(const RobotNode& root, bool free_base) {
  root.robot().format = "URDF";
  UrdfReader(root, free_base).read();
}

}  // namespace tangere
