// SPDX-License-Identifier: Apache-2.0
// Bodies, joints and geoms. A body of MJCF has any number of joints, which become a chain of links
// of which the last has the body. A link's origin is at the anchor of its joint.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/scene/outer_pose.hpp"
#include "engine/scene/shapes.hpp"
#include "io/robot/mesh_solid.hpp"
#include "io/robot/mjcf_file.hpp"
#include "io/robot/mjcf_parts.hpp"
#include "io/robot/mjcf_words.hpp"
#include "io/scene/convex_hull.hpp"

namespace tangere {
namespace {

class Bodies {
 public:
  explicit Bodies(MjcfWhole& whole) : whole_(whole), robot_(whole.robot) {}

  void read_world(const RobotNode& world, const MjcfScope& scope) {
    const std::vector<MjcfPart> parts = world_parts(whole_, {world, {}, "main", &scope});
    std::vector<RobotPiece> fixed;
    for (const MjcfPart& part : parts)
      if (part.node.name() == "geom") read_world_geom(part, fixed);
    if (!fixed.empty()) {
      JointDescription joint;
      joint.name = whole_.names.free_name("world");
      joint.source = world.source();
      for (RobotPiece& piece : fixed) piece.density = 0;
      add_link(robot_, whole_.names, joint.name, -1, joint, fixed, "<worldbody>", world.source());
    }
    for (const MjcfPart& part : parts) {
      if (part.node.name() == "body") read_body(part, -1, {}, 0);
      if (part.node.name() == "site") read_site(part, -1, {});
      if (part.node.name() == "geom") keep_geom(part, -1, {});
    }
  }

  /// Keeps all names that the file gives, so that made-up ones differ from them.
  void keep_names(const tinyxml2::XMLElement& element, int depth) {
    if (depth > 2 * kDeepestBodies) return;  // such a file is refused later
    if (const char* name = element.Attribute("name")) whole_.names.keep(name);
    for (const auto* e = element.FirstChildElement(); e != nullptr; e = e->NextSiblingElement())
      keep_names(*e, depth + 1);
  }

 private:
  void read_world_geom(const MjcfPart& part, std::vector<RobotPiece>& out) {
    const MjcfPart geom = part.with_class();
    std::vector<RobotPiece> pieces;
    read_geom(geom, false, pieces);
    if (pieces.empty()) return;
    const RobotPiece& piece = pieces.front();
    Scene& scene = robot_.scene;
    if (!std::holds_alternative<PlaneShape>(piece.shape) || scene.ground) {
      out.push_back(piece);
      return;
    }
    scene.ground = GroundDescription{piece.pose.position, outer_direction(piece.pose, {0, 0, 1})};
    geom.node.changed("<geom> type=\"plane\" of the world: it is the scene's <ground>");
  }

  void read_body(const MjcfPart& placed, int parent, const Pose& parent_offset, int depth) {
    const RobotNode& node = placed.node;
    if (depth > kDeepestBodies)
      node.fail(fmt::format("bodies nested deeper than {}", kDeepestBodies));
    node.check(with_rotations({{"name"},
                               {"childclass"},
                               {"mocap"},
                               {"gravcomp"},
                               {"sleep", Fate::idle, "a setting of MuJoCo's solver"},
                               {"user", Fate::idle, "numbers for other programs"}}));
    if (node.flag("mocap", false))
      node.changed("<body> mocap: stands where the file has it; no program moves it");
    const std::string name =
        node.has("name") ? unique_body(placed) : whole_.names.free_name("body");
    const Pose place = compose(parent_offset, compose(placed.frame, placed.file().read_pose(node)));
    const std::vector<MjcfPart> parts =
        body_parts(whole_, {node, {}, placed.own_class(), placed.scope});
    Pose offset;  // of the body's frame in that of its link
    const std::size_t before = robot_.scene.links.size();
    const int index = add_chain(placed, name, parent, place, parts, offset);
    if (const double lift = node.number("gravcomp", 0.0); lift != 0) {
      for (std::size_t k = before; k < robot_.scene.links.size(); ++k)
        robot_.scene.links[k].body.gravity_share = 1 - lift;
      whole_.gravcomp[index] = node.source();
    }
    whole_.body_frames[name] = {index, offset};
    for (const MjcfPart& part : parts) {
      if (part.node.name() == "body") read_body(part, index, offset, depth + 1);
      if (part.node.name() == "site") read_site(part, index, offset);
      if (part.node.name() == "geom") keep_geom(part, index, offset);
    }
  }

