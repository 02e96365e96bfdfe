// SPDX-License-Identifier: Apache-2.0
// Tendons of MJCF. Of fixed ones, L = Σ c q of hinges and slides: a joint without mass that follows
// them. Our coordinates are already less ref, so ours is L - Σ c ref. Of spatial ones, L is the
// length of a path: a joint without mass that is a transmission. So are actuators at sites.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/model/model.hpp"
#include "engine/scene/outer_pose.hpp"
#include "io/robot/mjcf_file.hpp"
#include "io/robot/mjcf_words.hpp"

namespace tangere {
namespace {

const Words kTendons = {{"fixed"}, {"spatial"}};

class Tendon {
 public:
  Tendon(MjcfWhole& whole, const MjcfScope& model, const RobotNode& node)
      : whole_(whole), model_(model), node_(node) {}

  void read() {
    node_.check(mjcf_words("tendon"));
    const bool fixed = node_.name() == "fixed";
    if (!(fixed ? read_leaders() : read_path())) return;
    joint_.source = node_.source();
    joint_.name = whole_.names.free_name(model_.full_name(node_.text("name", "tendon")));
    if (whole_.has_dampers) joint_.damping = node_.not_negative("damping", 0.0);
    joint_.armature = node_.not_negative("armature", 0.0);
    if (whole_.has_friction) joint_.friction = node_.not_negative("frictionloss", 0.0);
    if (!fixed) add_path();
    read_spring();
    read_range();
    MjcfJoint end;
    end.ref = zero_;
    end.range = range_;
    end.link = add_link(whole_.robot, whole_.names, joint_.name, -1, joint_, {},
                        "<" + node_.name() + "> tendon", node_.source());
    whole_.joints[joint_.name] = end;
    whole_.tendons.insert(joint_.name);
    whole_.tendon_names[{model_.model, node_.text("name", "")}] = joint_.name;
    node_.changed(fixed ? "<fixed>: a joint without mass that follows those of the tendon"
                        : "<spatial>: a joint without mass whose coordinate is the length");
  }

 private:
  /// Returns whether all joints are hinges and slides that stand once.
  bool read_leaders() {
    bool turns = true;
    for (const RobotNode& part : node_.parts({{"joint"}})) {
      part.check({{"joint"}, {"coef"}});
      const auto found = whole_.joint_names.copies.find({model_.model, part.text("joint")});
      if (found == whole_.joint_names.copies.end())
        part.fail(fmt::format("joint=\"{}\": no joint has this name", part.text("joint")));
      if (found->second.size() != 1)
        return node_.lost("<fixed> tendon along copies of a joint"), false;
      const MjcfJoint& leader = whole_.joints.at(found->second[0].name);
      const JointType type = whole_.robot.scene.links[std::size_t(leader.link)].joint.type;
      if (dof_count(type) != 1) part.fail("a tendon along a joint that is no hinge and no slide");
      turns = turns && type == JointType::revolute;
      const double coefficient = part.number("coef", 1.0);
      joint_.follows.push_back(found->second[0].name);
      joint_.ratio.push_back(coefficient);
      zero_ += coefficient * leader.ref;
      spring_ += coefficient * leader.spring;
    }
    if (joint_.follows.empty()) node_.fail("a tendon without joints");
    joint_.type = turns ? JointType::revolute : JointType::prismatic;
    return true;
  }

  std::optional<MjcfPlace> site(const RobotNode& part, const char* attribute) const {
    const std::optional<MjcfPlace> place = mjcf_site(whole_, model_, part, attribute);
    if (!place) part.lost("<spatial> by a site that is not of a body that stands once");
    return place;
  }

  /// Returns whether the path is one that scenes have.
  bool read_path() {
    path_.kind = TransmissionDescription::Kind::path;
    path_.source = node_.source();
    const Scene& scene = whole_.robot.scene;
    for (const RobotNode& part : node_.parts({{"site"}, {"geom"}, {"pulley"}})) {
      PathPart out;
      if (part.name() == "pulley") {
        part.check({{"divisor"}});
        out.kind = PathPart::Kind::pulley;
        out.divisor = part.positive("divisor", 1.0);
      } else if (part.name() == "site") {
        part.check({{"site"}});
        const std::optional<MjcfPlace> place = site(part, "site");
        if (!place) return false;
        out.body = body_at(scene, *place);
        out.position = in_body_frame(scene, *place).position;
      } else if (!read_geom(part, out)) {
        return false;
      }
      path_.path.push_back(out);
    }
    joint_.type = JointType::prismatic;
    joint_.axis0 = {1, 0, 0};
    return true;
  }

