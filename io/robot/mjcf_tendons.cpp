// SPDX-License-Identifier: Apache-2.0
// Fixed tendons of MJCF: L = Σ c q of hinges and slides. A tendon becomes a joint without mass that
// follows them. Our coordinates are already less ref, so ours is L - Σ c ref.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/robot/mjcf_file.hpp"
#include "io/robot/mjcf_words.hpp"

namespace tangere {
namespace {

const Words kTendons = {
    {"fixed"}, {"spatial", Fate::lost, "a tendon along places of bodies; scenes have none"}};

class Tendon {
 public:
  Tendon(MjcfWhole& whole, const MjcfScope& model, const RobotNode& node)
      : whole_(whole), model_(model), node_(node) {}

  void read() {
    node_.check(mjcf_words("tendon"));
    if (!read_leaders()) return;
    joint_.source = node_.source();
    joint_.name = whole_.names.free_name(model_.full_name(node_.text("name", "tendon")));
    if (whole_.has_dampers) joint_.damping = node_.not_negative("damping", 0.0);
    joint_.armature = node_.not_negative("armature", 0.0);
    if (whole_.has_friction) joint_.friction = node_.not_negative("frictionloss", 0.0);
    read_spring();
    read_range();
    MjcfJoint end;
    end.ref = zero_;
    end.range = range_;
    end.link = add_link(whole_.robot, whole_.names, joint_.name, -1, joint_, {}, "<fixed> tendon",
                        node_.source());
    whole_.joints[joint_.name] = end;
    whole_.tendons.insert(joint_.name);
    whole_.tendon_names[{model_.model, node_.text("name", "")}] = joint_.name;
    node_.changed("<fixed>: a joint without mass that follows those of the tendon");
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
      return node_.lost("<fixed> range of a tendon whose spring rests between two lengths");
    joint_.limits = {x[0] - zero_, x[1] - zero_};
  }

  MjcfWhole& whole_;
  const MjcfScope& model_;
  const RobotNode& node_;
  JointDescription joint_;
  double zero_ = 0;    ///< the file's length where ours is 0
  double spring_ = 0;  ///< our length where the springs of all joints rest
  std::optional<std::array<double, 2>> range_;
};

}  // namespace

void read_mjcf_tendons(MjcfWhole& whole) {
  for (const MjcfScope* model : whole.models)
    for (const RobotNode& section : model->file->sections) {
      if (section.name() != "tendon") continue;
      for (const RobotNode& part : section.parts(kTendons))
        if (part.name() == "fixed")
          Tendon(whole, *model, model->file->with_class(part, "main")).read();
    }
}

}  // namespace tangere
