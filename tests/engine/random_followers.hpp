// SPDX-License-Identifier: Apache-2.0
// Seeded random machines in which joints follow others, and starts in which they are in place.
#pragma once

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "tests/engine/gradient_run.hpp"
#include "tests/engine/random_machine.hpp"

namespace tangere::testing {

/// A random machine in which each second joint of one dof follows the one before, the share
/// `polynomials` of them by a polynomial. `chains`: some follow followers.
inline Scene following_machine(unsigned seed, int links, double polynomials = 0,
                               bool chains = true) {
  Scene s = random_machine(seed, links);
  Random random(seed + 700);
  const JointDescription* leader = nullptr;
  bool curved = false;  // the chain has its polynomial
  for (LinkDescription& l : s.links) {
    if (l.joint.type == JointType::free || l.joint.type == JointType::free2d) continue;
    l.joint.type = random.uniform(0, 1) < 0.6 ? JointType::revolute : JointType::prismatic;
    l.joint.rest.clear();
    if (leader == nullptr) {
      leader = &l.joint;
      curved = false;
      continue;
    }
    l.joint.follows = {leader->name};
    l.joint.ratio = {random.uniform(-1.5, 1.5)};
    l.joint.offset = random.uniform(-0.1, 0.1);
    if (polynomials > 0 && !curved && random.uniform(0, 1) < polynomials) {
      curved = true;
      for (int k = 0; k < 3; ++k) l.joint.powers.push_back(random.uniform(-3, 3));
    }
    // A chain: the next one may follow this follower.
    leader = chains && random.uniform(0, 1) < 0.5 ? &l.joint : nullptr;
  }
  return s;
}

inline int count_followers(const Scene& s) {
  return static_cast<int>(
      std::ranges::count_if(s.links, [](const auto& l) { return !l.joint.follows.empty(); }));
}
inline int count_polynomials(const Scene& s) {
  return static_cast<int>(
      std::ranges::count_if(s.links, [](const auto& l) { return !l.joint.powers.empty(); }));
}

/// Puts followers of one joint each where they belong. Leaders stand before their followers.
inline void place_followers(const Scene& s, RunInput& in) {
  struct At {
    std::size_t q, v;
  };
  std::map<std::string, At> first;
  At at{0, 0};
  for (const LinkDescription& l : s.links) {
    const JointDescription& d = l.joint;
    first[d.name] = at;
    if (!d.follows.empty()) {
      const At leader = first.at(d.follows[0]);
      const double x = in.q[leader.q];
      double q = d.offset + d.ratio[0] * x, slope = d.ratio[0], power = x;
      for (std::size_t k = 0; k < d.powers.size(); ++k) {
        slope += double(k + 2) * d.powers[k] * power;
        power *= x;
        q += d.powers[k] * power;
      }
      in.q[at.q] = q;
      in.v[at.v] = slope * in.v[leader.v];
    }
    at.q += std::size_t(position_count(d.type));
    at.v += std::size_t(dof_count(d.type));
  }
}

inline RunInput following_input(const Model& model, unsigned seed, int steps) {
  RunInput in = random_input(model, seed, steps);
  place_followers(model.scene(), in);
  return in;
}

}  // namespace tangere::testing
