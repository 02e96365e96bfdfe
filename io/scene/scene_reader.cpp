// SPDX-License-Identifier: Apache-2.0
// Reads the file as a whole: options, defaults, the tree of links. scene_sections.cpp reads the
// sections beside the tree.
#include "io/scene/scene_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "engine/scene/outer_pose.hpp"
#include "io/files/nearest_name.hpp"
#include "io/files/text_file.hpp"
#include "io/scene/scene_cameras.hpp"
#include "io/scene/scene_folders.hpp"
#include "io/scene/scene_sections.hpp"
#include "io/scene/scene_warnings.hpp"
#include "io/scene/unlike_skins.hpp"
#include "io/scene/xml_document.hpp"

namespace tangere {

namespace {

constexpr std::uintmax_t kLargestFile = 64U
                                        << 20;  // people write scenes; larger files are a mistake
constexpr int kDeepestTree = 200;
constexpr const char* kSceneRoots = "the root <redmax> or <tangere>";

constexpr JointType kJointTypeOf[] = {  // of the words of its attribute `type`
    JointType::fixed,     JointType::revolute,      JointType::prismatic, JointType::planar,
    JointType::free2d,    JointType::translational, JointType::spherical, JointType::spherical,
    JointType::spherical, JointType::free,          JointType::free,      JointType::free};

class TreeReader {
 public:
  explicit TreeReader(Scene& scene) : scene_(scene) {}

  void read_robot(const SceneNode& robot) {
    SceneElement(robot, kRobot).check();
    for (const SceneNode& link : children_of(robot)) read_link(link, parent_of(link), 0);
  }

  /// Gives bodies without a name that of their link, with a number behind it if another body has
  /// that name.
  /// Turns the ratios of joints that follow others into SI, once all are read.
  void scale_followers() {
    for (LinkDescription& link : scene_.links)
      if (!link.joint.follows.empty())
        scale_ratios(scene_, lengths_.at(link.joint.name), link.joint);
  }

  void name_bodies() {
    for (LinkDescription& link : scene_.links) {
      if (!link.body.name.empty()) continue;
      link.body.name = link.name;
      const int line = link.body.source.line;
      for (int k = 2; !names_.try_emplace("body/" + link.body.name, line).second; ++k)
        link.body.name = fmt::format("{}_{}", link.name, k);
    }
  }

 private:
  /// Returns the link that a link directly in <robot> names as its parent; -1: it is a root.
  int parent_of(const SceneNode& node) const {
    if (!node.has("parent")) return -1;
    const std::string name = node.text("parent");
    std::vector<std::string> before;
    for (const LinkDescription& link : scene_.links) before.push_back(link.name);
    const auto found = std::find(before.begin(), before.end(), name);
    if (found == before.end())
      node.fail(fmt::format("parent=\"{}\"; expected a link that stands before it{}", name,
                            suggestion(name, before)));
    return static_cast<int>(found - before.begin());
  }

  void read_link(const SceneNode& node, int parent, int depth) {
    if (depth > kDeepestTree) node.fail(fmt::format("links nested deeper than {}", kDeepestTree));
    if (depth > 0 && node.has("parent"))
      node.fail("parent=\"" + node.text("parent") +
                "\" of a link inside another; expected it of links directly in <robot>");
    SceneElement(node, kLink).check();
    LinkDescription link;
    link.name = node.text("name");
    link.parent = parent;
    unique("link", link.name, node);
    std::vector<SceneNode> inner;
    int joints = 0, bodies = 0;
    bool in_world = false;  // whether the body's pose is given in the world
    for (const SceneNode& child : children_of(node)) {
      if (child.name() == "joint") {
        if (++joints > 1) child.fail("a second joint in link '" + link.name + "'; expected one");
        link.joint = read_joint(child, parent);
      } else if (child.name() == "body") {
        if (++bodies > 1) child.fail("a second body in link '" + link.name + "'; expected one");
        link.body = read_body(child);
        if (!link.body.name.empty()) unique("body", link.body.name, child);
        in_world = placed_in_world(child, link.body);
      } else {
        inner.push_back(child);
      }
    }
    if (joints == 0) node.fail("link '" + link.name + "' has no <joint>");
    if (bodies == 0) node.fail("link '" + link.name + "' has no <body>");
    const int index = static_cast<int>(scene_.links.size());
    scene_.links.push_back(std::move(link));
    Pose& body_pose = scene_.links.back().body.pose;
    if (in_world) body_pose = in_parent(body_pose, index);
    for (const SceneNode& child : inner) read_link(child, index, depth + 1);
  }