  /// Keeps the place of a site. `offset`: of its body's frame in that of the link.
  void read_site(const MjcfPart& part, int link, const Pose& offset) {
    const RobotNode node = part.with_class().node;
    node.check(mjcf_words("site"));
    const Pose own = node.has("fromto") ? read_ends(node).pose : part.file().read_pose(node);
    if (!node.given("name")) return node.idle("<site> without a name: " + std::string(kSight));
    const std::string name = part.scope->full_name(node.text("name"));
    if (link < 0) whole_.world_sites[name] = compose(part.frame, own);
    if (link < 0) return node.idle("<site> of the world: a place that does not move");
    const RobotSite site{link, compose(offset, compose(part.frame, own)), node.source()};
    const auto [first, is_new] = robot_.sites.try_emplace(name, site);
    if (!is_new)
      node.fail(fmt::format("site name '{}' is used twice, first in {}", name,
                            place_in(robot_, first->second.source)));
  }

  /// Keeps a geom that a tendon may go around. `offset`: of its body's frame in that of the link.
  void keep_geom(const MjcfPart& part, int link, const Pose& offset) {
    const MjcfPart geom = part.with_class();
    const std::string type = geom.node.text("type", "sphere");
    if (!geom.node.given("name") || (type != "sphere" && type != "cylinder")) return;
    RobotPiece piece;
    const MjcfMesh* mesh = nullptr;
    if (geom.node.has("mesh") || !read_shape(geom, piece, mesh)) return;
    const bool ball = std::holds_alternative<SphereShape>(piece.shape);
    whole_.geoms[part.scope->full_name(geom.node.text("name"))] = {
        {link, compose(offset, compose(part.frame, piece.pose))},
        ball,
        ball ? std::get<SphereShape>(piece.shape).radius
             : std::get<CylinderShape>(piece.shape).radius};
  }

  std::string unique_body(const MjcfPart& part) {
    return whole_.keep_name(whole_.body_names, part.node, *part.scope);
  }

  /// Adds the links of a body: one for each joint, or one that does not move.
  int add_chain(const MjcfPart& body, const std::string& name, int parent, const Pose& place,
                const std::vector<MjcfPart>& parts, Pose& offset) {
    const RobotNode& node = body.node;
    std::vector<JointDescription> chain;
    std::vector<MjcfJoint> ends;
    Vector3 anchor = {0, 0, 0};
    for (const MjcfPart& part : parts) {
      const bool free_joint = part.node.name() == "freejoint";
      if (part.node.name() != "joint" && !free_joint) continue;
      MjcfJoint end;
      Vector3 at{};
      JointDescription joint = free_joint ? read_free_joint(part, name, end)
                                          : read_joint(part.with_class(), name, at, end);
      if (joint.type == JointType::free && (parent >= 0 || !chain.empty()))
        part.node.fail(
            "a free joint inside another body, or beside another joint; expected it "
            "alone in a body of the world");
      if (!chain.empty() && chain.front().type == JointType::free)
        part.node.fail("a joint beside a free joint; expected it alone");
      if (joint.type == JointType::free) at = {0, 0, 0};
      const Pose step{{at[0] - anchor[0], at[1] - anchor[1], at[2] - anchor[2]}, {1, 0, 0, 0}};
      joint.pose = chain.empty() ? compose(place, step) : step;
      anchor = at;
      chain.push_back(std::move(joint));
      ends.push_back(end);
    }
    offset.position = {0 - anchor[0], 0 - anchor[1], 0 - anchor[2]};
    if (chain.empty()) {
      const bool moves = whole_.free_base && parent < 0 && !node.flag("mocap", false);
      JointDescription fixed;
      fixed.type = moves ? JointType::free : JointType::fixed;
      fixed.name = whole_.names.free_name(name + (moves ? "_free" : "_fixed"));
      fixed.pose = place;
      fixed.source = node.source();
      chain.push_back(fixed);
      ends.push_back({-2});
    }
    std::optional<Pose> inertia;
    const bool idle = chain.size() == 1 && stands(robot_, chain.front(), parent);
    const std::vector<RobotPiece> pieces =
        read_pieces(body, parts, offset, idle ? Moments::idle : Moments::needed, inertia);
    const bool has_bodies = std::any_of(parts.begin(), parts.end(), [](const MjcfPart& part) {
      return part.node.name() == "body";
    });
    ends.back().is_aligned &= !has_bodies;
    ends.back().inertia = inertia;
    for (std::size_t k = 0; k + 1 < chain.size(); ++k) {
      const std::string link = whole_.names.free_name(name + "_" + chain[k].name);
      parent = add_link(robot_, whole_.names, link, parent, chain[k], {},
                        "a joint of body '" + name + "'", chain[k].source);
      keep_joint(chain[k].name, ends[k], parent);
    }
    const int index =
        add_link(robot_, whole_.names, name, parent, chain.back(), pieces, "<body>", node.source());
    keep_joint(chain.back().name, ends.back(), index);
    return index;
  }

