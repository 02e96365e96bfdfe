// SPDX-License-Identifier: Apache-2.0
#include "engine/model/compile_followers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/scene/scene_number.hpp"

namespace tangere {
namespace {

/// The joint at the end of a chain of followers, and the coordinate in terms of its.
struct Leader {
  std::size_t joint;
  double ratio, offset;
};

Leader leader_of(const CompiledModel& m, const NameIndex& joints, std::size_t follower) {
  Leader out{follower, 1, 0};
  for (std::size_t passed = 0; !m.scene.links[out.joint].joint.follows.empty(); ++passed) {
    const JointDescription& d = m.scene.links[out.joint].joint;
    const auto fail = [&](const std::string& text) {
      throw InputError(d.source.prefix() + "joint '" + d.name + "' follows '" + d.follows + "', " +
                       text);
    };
    if (passed > m.scene.links.size()) fail("which follows it in turn; expected no circle");
    const auto next = std::size_t(joints.find("joint", d.follows, d.source));
    if (dof_count(m.scene.links[next].joint.type) != 1)
      fail(fmt::format("which has {} degrees of freedom; expected a revolute or prismatic joint",
                       dof_count(m.scene.links[next].joint.type)));
    out.offset += out.ratio * d.offset;
    out.ratio *= d.ratio;
    out.joint = next;
  }
  return out;
}

/// Returns where the scene gives a joint's initial state or draws it; null: it does not.
const Source* given_start(const Scene& scene, const std::string& joint) {
  for (const InitialState& d : scene.initial)
    if (d.joint == joint) return &d.source;
  return nullptr;
}

}  // namespace

void compile_followers(CompiledModel& m, const NameIndex& joints) {
  for (std::size_t i = 0; i < m.scene.links.size(); ++i) {
    const JointDescription& d = m.scene.links[i].joint;
    if (d.follows.empty()) continue;
    if (dof_count(d.type) != 1)
      throw InputError(d.source.prefix() + "joint '" + d.name + "' follows '" + d.follows +
                       "' and has " + std::to_string(dof_count(d.type)) +
                       " degrees of freedom; expected a revolute or prismatic joint");
    const Leader leader = leader_of(m, joints, i);
    const CompiledJoint &own = m.joints[i], &other = m.joints[leader.joint];
    m.followers.push_back({own.v, other.v, own.q, other.q, leader.ratio, leader.offset});
  }
}

void place_followers(CompiledModel& m) {
  for (const kernels::Follower& f : m.followers) {
    const double q = m.initial_q[std::size_t(f.q)], v = m.initial_v[std::size_t(f.v)];
    place_follower(
        f, [&](int i) -> double& { return m.initial_q[std::size_t(i)]; },
        [&](int i) -> double& { return m.initial_v[std::size_t(i)]; });
    const auto of = std::ranges::find(m.joints, f.v, &CompiledJoint::v);
    const JointDescription& d = m.scene.links[std::size_t(of - m.joints.begin())].joint;
    const Source* const given = given_start(m.scene, d.name);
    const double follows_q = m.initial_q[std::size_t(f.q)],
                 follows_v = m.initial_v[std::size_t(f.v)];
    constexpr double kRounding = 1e-6;  // of files that give both
    if (given != nullptr && (std::abs(q - follows_q) > kRounding * (1 + std::abs(follows_q)) ||
                             std::abs(v - follows_v) > kRounding * (1 + std::abs(follows_v))))
      throw InputError(given->prefix() +
                       fmt::format("joint '{}' starts at {} with rate {}, but by its leader '{}' "
                                   "(line {}) at {} with {}; expected no start of its own",
                                   d.name, q, v, d.follows, d.source.line, follows_q, follows_v));
  }
}

}  // namespace tangere