  bool read_geom(const RobotNode& part, PathPart& out) const {
    part.check({{"geom"}, {"sidesite"}});
    const auto found = whole_.geoms.find(model_.full_name(part.text("geom")));
    if (found == whole_.geoms.end()) {
      part.lost("<spatial> around a geom that is no named sphere or cylinder");
      return false;
    }
    const Scene& scene = whole_.robot.scene;
    const MjcfGeom& geom = found->second;
    const Pose own = in_body_frame(scene, geom.place);
    out.kind = geom.ball ? PathPart::Kind::sphere : PathPart::Kind::cylinder;
    out.body = body_at(scene, geom.place);
    out.position = own.position;
    out.radius = geom.radius;
    if (!geom.ball) out.axis = outer_direction(own, {0, 0, 1});
    if (!part.has("sidesite")) return true;
    const std::optional<MjcfPlace> side = site(part, "sidesite");
    if (!side) return false;
    out.side = in_body_frame(scene, {geom.place.link, seen_from(geom.place.link, *side)}).position;
    const Vector3 in_geom = compose(inverse(own), {*out.side, {1, 0, 0, 0}}).position;
    const double far =
        geom.ball ? std::sqrt(dot(in_geom, in_geom)) : std::hypot(in_geom[0], in_geom[1]);
    if (far >= geom.radius) return true;
    part.lost("<spatial> sidesite inside of the geom: a path on its inside");
    return false;
  }

  /// A place in the frame of another link, where all joints are at the file's reference pose.
  [[nodiscard]] Pose seen_from(int link, const MjcfPlace& place) const {
    const auto in_world = [&](MjcfPlace p) {
      for (; p.link >= 0; p.link = whole_.robot.scene.links[std::size_t(p.link)].parent)
        p.pose = compose(whole_.robot.scene.links[std::size_t(p.link)].joint.pose, p.pose);
      return p.pose;
    };
    return compose(inverse(in_world({link, {}})), in_world(place));
  }

  /// Adds the transmission, and finds its length where the springs of all joints rest.
  void add_path() {
    path_.joint = joint_.name;
    Scene alone = whole_.robot.scene;
    alone.motors.clear(), alone.initial.clear(), alone.loops.clear(), alone.randomizations.clear();
    alone.transmissions = {path_};
    LinkDescription link;
    link.name = link.body.name = link.joint.name = joint_.name;
    link.joint.type = JointType::prismatic;
    link.joint.axis0 = {1, 0, 0};
    link.body.shape = AbstractShape{};
    alone.links.push_back(link);
    for (const auto& [name, end] : whole_.joints)
      if (end.spring != 0 && !whole_.tendons.contains(name))
        alone.initial.push_back({name, {end.spring}, {}, {}});
    std::erase_if(alone.links,
                  [&](const LinkDescription& l) { return whole_.tendons.contains(l.joint.name); });
    spring_ = Model(alone).initial_q().back();
    whole_.robot.scene.transmissions.push_back(path_);
  }

  /// A spring with a rest length, or one that rests between two, which is a pair of limits.
  void read_spring() {
    const double stiffness = whole_.has_springs ? node_.not_negative("stiffness", 0.0) : 0;
    if (stiffness == 0) return;
    std::vector<double> rest = {-1};  // MuJoCo's word for the length where springs of joints rest
    if (node_.has("springlength")) rest = node_.numbers("springlength");
    if (rest.empty() || rest.size() > 2)
      node_.fail(fmt::format("springlength has {} numbers; expected 1 or 2", rest.size()));
    const bool follows_joints = rest[0] == -1;
    for (double& length : rest) length = follows_joints ? spring_ : length - zero_;
    if (rest.size() == 1 || rest[0] == rest[1]) {
      joint_.stiffness = stiffness;
      if (rest[0] != 0) joint_.rest = {rest[0]};
      return;
    }
    joint_.limits = {rest[0], rest[1]};
    joint_.limit_stiffness = stiffness;
  }

