// SPDX-License-Identifier: Apache-2.0
// The sections of a MJCF file, in the order in which they depend on each other.
#include "io/robot/mjcf_reader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "engine/scene/outer_pose.hpp"
#include "io/robot/mjcf_file.hpp"
#include "io/robot/mjcf_words.hpp"

namespace tangere {
namespace {

const Words kSections = {
    {"compiler"},
    {"option"},
    {"default"},
    {"asset"},
    {"worldbody"},
    {"actuator"},
    {"contact"},
    {"size", Fate::idle, "sizes of MuJoCo's memory"},
    {"visual", Fate::idle, kSight},
    {"statistic", Fate::idle, kSight},
    {"custom", Fate::idle, "numbers for other programs"},
    {"sensor", Fate::idle, "readings of MuJoCo; --pad LINK=LAYOUT adds a skin"},
    {"keyframe"},
    {"equality"},
    {"tendon"},
    {"deformable", Fate::lost, "bodies that bend; scenes have none"},
    {"extension", Fate::lost, "plug-ins of MuJoCo"}};

const Words kCompiler = {{"angle"},
                         {"meshdir"},
                         {"assetdir"},
                         {"autolimits"},
                         {"eulerseq"},
                         {"inertiafromgeom"},
                         {"inertiagrouprange"},
                         {"strippath"},
                         {"coordinate"},
                         {"balanceinertia"},
                         {"boundmass", Fate::zero, "raises masses"},
                         {"boundinertia", Fate::zero, "raises inertias"},
                         {"settotalmass"},
                         {"alignfree"},
                         {"texturedir", Fate::idle, kSight},
                         {"discardvisual", Fate::idle, "shapes without mass are left out anyway"},
                         {"fusestatic", Fate::idle, "bodies without joints cost nothing here"},
                         {"convexhull", Fate::idle, "meshes are not replaced by hulls"},
                         {"exactmeshinertia", Fate::idle, "masses of meshes are volume integrals"},
                         {"fitaabb", Fate::idle, "no primitive is fitted to a mesh"},
                         {"usethread", Fate::idle, kSolverSetting},
                         {"saveinertial", Fate::idle, kSolverSetting},
                         {"conflict"}};

Words solver_words() {
  Words words = {{"timestep"},
                 {"gravity"},
                 {"integrator"},
                 {"actuatorgroupdisable"},
                 {"density", Fate::zero, "the air's or the water's"},
                 {"viscosity", Fate::zero, "the air's or the water's"},
                 {"wind", Fate::zero, "moves the air"},
                 {"magnetic", Fate::idle, "for a sensor of MuJoCo"}};
  for (const char* name :
       {"impratio",       "tolerance",      "ls_tolerance",      "noslip_tolerance",
        "ccd_tolerance",  "o_margin",       "o_solref",          "o_solimp",
        "o_friction",     "cone",           "jacobian",          "solver",
        "iterations",     "ls_iterations",  "noslip_iterations", "ccd_iterations",
        "sdf_iterations", "sdf_initpoints", "apirate",           "sleep_tolerance",
        "mpr_tolerance",  "mpr_iterations"})
    words.push_back({name, Fate::idle, kSolverSetting});
  return words;
}

void read_compiler(MjcfFile& file, const RobotNode& node) {
  node.check(kCompiler);
  static_cast<void>(node.parts({{"lengthrange", Fate::idle, kSolverSetting}}));
  if (node.has("angle")) file.degrees = node.choice("angle", {"degree", "radian"}) == 0;
  if (node.has("assetdir")) file.mesh_folder = node.text("assetdir");
  if (node.has("meshdir")) file.mesh_folder = node.text("meshdir");
  file.strip_path = node.flag("strippath", file.strip_path);
  file.auto_limits = node.flag("autolimits", file.auto_limits);
  if (node.has("conflict"))
    file.whole.merges_options |= node.choice("conflict", {"warning", "merge", "error"}) == 1;
  if (node.has("coordinate")) static_cast<void>(node.choice("coordinate", {"local"}));
  file.balance_inertia = node.flag("balanceinertia", file.balance_inertia);
  if (node.has("settotalmass") && file.outer != nullptr)
    node.lost("<compiler> settotalmass of an attached model");
  else if (node.has("settotalmass"))
    file.total_mass = std::max(node.number("settotalmass"), 0.0);
  file.align_free = node.flag("alignfree", file.align_free);
  if (node.has("eulerseq")) {
    file.euler_sequence = node.text("eulerseq");
    const bool axes = file.euler_sequence.size() == 3 &&
                      file.euler_sequence.find_first_not_of("xyzXYZ") == std::string::npos;
    if (!axes)
      node.fail("eulerseq=\"" + file.euler_sequence + "\"; expected three of x, y, z, X, Y, Z");
  }
  if (node.has("inertiafromgeom")) {
    constexpr InertiaFrom kFrom[] = {InertiaFrom::automatic, InertiaFrom::geoms,
                                     InertiaFrom::inertials};
    file.inertia_from = kFrom[node.choice("inertiafromgeom", {"auto", "true", "false"})];
  }
  if (node.has("inertiagrouprange")) {
    const std::vector<int> x = node.integers("inertiagrouprange", {0, 5}, 0, 5);
    file.inertia_groups = {x[0], x[1]};
  }
}

void read_flag(MjcfWhole& whole, const RobotNode& flag, const std::string& name,
               const std::string& value) {
  const auto is = [&](std::initializer_list<std::string_view> names) {
    return std::find(names.begin(), names.end(), name) != names.end();
  };
  const std::string text = "<flag> " + name + ": ";
  if (!is({"gravity", "spring", "damper", "passive", "actuation", "limit", "contact", "constraint",
           "equality", "clampctrl", "frictionloss"}) ||
      value == "enable")
    return flag.idle(text + kSolverSetting);
  if (is({"contact"})) return flag.idle(text + "a scene has none but those that it names");
  if (is({"equality", "constraint"})) whole.has_equalities = false;
  if (is({"actuation", "clampctrl"})) return flag.lost(text + "switches forces");
  if (name == "gravity") whole.robot.scene.gravity = {0, 0, 0};
  if (is({"limit", "constraint"})) whole.has_limits = false;
  if (is({"frictionloss", "constraint"})) whole.has_friction = false;
  if (is({"spring", "passive"})) whole.has_springs = false;
  if (is({"damper", "passive"})) whole.has_dampers = false;
  flag.changed(text + "the scene is without what it switches off");
}

void read_option(MjcfWhole& whole, const RobotNode& node) {
  static const Words words = solver_words();
  node.check(words);
  Scene& scene = whole.robot.scene;
  scene.timestep = node.positive("timestep", scene.timestep);
  scene.gravity = node.vector("gravity", scene.gravity);
  if (node.has("actuatorgroupdisable"))
    for (const double group : node.numbers("actuatorgroupdisable"))
      whole.disabled_groups.push_back(static_cast<int>(group));
  if (node.given("integrator"))
    node.changed("<option> integrator: the scene steps by BDF2, with an implicit solver");
  for (const RobotNode& flag : node.parts({{"flag"}}))
    for (const tinyxml2::XMLAttribute* a = flag.element().FirstAttribute(); a != nullptr;
         a = a->Next())
      read_flag(whole, flag, a->Name(), a->Value());
}

void read_mesh(MjcfFile& file, const RobotNode& node) {
  node.check(mjcf_words("mesh"));
  if (!node.has("file") && !node.has("vertex") && !node.has("builtin"))
    node.fail("a mesh without a file; expected file=\"….obj\", .stl or .ply, or vertex");
  const std::string name = node.has("name")
                               ? node.text("name")
                               : std::filesystem::path(node.text("file")).stem().string();
  if (const auto first = file.meshes.find(name); first != file.meshes.end())
    node.fail(fmt::format("mesh name '{}' is used twice, first in {}", name,
                          place_in(node.robot(), first->second.node.source())));
  constexpr MeshInertia kInertias[] = {MeshInertia::legacy, MeshInertia::exact, MeshInertia::convex,
                                       MeshInertia::shell};
  const int inertia = node.choice("inertia", {"legacy", "exact", "convex", "shell"}, 0);
  file.meshes.emplace(name, MjcfMesh{node, kInertias[inertia]});
}

/// A material that gives neither specular nor shininess has no highlight here.
void read_material(MjcfFile& file, const RobotNode& node) {
  constexpr double kUsual = 0.5;  // MuJoCo's own
  Material material;
  if (node.has("rgba")) {
    const std::vector<double> x = node.numbers("rgba", 4);
    material.rgba = {x[0], x[1], x[2], x[3]};
  }
  const auto share = [&](const char* name, double usual) {
    const double given = node.number(name, usual), kept = std::clamp(given, 0.0, 1.0);
    if (kept != given)
      node.changed(fmt::format("<material> {}=\"{:g}\": {:g}, because it is from 0 to 1", name,
                               given, kept));
    return kept;
  };
  if (node.has("specular") || node.has("shininess")) {
    material.specular = share("specular", kUsual);
    material.shininess = share("shininess", kUsual);
  }
  material.emission = share("emission", 0);
  file.materials[node.text("name")] = material;
}

void read_asset(MjcfFile& file, const RobotNode& section) {
  const Words known = {{"mesh"},
                       {"material"},
                       {"texture", Fate::idle, kSight},
                       {"skin", Fate::idle, kSight},
                       {"hfield", Fate::lost, "height fields; scenes have none"},
                       {"model"}};
  for (const RobotNode& part : section.parts(known)) {
    if (part.name() == "model") {
      read_mjcf_model(file, part);
      continue;
    }
    const RobotNode node = file.with_class(part, "main");
    if (node.name() == "mesh") {
      read_mesh(file, node);
      continue;
    }
    node.check(mjcf_words("material"));
    static_cast<void>(node.parts({{"layer", Fate::idle, kSight}}));
    read_material(file, node);
  }
}

}  // namespace

void MjcfFile::read_defaults(const RobotNode& node, const std::string& parent) {
  node.check({{"class"}});
  const bool top = parent.empty();
  if (!top && !node.given("class")) node.fail("a default inside a default has no class");
  const std::string name = node.text("class", "main");
  if (!top && classes_.contains(name)) node.fail("class '" + name + "' is given twice");
  SceneContext& context = classes_[name];
  if (!top) context = classes_.at(parent);
  context.warnings.clear();
  context.file = node.context().file;
  context.includer = node.context().includer;
  context.allow_unknown = node.context().allow_unknown;
  if (top && name != "main") classes_["main"] = context;
  Words known = {{"default"},
                 {"geom"},
                 {"joint"},
                 {"mesh"},
                 {"material"},
                 {"site"},
                 {"camera", Fate::idle, kSight},
                 {"light", Fate::idle, kSight},
                 {"pair", Fate::idle, "of pairs of geoms, which --contact names"},
                 {"equality"},
                 {"tendon"}};
  for (const char* other : kOtherActuators)
    known.push_back({other, Fate::idle, "of actuators that are not read"});
  for (const std::string& actuator : kActuators) known.push_back({actuator.c_str()});
  for (const RobotNode& part : node.parts(known)) {
    if (part.name() == "default") {
      read_defaults(part, name);
      continue;
    }
    if (part.name() == "equality") {
      if (!part.flag("active", true))
        part.lost("<equality> active of a default: constraints are taken as active");
      continue;
    }
    part.check(mjcf_words(part.name()));
    const bool drives =
        std::find(kActuators.begin(), kActuators.end(), part.name()) != kActuators.end();
    static const std::vector<std::string> gains = {
        "kp", "kv", "dampratio", "gainprm", "biasprm", "dynprm", "dyntype", "gaintype", "biastype"};
    for (const tinyxml2::XMLAttribute* a = part.element().FirstAttribute(); a != nullptr;
         a = a->Next()) {
      const SceneContext::Default value{a->Value(), part.source().line};
      // Of kv and dampratio the innermost class has one.
      for (const auto& [one, other] : {std::pair{"kv", "dampratio"}, {"dampratio", "kv"}})
        if (std::string_view(a->Name()) == one) context.defaults[part.name()].erase(other);
      const bool gain = std::find(gains.begin(), gains.end(), a->Name()) != gains.end();
      if (drives && !gain)
        for (const std::string& actuator : kActuators)
          context.defaults[actuator][a->Name()] = value;
      else
        for (const std::string& of : part.name() == "tendon"
                                         ? std::vector<std::string>{"fixed", "spatial"}
                                         : std::vector<std::string>{part.name()})
          context.defaults[of][a->Name()] = value;
    }
  }
  if (top && name != "main") classes_["main"] = context;
}

RobotNode MjcfFile::with_class(const RobotNode& node, const std::string& inherited) {
  std::string name = inherited.empty() ? "main" : inherited;
  if (node.given("class")) name = known_class(node, "class");
  const std::string& file = node.context().file;
  const auto [at, is_new] = contexts_.try_emplace({file, name});
  if (is_new) {
    at->second = classes_[name];
    at->second.file = file;
    at->second.includer = node.context().includer;
    at->second.allow_unknown = node.context().allow_unknown;
    at->second.warnings.clear();
  }
  return node.in(at->second);
}

std::string MjcfFile::known_class(const RobotNode& node, const char* attribute) {
  std::string name = node.text(attribute);
  if (name == "main" || classes_.contains(name)) return name;
  std::vector<std::string> all;
  for (const auto& [known, context] : classes_) all.push_back(known);
  node.fail(fmt::format("{}=\"{}\": no default has this class{}", attribute, name,
                        suggestion(name, all)));
}

const MjcfMesh& MjcfFile::mesh_named(const RobotNode& node, const std::string& name) {
  const auto found = meshes.find(name);
  if (found == meshes.end()) {
    std::vector<std::string> all;
    for (const auto& [known, m] : meshes) all.push_back(known);
    node.fail(fmt::format("mesh=\"{}\": no mesh has this name{}", name, suggestion(name, all)));
  }
  MjcfMesh& mesh = found->second;
  if (mesh.is_read) return mesh;
  mesh.is_read = true;
  if (mesh.node.has("builtin")) {
    mesh.node.lost("<mesh> builtin: a shape made by MuJoCo; write it to an OBJ file");
    return mesh;
  }
  const Vector3 scale = mesh.node.vector("scale", Vector3{1, 1, 1});
  if (mesh.node.has("vertex")) {
    mesh.mesh = read_written_mesh(mesh.node, scale);
  } else {
    std::string given = mesh.node.text("file");
    if (strip_path) given = std::filesystem::path(given).filename().string();
    mesh.mesh = read_robot_mesh(mesh.node, given, mesh_folder, scale);
  }
  read_origin(mesh, scale);
  return mesh;
}

/// MuJoCo takes refpos p from the vertices v, turns them back by refquat R, then scales:
/// S Rᵀ (v - p). A pose says it where S and Rᵀ can change places.
void MjcfFile::read_origin(MjcfMesh& mesh, const Vector3& scale) {
  const Vector3 p = mesh.node.vector("refpos", Vector3{0, 0, 0});
  Pose back;
  if (mesh.node.has("refquat")) back = inverse({{0, 0, 0}, mesh.node.quaternion("refquat")});
  const bool turned = std::abs(back.orientation[0]) != 1;
  if (turned && (scale[0] != scale[1] || scale[1] != scale[2])) {
    mesh.node.lost("<mesh> refquat with a scale that differs by axis: the mesh is stretched askew");
    mesh.mesh.reset();
    return;
  }
  back.position =
      outer_direction(back, {0 - scale[0] * p[0], 0 - scale[1] * p[1], 0 - scale[2] * p[2]});
  mesh.origin = back;
}

void MjcfFile::take_warnings(std::vector<std::string>& out) {
  const auto take = [&](SceneContext& context) {
    for (std::string& warning : context.warnings)
      if (std::find(out.begin(), out.end(), warning) == out.end())  // copies give it again
        out.push_back(std::move(warning));
    context.warnings.clear();
  };
  for (const auto& included : whole.robot.included) take(included->context);
  for (auto& [key, context] : contexts_) take(context);
  for (auto& [name, model] : models) model->take_warnings(out);
}

Quaternion MjcfFile::read_orientation(const RobotNode& node) const {
  const char* chosen = nullptr;
  for (const bool own : {true, false})
    for (const char* name : {"quat", "axisangle", "euler", "xyaxes", "zaxis"}) {
      if (own ? !node.given(name) : chosen != nullptr || !node.has(name)) continue;
      if (chosen != nullptr)
        node.fail(fmt::format("both '{}' and '{}'; expected one rotation", chosen, name));
      chosen = name;
    }
  if (chosen == nullptr) return {1, 0, 0, 0};
  const std::string_view kind = chosen;
  if (kind == "quat") return node.quaternion("quat");
  if (kind == "zaxis") return from_z(node.direction("zaxis"));
  if (kind == "euler") return euler(node.vector("euler"));
  const auto unit = [&](const Vector3& a) {
    const double length = std::sqrt(dot(a, a));
    if (!(length > 1e-100) || !std::isfinite(length))
      node.fail(fmt::format("{}=\"{}\" has an axis without a length", chosen, node.text(chosen)));
    return Vector3{a[0] / length, a[1] / length, a[2] / length};
  };
  if (kind == "axisangle") {
    const std::vector<double> x = node.numbers("axisangle", 4);
    return turn(unit({x[0], x[1], x[2]}), angle(x[3]));
  }
  const std::vector<double> x = node.numbers("xyaxes", 6);
  const Vector3 first = unit({x[0], x[1], x[2]}), second = unit({x[3], x[4], x[5]});
  const Vector3 normal = cross(first, second);
  if (!(dot(normal, normal) > 1e-20)) node.fail("xyaxes are parallel; expected a plane");
  return from_axes(first, second);
}

Pose MjcfFile::read_pose(const RobotNode& node) const {
  return {node.vector("pos", Vector3{0, 0, 0}), read_orientation(node)};
}

void read_mjcf_settings(MjcfFile& file) {
  file.sections = file.root.parts(kSections);
  const auto each = [&](const char* name, auto&& read) {
    for (const RobotNode& s : file.sections)
      if (s.name() == name) read(s);
  };
  each("compiler", [&](const RobotNode& s) { read_compiler(file, s); });
  each("option", [&](const RobotNode& s) {
    if (file.outer == nullptr)
      read_option(file.whole, s);
    else if (file.whole.merges_options)
      s.lost("<option> of an attached model, which conflict=\"merge\" merges");
    else
      s.idle("<option> of an attached model: MuJoCo takes those of the model that attaches it");
  });
  each("default", [&](const RobotNode& s) { file.read_defaults(s, ""); });
  each("asset", [&](const RobotNode& s) { read_asset(file, s); });
  if (file.outer != nullptr)
    each("keyframe", [&](const RobotNode& s) { s.idle("<keyframe> of an attached model"); });
}

namespace {

/// Keeps the pairs of an <exclude>, of which copies have one each.
void read_exclude(MjcfWhole& whole, int model, const RobotNode& exclude) {
  exclude.check({{"name", Fate::idle, kSight}, {"body1"}, {"body2"}});
  exclude.idle("<exclude>: a scene has only the contacts that it names");
  const auto& copies = whole.body_names.copies;
  const auto first = copies.find({model, exclude.text("body1")}),
             second = copies.find({model, exclude.text("body2")});
  if (first == copies.end() || second == copies.end()) return;
  for (const MjcfCopy& a : first->second)
    for (const MjcfCopy& b : second->second) {
      const std::vector<int>&x = a.scope->copies, &y = b.scope->copies;
      const auto common = static_cast<std::ptrdiff_t>(std::min(x.size(), y.size()));
      if (std::equal(x.begin(), x.begin() + common, y.begin()))
        whole.robot.excluded.push_back({a.name, b.name});
    }
}

}  // namespace

void read_mjcf(const RobotNode& root, const std::string& keyframe, bool free_base) {
  Robot& robot = root.robot();
  robot.format = "MJCF";
  root.check({{"model"}});
  robot.scene.name = root.text("model", "robot");
  robot.scene.timestep = 0.002;  // MuJoCo's
  MjcfWhole whole{robot};
  whole.free_base = free_base;
  MjcfFile file(root, whole, nullptr);
  read_mjcf_settings(file);
  whole.models.push_back(&whole.scopes.emplace_back(MjcfScope{&file}));
  read_mjcf_bodies(whole, *whole.models.front());
  read_mjcf_gravity(whole);
  if (file.total_mass > 0) scale_masses(robot.scene, file.total_mass);
  std::vector<RobotNode> keyframes;
  for (const RobotNode& s : file.sections)
    if (s.name() == "keyframe") keyframes.push_back(s);
  const std::optional<RobotNode> key = find_mjcf_keyframe(whole, keyframes, keyframe);
  read_mjcf_tendons(whole);
  read_mjcf_equalities(whole);
  read_mjcf_actuators(whole);
  for (const MjcfScope* model : whole.models)
    for (const RobotNode& section : model->file->sections) {
      if (section.name() != "contact") continue;
      for (const RobotNode& part : section.parts({{"pair"}, {"exclude"}}))
        if (part.name() == "pair")
          part.changed("<pair>: no contact, as of all that may touch; --contact A=B adds one");
        else
          read_exclude(whole, model->model, part);
    }
  if (key) read_mjcf_keyframe(whole, *key);
  file.take_warnings(root.context().warnings);
}

}  // namespace tangere
