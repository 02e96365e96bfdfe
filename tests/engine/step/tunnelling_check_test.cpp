// SPDX-License-Identifier: Apache-2.0
// Tests the bound that spares the look for bodies that came through each other: what it leaves out
// did not pass.
#include "engine/step/tunnelling_check.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "engine/model/compile.hpp"
#include "engine/step/detection.hpp"
#include "engine/step/state_difference.hpp"
#include "tests/engine/random_scene.hpp"
#include "tests/engine/stage_buffers.hpp"

namespace tangere {
namespace {

using kernels::kGroup;
using kernels::Quat;
using testing::Random;

/// Trees of random joints, whose roots are `spread` times as far from each other.
Scene spread_trees(unsigned seed, double spread) {
  Scene s = testing::random_contacts(seed, 3, ContactLaw::clamped);
  s.ground_contacts.clear();
  for (LinkDescription& link : s.links)
    for (double& x : link.joint.pose.position)
      if (link.parent < 0) x *= spread;
  return s;
}

/// Sets a lane's state to random numbers, its displacement to `way` times others, and where this
/// leads.
void displace(const CompiledModel& m, unsigned seed, double way, int lane, Workspace& w) {
  testing::StageBuffers<double> b(m);
  Random random(seed);
  testing::randomise(b, m, random, 1);
  for (int i = 0; i < m.nq; ++i) w.q0[i][lane] = w.q1[i][lane] = b.centre[std::size_t(i)];
  for (int i = 0; i < m.nv; ++i) w.stage.x[i][lane] = way * b.x[std::size_t(i)];
  for (const kernels::Link& link : m.links) {
    const auto x = [&](int k) { return w.stage.x[link.v + k][lane]; };
    if (link.kind != kernels::JointKind::spherical) {
      for (int k = 0; k < kernels::dofs(link.kind); ++k) w.q1[link.q + k][lane] += x(k);
      continue;
    }
    const Quat<double> q = rotate_by(quat_at(w.q0 + link.q, lane), {x(0), x(1), x(2)});
    w.q1[link.q][lane] = q.w, w.q1[link.q + 1][lane] = q.x;
    w.q1[link.q + 2][lane] = q.y, w.q1[link.q + 3][lane] = q.z;
  }
  for (int i = 0; i < m.nq; ++i) w.stage.centre[i][lane] = w.q0[i][lane];
}

TEST(Passing, WhatIsOutOfReachDidNotPass) {
  constexpr double kSpreads[] = {1, 4, 20}, kWays[] = {0.02, 0.1, 0.4, 1};
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    int passed = 0, out_of_reach = 0, of_these_far = 0;
    for (unsigned seed = 0; seed < 120; ++seed)
      for (const double way : kWays) {
        const auto m = compile(spread_trees(seed, kSpreads[seed % 3]));
        Workspace w(*m);
        clear_candidates(*m, w);  // all count as apart
        const TunnellingCheck passing(*m);
        for (int l = 0; l < kGroup; ++l) displace(*m, 100 * seed + unsigned(l), way, l, w);
        for (double& x : w.stage.c0_over_h.lane) x = 1;
        for (double& x : w.stage.inverse_h.lane) x = 1;
        table->group.kinematics(m->view, w.stage);
        const LaneBits spared = passing.out_of_reach<kGroup>(w, kAllLanes),
                       far = passing.far_movers<kGroup>(w.stage.x, w.test);
        table->group.poses_at(m->view, w.stage, w.q0, w.v0, w.zero, w.poses_before.data());
        table->group.poses_at(m->view, w.stage, w.q1, w.v0, w.zero, w.poses_after.data());
        for (int l = 0; l < kGroup; ++l) {
          const bool came_through = passing.tunnelled<kGroup>(w.poses_before, w.poses_after, l);
          EXPECT_FALSE(came_through && has(spared, l)) << "seed " << seed << " lane " << l;
          passed += came_through ? 1 : 0;
          out_of_reach += has(spared, l) ? 1 : 0;
          of_these_far += has(spared & far, l) ? 1 : 0;
        }
        std::ranges::fill(w.own_candidates.apart, 0);
        EXPECT_EQ(passing.out_of_reach<kGroup>(w, kAllLanes), kNoLane) << "near in some lane";
      }
    EXPECT_GT(passed, 20);
    EXPECT_GT(out_of_reach, 100);
    EXPECT_GT(of_these_far, 100) << "steps in which the look is spared";
  }
}

}  // namespace
}  // namespace tangere