  void unique(const std::string& kind, const std::string& name, const SceneNode& node) {
    const auto [first, is_new] = names_.try_emplace(kind + "/" + name, node.source().line);
    if (!is_new)
      node.fail(
          fmt::format("{} name '{}' is used twice, first in line {}", kind, name, first->second));
  }

  JointDescription read_joint(const SceneNode& child, int parent) {
    const SceneElement node(child, kJoint);
    JointDescription joint;
    joint.source = node.source();
    joint.name = node.text("name");
    unique("joint", joint.name, node);
    joint.type = kJointTypeOf[node.word("type")];
    node.check(to_string(joint.type));
    if (joint.type == JointType::revolute || joint.type == JointType::prismatic) {
      joint.axis0 = node.direction("axis");
    } else if (joint.type == JointType::planar) {
      joint.axis0 = node.direction("axis0");
      joint.axis1 = node.direction("axis1");
    }
    node.read(joint.pose);
    if (node.word("frame") == 1) place_in_world(joint, parent);
    read_joint_effects(node, joint);
    read_follower(node, joint);
    lengths_[joint.name] = node.context().length;
    return joint;
  }

  /// Converts the pose and the axes of a joint from the world, all joints at rest, into the parent
  /// joint's frame and its own.
  void place_in_world(JointDescription& joint, int parent) const {
    const Quaternion& q = joint.pose.orientation;
    const Pose from_world = {{0, 0, 0}, {q[0], -q[1], -q[2], -q[3]}};
    joint.axis0 = outer_direction(from_world, joint.axis0);
    joint.axis1 = outer_direction(from_world, joint.axis1);
    if (parent >= 0) joint.pose = in_parent(joint.pose, parent);
  }

  /// Converts a pose given in the world into the frame of a parent joint at rest.
  [[nodiscard]] Pose in_parent(const Pose& pose, int parent) const {
    std::vector<Pose> way;
    for (int i = parent; i >= 0; i = scene_.links[std::size_t(i)].parent)
      way.insert(way.begin(), scene_.links[std::size_t(i)].joint.pose);
    return pose_at_end(way, pose);
  }

