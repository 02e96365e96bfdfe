// SPDX-License-Identifier: Apache-2.0
// Constraints of MJCF: a joint that follows another,
//   q₁ - ref₁ = Σ_k c_k (q₂ - ref₂)^k
// where our coordinates are already less ref. Loops are in mjcf_loops.cpp.
#include <fmt/format.h>

#include <algorithm>

#include "io/robot/mjcf_file.hpp"
#include "io/robot/mjcf_words.hpp"

namespace tangere {
namespace {

const Words kEqualities = {{"joint"},
                           {"connect"},
                           {"weld"},
                           {"tendon", Fate::lost, "a tendon tied to another; scenes have none"},
                           {"flex", Fate::lost, "bodies that bend; scenes have none"},
                           {"flexvert", Fate::lost, "bodies that bend; scenes have none"},
                           {"flexstrain", Fate::lost, "bodies that bend; scenes have none"}};

const Words kEqualityWords = {{"name"},
                              {"class"},
                              {"active"},
                              {"joint1"},
                              {"joint2"},
                              {"polycoef"},
                              {"solref", Fate::idle, kSolverSetting},
                              {"solimp", Fate::idle, kSolverSetting}};

/// The copies of a joint that a model names; none where it has no such joint.
std::vector<MjcfCopy> copies_of(const MjcfWhole& whole, const MjcfScope& model,
                                const std::string& name) {
  const auto found = whole.joint_names.copies.find({model.model, name});
  return found == whole.joint_names.copies.end() ? std::vector<MjcfCopy>{} : found->second;
}

/// Ties one joint of the scene to another.
void tie_joints(MjcfWhole& whole, const RobotNode& node, const std::string& first,
                const std::string& second, const std::vector<double>& c) {
  JointDescription& joint = whole.robot.scene.links[std::size_t(whole.joints.at(first).link)].joint;
  if (!joint.follows.empty())
    return node.lost(fmt::format("<joint> of <equality>: joint '{}' follows '{}' already", first,
                                 joint.follows[0]));
  joint.follows = {second};
  joint.ratio = {c[1]};
  joint.offset = c[0];
  joint.powers.assign(c.begin() + 2, c.end());
  while (!joint.powers.empty() && joint.powers.back() == 0) joint.powers.pop_back();
}

void read_joint_equality(MjcfWhole& whole, const MjcfScope& model, const RobotNode& node) {
  node.check(kEqualityWords);
  if (!node.flag("active", true)) return node.idle("<joint> of <equality> that is not active");
  std::vector<double> c = {0, 1, 0, 0, 0};
  if (node.has("polycoef")) {
    const std::vector<double> given = node.numbers("polycoef");
    if (given.size() > c.size())
      node.fail(fmt::format("polycoef has {} numbers; expected at most 5", given.size()));
    std::copy(given.begin(), given.end(), c.begin());
  }
  const std::vector<MjcfCopy> first = copies_of(whole, model, node.text("joint1"));
  if (first.empty())
    node.fail(fmt::format("joint1=\"{}\": no joint has this name", node.text("joint1")));
  if (!node.has("joint2"))
    return node.lost("<joint> of <equality> without joint2: it holds a joint where it is");
  const std::vector<MjcfCopy> second = copies_of(whole, model, node.text("joint2"));
  if (second.empty())
    node.fail(fmt::format("joint2=\"{}\": no joint has this name", node.text("joint2")));
  if (first.size() != second.size())
    return node.lost("<joint> of <equality> between a joint and copies of another");
  for (std::size_t k = 0; k < first.size(); ++k)
    tie_joints(whole, node, first[k].name, second[k].name, c);
  node.changed(
      "<joint> of <equality>: the first joint follows the second exactly; MuJoCo's constraint is "
      "soft");
}

}  // namespace

void read_mjcf_equalities(MjcfWhole& whole) {
  if (!whole.has_equalities) return;
  for (const MjcfScope* model : whole.models)
    for (const RobotNode& section : model->file->sections) {
      if (section.name() != "equality") continue;
      for (const RobotNode& part : section.parts(kEqualities))
        if (part.name() == "joint")
          read_joint_equality(whole, *model, part);
        else if (part.name() == "connect" || part.name() == "weld")
          read_mjcf_loop(whole, *model, model->file->with_class(part, "main"));
    }
  check_followers(whole.robot);
}

}  // namespace tangere
