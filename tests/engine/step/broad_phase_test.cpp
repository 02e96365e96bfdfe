// SPDX-License-Identifier: Apache-2.0
// The pairs that the broad phase finds against all pairs of balls, and a box that is so fast that
// it meets another which was out of reach where the step began.
#include "engine/step/broad_phase.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <set>

#include "engine/model/compile.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using kernels::kGroup;
using testing::link;
using testing::Random;

/// Boxes in a row along x, 0.2 m apart, without gravity. All pairs are declared, or box 0 with box
/// 1 alone.
Scene row_of_boxes(int count, bool all_pairs) {
  Scene s;
  s.name = "row";
  s.integrator = Integrator::bdf1;
  s.timestep = 5e-3;
  s.gravity = {0, 0, 0};
  for (int i = 0; i < count; ++i) {
    const double size = i % 3 == 2 ? 0.08 : 0.04;
    s.links.push_back(link("b" + std::to_string(i), JointType::free, {0.2 * i, 0, 0},
                           CuboidShape{{size, size, size}, {4, 4, 4}}, 600));
    for (int j = 0; j < count; ++j)
      if (j != i && (all_pairs || std::max(i, j) == 1))
        s.pair_contacts.push_back({"b" + std::to_string(i),
                                   "b" + std::to_string(j),
                                   {5e3, 5, 0.6, 1e3},
                                   ContactLaw::clamped,
                                   1e-5,
                                   {}});
  }
  return s;
}

TEST(BroadPhase, ConsidersThePairsWithinReachOfEachOther) {
  const auto m = compile(row_of_boxes(12, true));
  ASSERT_EQ(m->link_balls.size(), m->links.size());
  Random random(3);
  for (int round = 0; round < 40; ++round) {
    BroadPhase<kGroup> broad(*m);
    kernels::Stage<kGroup> stage{};
    broad.start(stage);
    for (std::size_t i = 0; i < 3 * m->links.size(); ++i)
      for (int l = 0; l < kGroup; ++l) stage.ball_starts[i][l] = 0.1 * random.normal();
    const unsigned lanes = 1 + unsigned(round) * 37 % 255;
    EXPECT_TRUE(broad.find(lanes, stage));
    std::set<int> expected;
    for (std::size_t g = 0; g < m->link_pairs.size(); ++g)
      for (int l = 0; l < kGroup; ++l) {
        if ((lanes >> l & 1U) == 0) continue;
        double square = 0, reach = 0;
        const int a = m->link_pairs[g].link1, b = m->link_pairs[g].link2;
        for (int k = 0; k < 3; ++k) {
          const double way = stage.ball_starts[3 * a + k][l] - stage.ball_starts[3 * b + k][l];
          square += way * way;
        }
        for (const int i : {a, b})
          reach += m->link_balls[std::size_t(i)].radius + stage.ball_slack[i][l];
        if (square <= reach * reach) expected.insert(static_cast<int>(g));
      }
    EXPECT_THAT(std::vector<int>(stage.considered, stage.considered + stage.n_considered),
                ::testing::ElementsAreArray(expected));
    EXPECT_LT(expected.size(), m->link_pairs.size());
  }
}

TEST(BroadPhase, ABallThatMovedBeyondItsSlackIsWithinReachOfMore) {
  const auto m = compile(row_of_boxes(12, true));
  BroadPhase<1> broad(*m);
  kernels::Stage<1> stage{};
  broad.start(stage);
  for (std::size_t i = 0; i < m->links.size(); ++i) stage.ball_starts[3 * i][0] = 0.05 * double(i);
  EXPECT_TRUE(broad.find(1, stage));
  const int few = stage.n_considered;
  EXPECT_FALSE(broad.widen(1));
  for (std::size_t i = 0; i < m->links.size(); ++i) stage.ball_moves[i][0] = 0;
  const int moved = m->link_pairs[0].link1;
  stage.ball_moves[moved][0] = 0.3;
  EXPECT_FALSE(broad.widen(0));
  EXPECT_TRUE(broad.widen(1));
  EXPECT_GT(stage.ball_slack[moved][0], 0.3);
  EXPECT_TRUE(broad.find(1, stage));
  EXPECT_GT(stage.n_considered, few);
  EXPECT_THAT(broad.dropped(), ::testing::IsEmpty());
  stage.ball_starts[3 * moved][0] = NAN;  // a ball whose place is not known is within reach of all
  EXPECT_TRUE(broad.find(1, stage));
}

/// At 30 m/s box 0 covers 0.15 m in a step, nearly its distance from box 1. Its slack is 9 mm.
TEST(BroadPhase, AFastBoxMeetsWhatWasOutOfReach) {
  std::vector<std::vector<double>> ends;
  for (const bool all_pairs : {true, false}) {
    const Model model(row_of_boxes(12, all_pairs));
    Batch batch(model, 3);
    for (int e = 0; e < 3; ++e) {
      std::vector<double> v(std::size_t(model.nv()), 0.0);
      v[0] = e == 1 ? 30 : 0;  // its neighbours rest
      batch.set_state(e, testing::q_of(batch, e), v);
    }
    Stepper stepper(model, testing::options(Integrator::bdf1, 5e-3));
    for (int t = 0; t < 2; ++t) testing::step_all(stepper, batch, {});
    EXPECT_FALSE(failed(batch.status(1)));
    ends.push_back(testing::v_of(batch, 1));
    EXPECT_LT(ends.back()[0], 20) << "it hit box 1";
    EXPECT_GT(ends.back()[6], 1);
  }
  for (std::size_t i = 0; i < ends[0].size(); ++i) EXPECT_NEAR(ends[0][i], ends[1][i], 1e-7);
}

}  // namespace
}  // namespace tangere
