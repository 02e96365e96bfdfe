// SPDX-License-Identifier: Apache-2.0
// Each joint becomes a combination of joints that follow none, once, leaders first.
#include "engine/model/compile_followers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

namespace tangere {
namespace {

/// A coordinate in terms of joints that follow none.
struct Combination {
  std::map<std::size_t, double> ratios;  ///< by joint
  double offset = 0;
};

class Followers {
 public:
  Followers(const CompiledModel& m, const NameIndex& joints)
      : m_(m), joints_(joints), known_(m.scene.links.size()), begun_(m.scene.links.size()) {}

  /// Returns the coordinate of a joint.
  const Combination& combination(std::size_t joint) {
    std::optional<Combination>& out = known_[joint];
    if (out) return *out;
    const JointDescription& d = m_.scene.links[joint].joint;
    if (dof_count(d.type) != 1)
      fail(d, fmt::format("has {} degrees of freedom; expected a revolute or prismatic joint where "
                          "one follows",
                          dof_count(d.type)));
    if (std::exchange(begun_[joint], 1) != 0) fail(d, "follows itself; expected no circle");
    if (!d.follows.empty() && d.ratio.size() != d.follows.size())
      fail(d, fmt::format("follows {} joints with {} ratios; expected as many", d.follows.size(),
                          d.ratio.size()));
    Combination sum;
    if (d.follows.empty()) sum.ratios[joint] = 1;
    if (!d.follows.empty()) sum.offset = d.offset;
    for (std::size_t k = 0; k < d.follows.size(); ++k) {
      const Combination& leader =
          combination(std::size_t(joints_.find("joint", d.follows[k], d.source)));
      sum.offset += d.ratio[k] * leader.offset;
      for (const auto& [of, ratio] : leader.ratios) sum.ratios[of] += d.ratio[k] * ratio;
    }
    return out.emplace(std::move(sum));
  }

 private:
  [[noreturn]] static void fail(const JointDescription& d, const std::string& text) {
    throw InputError(d.source.prefix() + "joint '" + d.name + "' " + text);
  }

  const CompiledModel& m_;
  const NameIndex& joints_;
  std::vector<std::optional<Combination>> known_;  ///< of each joint
  std::vector<char> begun_;
};

}  // namespace

void compile_followers(CompiledModel& m, const NameIndex& joints) {
  Followers followers(m, joints);
  for (std::size_t i = 0; i < m.scene.links.size(); ++i) {
    if (m.scene.links[i].joint.follows.empty()) continue;
    const Combination& of = followers.combination(i);
    const CompiledJoint& own = m.joints[i];
    m.followers.push_back({own.v, own.q, of.offset});
    for (const auto& [leader, ratio] : of.ratios)
      m.ties.push_back({own.v, own.q, m.joints[leader].v, m.joints[leader].q, ratio});
  }
}

void place_initial_followers(CompiledModel& m) {
  const std::vector<double> q = m.initial_q, v = m.initial_v;
  place_followers(
      m, [&](int i) -> double& { return m.initial_q[std::size_t(i)]; },
      [&](int i) -> double& { return m.initial_v[std::size_t(i)]; });
  constexpr double kRounding = 1e-6;  // of files that give both
  const auto differs = [](double given, double placed) {
    return std::abs(given - placed) > kRounding * (1 + std::abs(placed));
  };
  for (const kernels::Follower& f : m.followers) {
    const auto of = std::ranges::find_if(
        m.joints, [&](const CompiledJoint& j) { return j.v == f.v && j.link_count > 0; });
    const JointDescription& d = m.scene.links[std::size_t(of - m.joints.begin())].joint;
    const auto given = std::ranges::find(m.scene.initial, d.name, &InitialState::joint);
    const auto iq = std::size_t(f.q), iv = std::size_t(f.v);
    if (given == m.scene.initial.end() ||
        !(differs(q[iq], m.initial_q[iq]) || differs(v[iv], m.initial_v[iv])))
      continue;
    throw InputError(given->source.prefix() +
                     fmt::format("joint '{}' starts at {} with rate {}, but by what it follows "
                                 "(line {}) at {} with {}; expected no start of its own",
                                 d.name, q[iq], v[iv], d.source.line, m.initial_q[iq],
                                 m.initial_v[iv]));
  }
}

}  // namespace tangere