  void keep_joint(const std::string& name, MjcfJoint joint, int link) {
    if (joint.link == -2) return;  // the fixed joint of a body without joints
    joint.link = link;
    whole_.joints[name] = joint;
  }

  std::string joint_name(const MjcfPart& part, const std::string& body) {
    if (!part.node.given("name")) return whole_.names.free_name(body + "_joint");
    return whole_.keep_name(whole_.joint_names, part.node, *part.scope);
  }

  JointDescription read_free_joint(const MjcfPart& part, const std::string& body, MjcfJoint& end) {
    const RobotNode& node = part.node;
    node.check({{"name"}, {"group", Fate::idle, kSight}, {"align"}});
    JointDescription joint;
    joint.type = JointType::free;
    const int align = node.choice("align", {"auto", "true", "false"}, 0);
    end.is_aligned = align == 1 || (align == 0 && part.file().align_free);
    joint.name = joint_name(part, body);
    joint.source = node.source();
    return joint;
  }

  JointDescription read_joint(const MjcfPart& part, const std::string& body, Vector3& anchor,
                              MjcfJoint& end) {
    const RobotNode& node = part.node;
    const MjcfFile& file = part.file();
    node.check(mjcf_words("joint"));
    JointDescription joint;
    constexpr JointType kMjcfJointTypes[] = {JointType::revolute, JointType::prismatic,
                                             JointType::spherical, JointType::free};
    joint.type = kMjcfJointTypes[node.choice("type", {"hinge", "slide", "ball", "free"}, 0)];
    joint.name = joint_name(part, body);
    joint.source = node.source();
    const bool turns = joint.type == JointType::revolute;
    const bool single = turns || joint.type == JointType::prismatic;
    const auto measure = [&](double x) { return turns ? file.angle(x) : x; };
    anchor = outer_point(part.frame, node.vector("pos", Vector3{0, 0, 0}));
    if (single) joint.axis0 = outer_direction(part.frame, node.direction("axis", Vector3{0, 0, 1}));
    joint.damping = whole_.has_dampers ? node.not_negative("damping", 0.0) : 0;
    joint.armature = node.not_negative("armature", 0.0);
    joint.stiffness = whole_.has_springs ? node.not_negative("stiffness", 0.0) : 0;
    const double friction = whole_.has_friction ? node.not_negative("frictionloss", 0.0) : 0;
    if (single)
      joint.friction = friction;
    else if (friction != 0)
      node.lost("<joint> frictionloss: dry friction of a joint that turns freely");
    if (single) {
      end.ref = measure(node.number("ref", 0.0));
      const double rest = measure(node.number("springref", 0.0)) - end.ref;
      end.spring = rest;
      if (joint.stiffness != 0 && rest != 0) joint.rest = {rest};
      if (end.ref != 0)
        node.changed(fmt::format("<joint> ref: the coordinate of '{}' is that of the file minus {}",
                                 joint.name, end.ref));
    }
    end.is_aligned = joint.type == JointType::free && file.align_free;
    if (joint.type == JointType::free && joint.stiffness != 0) {
      node.lost("<joint> stiffness: a spring of a free joint to its place in the world");
      joint.stiffness = 0;
    }
    read_range(part, measure, end, joint);
    if (node.has("actuatorfrcrange") && limited(part, "actuatorfrclimited")) {
      const std::vector<double> x = node.numbers("actuatorfrcrange", 2);
      if (!(x[0] < x[1])) node.fail("actuatorfrcrange: expected low, then high");
      end.actuator_range = {x[0], x[1]};
    }
    return joint;
  }