  Scene& scene_;
  std::map<std::string, int> names_;       // kind/name, line
  std::map<std::string, double> lengths_;  // of the file of each joint: factor to metres
};

void read_option(Scene& scene, const SceneElement& node) {
  node.check();
  if (node.has("gravity"))
    scene.gravity = node.vector("gravity"), scene.gravity_source = node.source();
  node.read(scene);
  std::vector<std::string> names;
  for (const Integrator known : integrators()) names.emplace_back(to_string(known));
  if (node.has("integrator") && node.text("integrator") == "linear-implicit")
    throw InputError(node.source().prefix() +
                     "integrator 'linear-implicit' is gone: its fields were off by more than their "
                     "own size wherever a contact changed; expected BDF1, which it resembled, or "
                     "another of this list: see docs/accuracy.md");
  scene.integrator = integrators()[std::size_t(node.choice("integrator", names, 0))];
}

void read_solver(Scene& scene, const SceneElement& node) {
  node.check();
  node.read(scene.solver);
  if (node.has("sleep")) scene.solver.sleep_source = node.source();
  scene.solver.bounded_energy = node.word("energy") == 0;
}

void read_ground(Scene& scene, const SceneElement& node) {
  node.check();
  scene.ground.emplace();
  node.read(*scene.ground);
  scene.ground->normal = node.direction("normal", scene.ground->normal);
}

void read_defaults(const SceneNode& section) {
  for (const SceneElement& node : elements_in(section)) {
    node.check_default();
    for (const Attribute& a : schema())
      if ((a.elements & node.of()) != 0 && a.has(kInDefault) && node.has(a.name))
        section.context().defaults[node.name()][a.name] = {node.text(a.name), node.source().line};
  }
}

void read_root(const SceneNode& root, Scene& scene) {
  if (root.name() != "redmax" && root.name() != "tangere")
    root.fail(std::string("not a scene; expected ") + kSceneRoots +
              (root.name() == "robot" || root.name() == "mujoco"
                   ? ". 'tangere import' makes a scene of it"
                   : ""));
  root.check_attributes({"model", "name"});
  scene.name = root.text("model", root.text("name", "scene"));
  std::vector<std::string> known = element_names(elements_inside(holders().front().name));
  known.emplace_back("virtual");
  for (const Holder& holder : holders())
    if (holder.section) known.emplace_back(holder.name);
  const std::vector<SceneNode> sections = root.children(known);
  const auto each = [&](const char* name, auto&& read) {
    for (const SceneNode& s : sections)
      if (s.name() == name) read(s);
  };
  // Elements of the user's file replace those of included files.
  const auto once = [&](const char* name, auto&& read) {
    const auto own = [&](const SceneNode& s) { return &s.context() == &root.context(); };
    const bool has_own = std::any_of(sections.begin(), sections.end(), [&](const SceneNode& s) {
      return s.name() == name && own(s);
    });
    int count = 0;
    each(name, [&](const SceneNode& s) {
      if (has_own && !own(s)) return;
      if (++count > 1) s.fail("given twice; expected once");
      read(s);
    });
  };
  // Units come first because every other number depends on them. Then come sections to which others
  // refer.
  SceneContext& c = root.context();
  bool metres = false;
  each("option", [&](const SceneNode& s) {
    if (&s.context() == &c) metres = s.choice("unit", {"cm-g", "m-kg"}, 0) == 1;
  });
  if (!metres) c.use_centimetres_and_grams();
  scene.timestep = 0.02;
  scene.integrator = Integrator::default_integrator;
  scene.gravity = {0, 0, -9.8};
  once("option", [&](const SceneNode& s) { read_option(scene, {s, kOption}); });
  once("solver_option", [&](const SceneNode& s) { read_solver(scene, {s, kSolver}); });
  each("default", [&](const SceneNode& s) { read_defaults(s); });
  once("ground", [&](const SceneNode& s) { read_ground(scene, {s, kGround}); });
  TreeReader tree(scene);
  each("robot", [&](const SceneNode& s) { tree.read_robot(s); });
  tree.name_bodies();
  tree.scale_followers();
  if (scene.links.empty()) root.fail("no <link> in any <robot>: there is nothing to simulate");
  each("actuator", [&](const SceneNode& s) { read_actuators(scene, s); });
  each("transmission", [&](const SceneNode& s) { read_transmissions(scene, s); });
  each("contact", [&](const SceneNode& s) { read_contacts(scene, s); });
  each("loop", [&](const SceneNode& s) { read_loops(scene, s); });
  warn_of_dense_meshes(scene, root);
  warn_of_coarse_points(scene, root);
  each("sensor", [&](const SceneNode& s) { read_sensors(scene, s); });
  show_abstract_bodies(scene);
  warn_of_unlike_skins(scene, root);
  each("variable", [&](const SceneNode& s) { read_end_effectors(scene, s); });
  name_end_effectors(scene);
  each("virtual", [&](const SceneNode& s) { s.warn("shapes for pictures only; ignored"); });
  each("initial", [&](const SceneNode& s) { read_initial(scene, s); });
  once("control", [&](const SceneNode& s) { read_control(scene, s); });
  once("randomize", [&](const SceneNode& s) { read_randomize(scene, s); });
  once("outputs", [&](const SceneNode& s) { read_outputs(scene, s); });
  warn_of_sensors(scene, root);
  warn_of_starts(scene, root);
}

}  // namespace

SceneFile parse_scene(const std::string& text, const std::string& name,
                      const SceneReadOptions& options) {
  tinyxml2::XMLDocument document;
  SceneContext context;
  context.file = name;
  context.allow_unknown = options.allow_unknown;
  context.origins = options.origins;
  context.folders = options.folders;
  static const std::vector<std::filesystem::path> kShipped = shipped_scenes();
  context.folders.insert(context.folders.end(), kShipped.begin(), kShipped.end());
  context.included_texts = options.included;
  const tinyxml2::XMLElement& root = parse_xml(document, text, name, kSceneRoots, context.warnings);
  SceneFile out;
  read_root(SceneNode(root, context), out.scene);
  out.scene.path = name;
  out.scene.text = text;
  out.warnings = std::move(context.warnings);
  return out;
}

SceneFile read_scene(const std::filesystem::path& path, const SceneReadOptions& options) {
  return parse_scene(read_text_file(path.string(), kLargestFile, "a scene file"), path.string(),
                     options);
}

Model load_model(const std::filesystem::path& path, const SceneReadOptions& options,
                 const SceneWarning& warn) {
  const SceneFile file = read_scene(path, options);
  for (const std::string& warning : file.warnings)
    warn ? warn(warning) : fmt::print(stderr, "warning: {}\n", warning);
  return Model(file.scene);
}

}  // namespace tangere
