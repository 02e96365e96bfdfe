// SPDX-License-Identifier: Apache-2.0
// Candidate lists decide speed, never results: any margin gives the same bits, and a lane that outruns its list is
// noticed.
#include <gtest/gtest.h>

#include "engine/detection.hpp"
#include "engine/group_step.hpp"
#include "engine/workspace.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using kernels::kGroup;

struct Trajectory {
  std::vector<double> states;
  int rows = 0;  // longest list seen
};

/// Eight balls under a pad at different places, stepped by hand so that the margin is ours to choose.
Trajectory run(double margin, const kernels::KernelTable& table) {
  const auto m = compile(testing::rolling_ball(false, 8));
  Workspace w(*m);
  SingleWorkspace alone(*m);
  for (auto& list : w.lists) list.margin = margin;
  const GroupStep step(*m, {Integrator::bdf2, 5e-3, 1e-9, 20});
  for (int i = 0; i < m->nq; ++i)
    for (int l = 0; l < kGroup; ++l) w.q0[i][l] = m->initial_q[std::size_t(i)];
  for (int l = 0; l < kGroup; ++l) {
    w.q0[2][l] = -0.0148;
    w.v0[2][l] = -0.05 * l;  // the hardest comes in at 0.35 m/s: 1.75 mm a step
    w.q0[3][l] = 1e-3 * l;
  }
  Trajectory r;
  LaneBits history = 0;
  for (int t = 0; t < 40; ++t) {
    std::vector<double> q, v;
    for (int l = 0; l < kGroup; ++l) {
      const std::vector<double> u = testing::rolling_ball_control(100);
      for (int i = 0; i < 3; ++i) w.stage.tau[i][l] = u[std::size_t(i)];
    }
    // What the stepper does around advance(): the state before becomes the history.
    std::vector<kernels::LaneRow> q0(w.q0, w.q0 + m->nq), v0(w.v0, w.v0 + m->nv);
    NewtonReport report;
    step.advance(table, w, alone, kAllLanes, history, report);
    for (int l = 0; l < kGroup; ++l) EXPECT_FALSE(failed(report.status[l])) << "lane " << l << " step " << t;
    std::copy(q0.begin(), q0.end(), w.q_before);
    std::copy(v0.begin(), v0.end(), w.v_before);
    history = kAllLanes;
    r.rows = std::max(r.rows, *std::max_element(w.lists[0].own_count, w.lists[0].own_count + kGroup));
  }
  for (int i = 0; i < m->nq; ++i)
    for (int l = 0; l < kGroup; ++l) r.states.push_back(w.q0[i][l]);
  return r;
}

TEST(Candidates, AnyMarginGivesTheSameBits) {
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    const Trajectory everything = run(1, *table);
    EXPECT_EQ(everything.rows, 2168);  // a metre of margin: every point is listed
    for (double margin : {1e-2, 1e-4, 1e-7}) {
      const Trajectory r = run(margin, *table);
      EXPECT_EQ(r.states, everything.states) << "margin " << margin;
      EXPECT_LT(r.rows, 2168);
    }
  }
}

TEST(Candidates, ALaneThatOutrunsItsListSaysSo) {
  const auto m = compile(testing::rolling_ball(false, 8));
  Workspace w(*m);
  for (double& x : w.stage.c0_over_h.lane) x = 200;
  for (double& x : w.stage.inverse_h.lane) x = 200;
  for (int i = 0; i < m->nq; ++i)
    for (double& x : w.stage.centre[i].lane) x = m->initial_q[std::size_t(i)];
  const kernels::KernelTable& table = kernels::active_kernels();
  table.group.kinematics(m->view, w.stage);
  find_candidates(*m, table, w, kAllLanes);
  table.group.kinematics(m->view, w.stage);
  for (double x : w.stage.excess[0].lane) EXPECT_LE(x, 0);
  w.stage.x[2][3] = -2 * w.lists[0].margin;
  table.group.kinematics(m->view, w.stage);
  for (int l = 0; l < kGroup; ++l) {
    if (l == 3) {
      EXPECT_GT(w.stage.excess[0][l], 0);
    } else {
      EXPECT_LE(w.stage.excess[0][l], 0);
    }
  }
}

}  // namespace
}  // namespace tangere