  [[nodiscard]] static bool limited(const MjcfPart& part, const char* attribute) {
    const int word = part.node.choice(attribute, {"auto", "true", "false"}, 0);
    return word == 1 || (word == 0 && part.file().auto_limits);
  }

  template <class Measure>
  void read_range(const MjcfPart& part, Measure&& measure, MjcfJoint& end,
                  JointDescription& joint) const {
    const RobotNode& node = part.node;
    if (joint.type == JointType::free) {  // has no limits, whatever its class says
      if (node.has("range")) node.idle("<joint> range of a free joint");
      return;
    }
    const bool on = limited(part, "limited");
    if (!node.has("range")) {
      if (node.has("limited") && on && node.text("limited") == "true")
        node.fail("limited=\"true\" without a range; expected range=\"low high\"");
      return;
    }
    const std::vector<double> x = node.numbers("range", 2);
    if (!whole_.has_limits) return;
    if (!on) return node.idle("<joint> range of a joint that is not limited");
    if (joint.type == JointType::spherical)
      return node.lost("<joint> range of a ball joint: the angle of a cone");
    if (!(x[0] < x[1]))
      node.fail(fmt::format("range=\"{} {}\": expected low, then high", x[0], x[1]));
    end.range = {measure(x[0]), measure(x[1])};
    joint.limits = {measure(x[0]) - end.ref, measure(x[1]) - end.ref};
  }

  /// The geoms of a body and its mass, in the frame of its link. `principal`: the frame of its
  /// inertia in that of the body, where the file gives it: by diaginertia or one primitive.
  std::vector<RobotPiece> read_pieces(const MjcfPart& body, const std::vector<MjcfPart>& parts,
                                      const Pose& offset, Moments moments,
                                      std::optional<Pose>& principal) {
    std::optional<RobotPiece> inertial;
    bool has_inertial = false;
    for (const MjcfPart& part : parts) {
      if (part.node.name() != "inertial") continue;
      if (has_inertial) part.node.fail("given twice; expected once");
      has_inertial = true;
      inertial = read_inertial(part, moments);
      if (part.node.has("diaginertia"))
        principal = compose(part.frame, part.file().read_pose(part.node));
      if (inertial) inertial->pose = compose(offset, compose(part.frame, inertial->pose));
    }
    const InertiaFrom from = body.file().inertia_from;
    if (has_inertial && from == InertiaFrom::geoms) {
      body.node.changed("<inertial>: left out, because inertiafromgeom=\"true\"");
      inertial.reset();
      principal.reset();
      has_inertial = false;
    }
    const bool massive = !has_inertial && from != InertiaFrom::inertials;
    std::vector<RobotPiece> pieces;
    for (const MjcfPart& part : parts) {
      if (part.node.name() != "geom") continue;
      read_geom(part.with_class(), massive, pieces);
    }
    const auto heavy = [](const RobotPiece& piece) {
      return piece.density > 0 || std::holds_alternative<AbstractShape>(piece.shape);
    };
    const auto first = std::find_if(pieces.begin(), pieces.end(), heavy);
    if (massive && std::count_if(pieces.begin(), pieces.end(), heavy) == 1 &&
        !std::holds_alternative<MeshShape>(first->shape) &&
        !std::holds_alternative<AbstractShape>(first->shape))
      principal = first->pose;
    for (RobotPiece& piece : pieces) piece.pose = compose(offset, piece.pose);
    if (inertial) pieces.push_back(*inertial);
    return pieces;
  }

  std::optional<RobotPiece> read_inertial(const MjcfPart& part, Moments moments) {
    const RobotNode& node = part.node;
    node.check(with_rotations({{"mass"}, {"diaginertia"}, {"fullinertia"}}));
    const double mass = node.not_negative("mass");
    if (node.has("fullinertia") == node.has("diaginertia"))
      node.fail("expected one of diaginertia and fullinertia");
    std::array<double, 6> inertia{};
    if (node.has("diaginertia")) {
      const Vector3 x = node.vector("diaginertia");
      inertia = {x[0], 0, 0, x[1], 0, x[2]};
    } else {
      const std::vector<double> x = node.numbers("fullinertia", 6);  // xx yy zz xy xz yz
      inertia = {x[0], x[3], x[4], x[1], x[5], x[2]};
    }
    if (part.file().balance_inertia && balance_inertia(inertia))
      node.changed("<inertial>: all moments are their mean, as balanceinertia says");
    return inertial_piece(robot_, mass, inertia, part.file().read_pose(node), "<inertial>",
                          node.source(), moments);
  }

