// SPDX-License-Identifier: Apache-2.0
#include "engine/model/compile_followers.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace tangere {
namespace {

/// A coordinate in terms of joints that follow none.
struct Combination {
  std::map<std::size_t, double> ratios;  ///< by joint
  double offset = 0;
};

class Followers {
 public:
  Followers(const CompiledModel& m, const NameIndex& joints) : m_(m), joints_(joints) {}

  /// Adds `factor` times the coordinate of a joint. `depth`: followers on the way to it.
  void add(std::size_t joint, double factor, std::size_t depth, Combination& out) const {
    const JointDescription& d = m_.scene.links[joint].joint;
    if (dof_count(d.type) != 1)
      fail(d, fmt::format("has {} degrees of freedom; expected a revolute or prismatic joint where "
                          "one follows",
                          dof_count(d.type)));
    if (depth > m_.scene.links.size()) fail(d, "follows itself; expected no circle");
    if (d.follows.empty()) {
      out.ratios[joint] += factor;
      return;
    }
    if (d.ratio.size() != d.follows.size())
      fail(d, fmt::format("follows {} joints with {} ratios; expected as many", d.follows.size(),
                          d.ratio.size()));
    out.offset += factor * d.offset;
    for (std::size_t k = 0; k < d.follows.size(); ++k)
      add(std::size_t(joints_.find("joint", d.follows[k], d.source)), factor * d.ratio[k],
          depth + 1, out);
  }

 private:
  [[noreturn]] static void fail(const JointDescription& d, const std::string& text) {
    throw InputError(d.source.prefix() + "joint '" + d.name + "' " + text);
  }

  const CompiledModel& m_;
  const NameIndex& joints_;
};

}  // namespace

void compile_followers(CompiledModel& m, const NameIndex& joints) {
  for (std::size_t i = 0; i < m.scene.links.size(); ++i) {
    if (m.scene.links[i].joint.follows.empty()) continue;
    Combination of;
    Followers(m, joints).add(i, 1, 0, of);
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
    const auto of = std::ranges::find(m.joints, f.v, &CompiledJoint::v);
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
