// SPDX-License-Identifier: Apache-2.0
// gravcomp lifts a body by a part of its weight. A scene has one share of gravity for bodies that
// move rigidly together. The share of a body that its joints cannot lift does not matter.
#include <algorithm>
#include <cmath>
#include <set>

#include "engine/scene/outer_pose.hpp"
#include "io/robot/mjcf_file.hpp"

namespace tangere {
namespace {

constexpr double kLevel = 1e-9;  // of an axis along or across gravity

/// Whether moving the joint changes heights. `at`: of its frame in the world.
bool lifts(const JointDescription& joint, const Pose& at, const Vector3& gravity) {
  const double g = std::sqrt(dot(gravity, gravity));
  const Vector3 axis = outer_direction(at, joint.axis0), across = cross(axis, gravity);
  switch (joint.type) {
    case JointType::fixed: return false;
    case JointType::revolute: return dot(across, across) > kLevel * g * g;
    case JointType::prismatic: return std::abs(dot(axis, gravity)) > kLevel * g;
    default: return true;
  }
}

bool has_mass(const BodyDescription& body) {
  const auto* const mass = std::get_if<AbstractShape>(&body.shape);
  return mass != nullptr ? mass->mass > 0 : body.density > 0;
}

}  // namespace

void read_mjcf_gravity(MjcfWhole& whole) {
  if (whole.gravcomp.empty()) return;
  std::vector<LinkDescription>& links = whole.robot.scene.links;
  std::vector<Pose> at;
  std::vector<int> root;  // the link that it moves with; -1: it stands in the world
  std::vector<bool> lifted;
  std::vector<std::size_t> tree;
  std::map<int, double> shares;         // by root
  std::map<std::size_t, double> usual;  // by tree: of its first body that joints lift
  std::set<int> mixed;
  for (std::size_t i = 0; i < links.size(); ++i) {
    const JointDescription& joint = links[i].joint;
    const auto up = std::size_t(links[i].parent);
    const bool first = links[i].parent < 0;
    at.push_back(first ? joint.pose : compose(at[up], joint.pose));
    root.push_back(joint.type != JointType::fixed ? static_cast<int>(i) : first ? -1 : root[up]);
    tree.push_back(first ? i : tree[up]);
    lifted.push_back((!first && lifted[up]) || lifts(joint, at.back(), whole.robot.scene.gravity));
    if (!lifted.back() || !has_mass(links[i].body)) continue;
    const double share = links[i].body.gravity_share;
    if (shares.try_emplace(root[i], share).first->second != share) mixed.insert(root[i]);
    usual.try_emplace(tree[i], share);
  }
  for (std::size_t i = 0; i < links.size(); ++i) {
    double& share = links[i].body.gravity_share;
    if (!has_mass(links[i].body) || root[i] < 0 || mixed.contains(root[i]))
      share = 1;
    else if (const auto own = shares.find(root[i]); own != shares.end())
      share = own->second;
    else  // its weight does no work
      share = usual.contains(tree[i]) ? usual.at(tree[i]) : 1;
  }
  for (const auto& [link, source] : whole.gravcomp)
    if (mixed.contains(root[std::size_t(link)]))
      whole.robot.lost.add(source,
                           "<body> gravcomp: it is not that of all bodies that move rigidly with "
                           "it, which have one share of gravity");
}

}  // namespace tangere