  void read_range() {
    const int word = node_.choice("limited", {"auto", "true", "false"}, 0);
    if (!node_.has("range") || !(word == 1 || (word == 0 && node_.has("range")))) return;
    const std::vector<double> x = node_.numbers("range", 2);
    if (!(x[0] < x[1])) node_.fail("range: expected low, then high");
    range_ = {x[0], x[1]};
    if (!whole_.has_limits) return;
    if (joint_.limits)
      return node_.lost("<" + node_.name() +
                        "> range of a tendon whose spring rests between two lengths");
    joint_.limits = {x[0] - zero_, x[1] - zero_};
  }

  MjcfWhole& whole_;
  const MjcfScope& model_;
  const RobotNode& node_;
  JointDescription joint_;
  TransmissionDescription path_;  ///< of a spatial one
  double zero_ = 0;               ///< the file's length where ours is 0
  double spring_ = 0;             ///< our length where the springs of all joints rest
  std::optional<std::array<double, 2>> range_;
};

}  // namespace

std::optional<MjcfPlace> mjcf_site(const MjcfWhole& whole, const MjcfScope& model,
                                   const RobotNode& node, const char* attribute) {
  const std::string name = model.full_name(node.text(attribute));
  if (const auto site = whole.robot.sites.find(name); site != whole.robot.sites.end())
    return MjcfPlace{site->second.link, site->second.pose};
  if (const auto site = whole.world_sites.find(name); site != whole.world_sites.end())
    return MjcfPlace{-1, site->second};
  return std::nullopt;
}

Pose in_body_frame(const Scene& scene, const MjcfPlace& place) {
  return place.link < 0
             ? place.pose
             : compose(inverse(scene.links[std::size_t(place.link)].body.pose), place.pose);
}

std::string body_at(const Scene& scene, const MjcfPlace& place) {
  return place.link < 0 ? "" : scene.links[std::size_t(place.link)].body.name;
}

std::string add_mjcf_wrench(MjcfWhole& whole, const MjcfScope& model, const RobotNode& node) {
  Scene& scene = whole.robot.scene;
  TransmissionDescription d;
  d.kind = TransmissionDescription::Kind::wrench;
  d.source = node.source();
  const std::optional<MjcfPlace> site = mjcf_site(whole, model, node, "site");
  std::vector<double> gear = node.has("gear") ? node.numbers("gear") : std::vector<double>{1};
  gear.resize(std::max<std::size_t>(gear.size(), 6));
  const auto lost = [&](const char* text) {
    node.lost("<" + node.name() + "> " + text);
    return std::string();
  };
  if (!site || site->link < 0) return lost("at a site that is not of a body that stands once");
  const Pose own = in_body_frame(scene, *site);
  d.body = body_at(scene, *site);
  d.position = own.position;
  d.force = {gear[0], gear[1], gear[2]};
  d.torque = outer_direction(own, {gear[3], gear[4], gear[5]});
  if (node.has("refsite")) {
    const std::optional<MjcfPlace> reference = mjcf_site(whole, model, node, "refsite");
    if (!reference) return lost("refsite: not of a body that stands once");
    if (d.torque != Vector3{0, 0, 0}) return lost("refsite: a torque about the axes of another");
    const Pose second = in_body_frame(scene, *reference);
    d.reference = body_at(scene, *reference);
    d.reference_position = second.position;
    d.force = outer_direction(second, d.force);
  } else {
    d.force = outer_direction(own, d.force);
  }
  JointDescription joint;
  joint.source = node.source();
  joint.name = d.joint = whole.names.free_name(model.full_name(node.text("name", "site_motor")));
  const bool turns = gear[0] == 0 && gear[1] == 0 && gear[2] == 0;
  joint.type = turns ? JointType::revolute : JointType::prismatic;
  joint.axis0 = {1, 0, 0};
  MjcfJoint end;
  end.link = add_link(whole.robot, whole.names, joint.name, -1, joint, {}, "an actuator at a site",
                      node.source());
  whole.joints[joint.name] = end;
  whole.tendons.insert(joint.name);
  scene.transmissions.push_back(d);
  node.changed("<" + node.name() + "> at a site: a motor of a joint without mass");
  return joint.name;
}

void read_mjcf_tendons(MjcfWhole& whole) {
  for (const MjcfScope* model : whole.models)
    for (const RobotNode& section : model->file->sections) {
      if (section.name() != "tendon") continue;
      for (const RobotNode& part : section.parts(kTendons))
        Tendon(whole, *model, model->file->with_class(part, "main")).read();
    }
}

}  // namespace tangere