  /// Appends a geom, unless it is for pictures only, and its mass where that stands apart.
  /// `massive`: it may have a mass of its own.
  void read_geom(const MjcfPart& part, bool massive, std::vector<RobotPiece>& out) {
    const RobotNode& node = part.node;
    const MjcfFile& file = part.file();
    node.check(mjcf_words("geom"));
    static_cast<void>(node.parts({{"plugin", Fate::lost, "plug-ins of MuJoCo"}}));
    RobotPiece piece;
    piece.origin = "<geom>" + (node.given("name") ? " '" + node.text("name") + "'" : std::string());
    piece.source = node.source();
    const int group = node.integer("group", 0, 1000, 0);
    const bool counts =
        massive && group >= file.inertia_groups[0] && group <= file.inertia_groups[1];
    const bool touches = node.integer("contype", std::numeric_limits<int>::min(),
                                      std::numeric_limits<int>::max(), 1) != 0 ||
                         node.integer("conaffinity", std::numeric_limits<int>::min(),
                                      std::numeric_limits<int>::max(), 1) != 0;
    const double density = node.not_negative("density", 1000.0);
    const double mass = node.not_negative("mass", 0.0);
    const bool heavy = counts && (node.has("mass") ? mass > 0 : density > 0);
    if (!touches && !heavy) return node.idle("<geom> that touches nothing: " + std::string(kSight));
    piece.touches = touches;
    const MjcfMesh* mesh = nullptr;
    if (!read_shape(part, piece, mesh)) return;
    piece.pose = compose(part.frame, piece.pose);
    read_colour(part, piece);
    std::optional<RobotPiece> apart;
    if (heavy && !std::holds_alternative<PlaneShape>(piece.shape)) {
      if (node.flag("shellinertia", false))
        node.lost("<geom> shellinertia: the mass of a thin shell; it is that of a solid here");
      const double volume = volume_of(piece.shape);
      piece.density = node.has("mass") ? mass / volume : density;
      if (!std::isfinite(piece.density))
        node.fail(fmt::format("mass=\"{}\" of a geom without volume", mass));
      if (mesh != nullptr) apart = mass_apart(node, *mesh, density, piece);
    }
    out.push_back(std::move(piece));
    if (apart) out.push_back(std::move(*apart));
  }

  /// The mass of a mesh where MuJoCo's is not that of the scene's shape, which then has none.
  std::optional<RobotPiece> mass_apart(const RobotNode& node, const MjcfMesh& mesh, double density,
                                       RobotPiece& piece) {
    if (mesh.inertia == MeshInertia::shell) {
      node.lost("<mesh> inertia=\"shell\": the mass is that of a solid here");
      return std::nullopt;
    }
    if (mesh.inertia == MeshInertia::exact) return std::nullopt;
    const MeshShape& shape = std::get<MeshShape>(piece.shape);
    const MeshShape& faces = mesh.mesh->faces;
    const MeshSolid solid =
        solid_of(mesh.inertia == MeshInertia::legacy ? faces : convex_hull(faces.vertices));
    if (std::abs(solid.volume / volume_of(shape) - 1) < 1e-9 || !(solid.volume > 0))
      return std::nullopt;
    if (node.has("mass")) density = node.number("mass") / solid.volume;
    std::array<double, 6> inertia = solid.inertia;
    for (double& x : inertia) x *= density;
    piece.density = 0;
    node.changed(
        "<geom> of a mesh: its mass apart from its shape, because MuJoCo does not count "
        "the volume (<mesh inertia=\"exact\"/> does)");
    return inertial_piece(robot_, density * solid.volume, inertia,
                          compose(piece.pose, {solid.centre, {1, 0, 0, 0}}), piece.origin,
                          node.source());
  }

  static void read_colour(const MjcfPart& part, RobotPiece& piece) {
    const RobotNode& node = part.node;
    if (node.has("material")) {
      const auto& materials = part.file().materials;
      const auto named = materials.find(node.text("material"));
      if (named != materials.end())
        piece.material = named->second;
      else
        node.changed("<geom> of material '" + node.text("material") +
                     "': the usual grey, because no <material> has that name");
    }
    if (!node.has("rgba")) return;
    const std::vector<double> x = node.numbers("rgba", 4);
    piece.material.rgba = {x[0], x[1], x[2], x[3]};
  }

  /// Half sizes of a geom: `count` numbers, all positive.
  [[nodiscard]] std::vector<double> sizes(const RobotNode& node, std::size_t count) const {
    std::vector<double> x = node.numbers("size");
    if (x.size() < count)
      node.fail(fmt::format("size has {} numbers; expected {}", x.size(), count));
    for (std::size_t k = 0; k < count; ++k)
      if (!(x[k] > 0)) node.fail(fmt::format("size has {}; expected positive lengths", x[k]));
    return x;
  }

  struct Ends {
    Pose pose;    ///< in the middle, z along them
    double half;  ///< of the length between them
  };
  static Ends read_ends(const RobotNode& node) {
    const std::vector<double> x = node.numbers("fromto", 6);
    const Vector3 back = {x[0] - x[3], x[1] - x[4], x[2] - x[5]};
    const double half = 0.5 * std::sqrt(dot(back, back));
    if (!(half > 0) || !std::isfinite(half))
      node.fail("fromto has two equal ends; expected a length");
    return {{{0.5 * (x[0] + x[3]), 0.5 * (x[1] + x[4]), 0.5 * (x[2] + x[5])}, from_z(back)}, half};
  }

  /// Reads type, size and place. Returns false for a shape that scenes do not have.
  bool read_shape(const MjcfPart& part, RobotPiece& piece, const MjcfMesh*& mesh) {
    const RobotNode& node = part.node;
    static const std::vector<std::string> types = {
        "sphere", "capsule", "cylinder", "box", "ellipsoid", "plane", "mesh", "hfield", "sdf"};
    const std::string type = types[std::size_t(
        node.choice("type", types, node.has("mesh") && !node.has("type") ? 6 : 0))];
    if (type == "hfield" || type == "sdf") {
      node.lost("<geom> type=\"" + type + "\"");
      return false;
    }
    piece.pose = part.file().read_pose(node);
    const bool stretched = node.has("fromto") && (type == "capsule" || type == "cylinder" ||
                                                  type == "box" || type == "ellipsoid");
    double half = 0;  // of the length along z, where two ends give it
    if (stretched) {
      const Ends ends = read_ends(node);
      half = ends.half;
      piece.pose = ends.pose;
    }
    if (type == "mesh") {
      mesh = &part.file().mesh_named(node, node.text("mesh"));
      if (!mesh->mesh) return false;
      piece.pose = compose(piece.pose, mesh->origin);
      piece.shape = mesh->mesh->shape;
      piece.mesh = mesh->mesh->file;
      return true;
    }
    if (node.has("mesh")) {
      node.lost("<geom> mesh: a primitive fitted to a mesh");
      return false;
    }
    if (type == "plane") {
      piece.shape = PlaneShape{};
    } else if (type == "sphere") {
      piece.shape = SphereShape{sizes(node, 1)[0]};
    } else if (type == "capsule" || type == "cylinder") {
      const std::vector<double> x = sizes(node, stretched ? 1 : 2);
      if (!stretched) half = x[1];
      if (type == "capsule")
        piece.shape = CapsuleShape{2 * half, x[0]};
      else
        piece.shape = CylinderShape{2 * half, x[0]};
    } else {
      const std::vector<double> x = sizes(node, stretched ? 1 : 3);
      const Vector3 full =
          stretched ? Vector3{2 * x[0], 2 * x[0], 2 * half} : Vector3{2 * x[0], 2 * x[1], 2 * x[2]};
      if (stretched && x.size() > 1 && x[1] != x[0])
        node.changed("<geom> size with fromto: the first number counts for x and y, as in MuJoCo");
      if (type == "box") {
        CuboidShape box;
        box.size = full;
        piece.shape = box;
      } else {
        piece.shape = EllipsoidShape{full};
        if (const std::string fault = slenderness_fault(piece.shape); !fault.empty())
          node.fail(fault);
      }
    }
    return true;
  }

  MjcfWhole& whole_;
  Robot& robot_;
};

}  // namespace

void read_mjcf_bodies(MjcfWhole& whole, const MjcfScope& scope) {
  Bodies bodies(whole);
  for (const RobotNode& section : scope.file->sections) {
    if (section.name() != "worldbody") continue;
    bodies.keep_names(section.element(), 0);
    bodies.read_world(section, scope);
  }
}

}  // namespace tangere
