// SPDX-License-Identifier: Apache-2.0
// Tests that candidate lists affect speed but never results: any margin gives the same bits, and a
// lane that outruns its list is noticed.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <utility>

#include "engine/model/compile.hpp"
#include "engine/step/detection.hpp"
#include "engine/step/group_step.hpp"
#include "engine/step/workspace.hpp"
#include "kernels/contact/distance.hpp"
#include "tests/engine/meshes.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/kernels/random_numbers.hpp"

namespace tangere {
namespace {

using kernels::kGroup;

struct Trajectory {
  std::vector<double> states;
  int rows = 0;      // longest list seen
  int searches = 0;  // changes of the pose at which a lane's list was made
};

/// Eight balls at different places under a pad, stepped by hand so that the test can choose the
/// margin.
Trajectory run(double margin, const kernels::KernelTable& table) {
  const auto m = compile(testing::rolling_ball(false, 8));
  Workspace w(*m);
  SingleWorkspace alone(*m);
  for (auto& list : w.own_candidates.lists) list.margin = margin;
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
  std::array<double, kGroup> reference{};
  for (int t = 0; t < 40; ++t) {
    std::vector<double> q, v;
    for (int l = 0; l < kGroup; ++l) {
      const std::vector<double> u = testing::rolling_ball_control(100);
      for (int i = 0; i < 3; ++i) w.stage.tau[i][l] = u[std::size_t(i)];
    }
    // Does what the stepper does around advance(): the state before becomes the history.
    std::vector<kernels::LaneRow> q0(w.q0, w.q0 + m->nq), v0(w.v0, w.v0 + m->nv);
    NewtonReport report;
    step.advance(table, w, alone, kAllLanes, history, report);
    for (int l = 0; l < kGroup; ++l)
      EXPECT_FALSE(failed(report.status[l])) << "lane " << l << " step " << t;
    std::copy(q0.begin(), q0.end(), w.q_before);
    std::copy(v0.begin(), v0.end(), w.v_before);
    history = kAllLanes;
    for (int l = 0; l < kGroup; ++l) {
      const double now = w.own_candidates.references[11][l];
      if (std::exchange(reference[std::size_t(l)], now) != now) ++r.searches;
    }
    r.rows = std::max(r.rows, *std::max_element(w.own_candidates.lists[0].own_count,
                                                w.own_candidates.lists[0].own_count + kGroup));
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
    EXPECT_EQ(everything.searches, kGroup) << "one list serves all steps";
    for (double margin : {1e-2, 1e-4, 1e-7}) {
      const Trajectory r = run(margin, *table);
      EXPECT_TRUE(margin > 1e-3 || r.searches > 2 * kGroup) << "margin " << margin;
      EXPECT_EQ(r.states, everything.states) << "margin " << margin;
      EXPECT_LT(r.rows, 2168);
    }
  }
}

/// A bar of three blocks above a table, a cylinder and a ball, all fixed: nine pairs of shapes but
/// one pair of links.
Scene bar_above_shapes() {
  Scene s;
  s.name = "bar";
  s.timestep = 2e-3;
  s.links = {
      testing::link("middle", JointType::free, {0, 0, 0.03},
                    CuboidShape{{0.03, 0.03, 0.03}, {3, 3, 3}}, 500),
      testing::link("left", JointType::fixed, {0, 0.03, 0},
                    CuboidShape{{0.03, 0.03, 0.03}, {3, 3, 3}}, 500),
      testing::link("right", JointType::fixed, {0, -0.03, 0},
                    CuboidShape{{0.03, 0.03, 0.03}, {3, 3, 3}}, 500),
      testing::link("table", JointType::fixed, {0, 0.05, 0},
                    CuboidShape{{0.1, 0.05, 0.02}, {2, 2, 2}}, 500),
      testing::link("roll", JointType::fixed, {0, -0.04, 0}, CylinderShape{0.05, 0.012, 8, 2}, 500),
      testing::link("ball", JointType::fixed, {0.01, 0, 0}, SphereShape{0.012}, 500)};
  s.links[1].parent = s.links[2].parent = 0;
  for (const char* block : {"middle", "left", "right"})
    for (const char* shape : {"table", "roll", "ball"})
      s.pair_contacts.push_back({block, shape, {5e3, 5, 1, 20}, ContactLaw::clamped, 1e-5, {}});
  return s;
}

/// States after some steps. `margin` 0: the model's own. Counts the listed candidates.
Trajectory drop_bar(double margin, const kernels::KernelTable& table) {
  const auto m = compile(bar_above_shapes());
  EXPECT_EQ(m->link_pairs.size(), 1U);
  Workspace w(*m);
  SingleWorkspace alone(*m);
  if (margin > 0)
    for (auto& list : w.own_candidates.lists) list.margin = margin;
  const GroupStep step(*m, {Integrator::bdf1, 2e-3, 1e-9, 20});
  for (int l = 0; l < kGroup; ++l) {
    for (int i = 0; i < m->nq; ++i) w.q0[i][l] = m->initial_q[std::size_t(i)];
    w.v0[2][l] = -0.1 * l;
    w.v0[4][l] = 0.5 * l;
  }
  Trajectory r;
  for (int t = 0; t < 60; ++t) {
    NewtonReport report;
    step.advance(table, w, alone, kAllLanes, kNoLane, report);
    for (int l = 0; l < kGroup; ++l)
      EXPECT_FALSE(failed(report.status[l])) << "lane " << l << " step " << t;
    for (const auto& list : w.own_candidates.lists)
      for (int count : list.own_count) r.rows += count;
  }
  for (int i = 0; i < m->nq; ++i)
    for (int l = 0; l < kGroup; ++l) r.states.push_back(w.q0[i][l]);
  return r;
}

TEST(Candidates, BoundsThatSkipPairsOfShapesChangeNoBits) {
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    const Trajectory everything = drop_bar(1, *table), own = drop_bar(0, *table),
                     tight = drop_bar(1e-6, *table);
    EXPECT_EQ(everything.rows, 60 * kGroup * 9 * 26);
    EXPECT_GT(own.rows, 0);
    EXPECT_LT(own.rows, everything.rows / 4);
    EXPECT_EQ(own.states, everything.states);
    EXPECT_EQ(tight.states, everything.states);
  }
}

/// One long step of bars that rest 2 cm out of reach of what is below them. In lane 0 nothing acts;
/// in the others a force that no prediction knows pushes ever harder: the last one arrives in the
/// same step. `margin` 0: the model's own. `poisoned`: a lane that does not live and holds no
/// numbers, or -1.
struct Arrival {
  std::vector<double> states;
  bool apart = false;  // nothing could touch at the end in any lane
  std::array<int, kGroup> listed{}, passes{};
};
Arrival arrive(double margin, LaneBits lanes, int poisoned, const kernels::KernelTable& table) {
  const auto m = compile(bar_above_shapes());
  Workspace w(*m);
  SingleWorkspace alone(*m);
  if (margin > 0)
    for (auto& list : w.own_candidates.lists) list.margin = margin;
  const double h = 2e-2;
  const GroupStep step(*m, {Integrator::bdf1, h, 1e-9, 20});
  double mass = 0;
  for (const kernels::Link& link : m->links) mass += link.mass;
  const kernels::LinkPair& links = m->link_pairs[0];
  constexpr double kDeep = 0.025;  // less what it falls: 4 mm in the table, whose top is nearest
  const double out_of_reach = links.shapes_middle.z + links.apart + links.margin + 0.02;
  for (int l = 0; l < kGroup; ++l) {
    for (int i = 0; i < m->nq; ++i) w.q0[i][l] = m->initial_q[std::size_t(i)];
    w.q0[2][l] += out_of_reach - 0.03;  // the scene starts 3 cm up
    w.stage.tau[2][l] = -mass * l / 7 * (out_of_reach - kDeep) / (h * h);
  }
  if (poisoned >= 0)
    for (int i = 0; i < m->nv; ++i)
      w.q0[i][poisoned] = w.v0[i][poisoned] = w.stage.tau[i][poisoned] = NAN;
  NewtonReport report;
  step.advance(table, w, alone, lanes, kNoLane, report);
  Arrival r;
  r.apart = w.own_candidates.apart[0] != 0;
  for (int l = 0; l < kGroup; ++l) {
    for (int i = 0; i < m->nq; ++i) r.states.push_back(has(lanes, l) ? w.q0[i][l] : 0);
    for (const auto& list : w.own_candidates.lists) r.listed[std::size_t(l)] += list.own_count[l];
    r.passes[std::size_t(l)] = report.iterations[std::size_t(l)];
    EXPECT_TRUE(!has(lanes, l) || !failed(report.status[std::size_t(l)])) << "lane " << l;
  }
  return r;
}

TEST(Candidates, BodiesThatComeWithinReachDuringAStepAreNotMissed) {
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    SCOPED_TRACE(table->name);
    const Arrival everything = arrive(1, kAllLanes, -1, *table),
                  own = arrive(0, kAllLanes, -1, *table);
    EXPECT_EQ(own.states, everything.states);
    EXPECT_EQ(own.passes, everything.passes);
    EXPECT_FALSE(own.apart);
    EXPECT_EQ(own.listed[0], 0);
    EXPECT_GT(own.listed[7], 0) << "it arrived";
    EXPECT_NE(own.passes[7], own.passes[0]) << "and was pushed back";
    const Arrival without = arrive(0, kAllLanes & ~8U, 3, *table);
    for (int l = 0; l < kGroup; ++l)
      for (std::size_t i = 0; i < own.states.size() / kGroup && l != 3; ++i)
        EXPECT_EQ(without.states[std::size_t(l) * own.states.size() / kGroup + i],
                  own.states[std::size_t(l) * own.states.size() / kGroup + i])
            << "lane " << l << " beside one without numbers";
    const Arrival still = arrive(0, 1, -1, *table);
    EXPECT_TRUE(still.apart);
    for (std::size_t i = 0; i < own.states.size() / kGroup; ++i)
      EXPECT_EQ(still.states[i], own.states[i]);
  }
}

/// The balls around points and shapes hold them, wherever the bodies are.
TEST(Candidates, LinksThatAreApartDoNotTouch) {
  const auto m = compile(bar_above_shapes());
  const kernels::LinkPair& links = m->link_pairs[0];
  EXPECT_LT(links.apart, 0.25) << "a ball of this scene's size";
  for (int i = links.first; i < links.first + links.count; ++i) {
    const kernels::PairContact& pair = m->pairs[std::size_t(m->pair_order[std::size_t(i)])];
    double of_points = 0;
    for (int k = 0; k < pair.n_points; ++k) {
      const kernels::Vec3<double> arm =
          kernels::Vec3<double>{pair.points[3 * k], pair.points[3 * k + 1],
                                pair.points[3 * k + 2]} -
          links.points_middle;
      of_points = std::max(of_points, std::sqrt(dot(arm, arm)));
    }
    // From outside the ball that is left for the shapes, no point of the surface is within.
    const double of_shapes = links.apart - of_points;
    testing::Random random(7);
    for (int k = 0; k < 1000; ++k) {
      const kernels::Vec3<double> to{random.normal(), random.normal(), random.normal()};
      const kernels::Vec3<double> at =
          links.shapes_middle + (of_shapes / std::sqrt(dot(to, to))) * to;
      kernels::with_distance<double>(pair.shape, pair.size, [&](const auto& shape) {
        EXPECT_GE(
            kernels::distance_at(shape, transposed_times(pair.frame2.R, at - pair.frame2.p)).d, 0);
      });
    }
  }
}

/// No ball holds a plane, a shape whose size differs between environments, or the far side of
/// chosen faces.
TEST(Candidates, LinksWithoutABallAreNeverApart) {
  const auto apart = [](const Scene& scene) { return compile(scene)->link_pairs.at(0).apart; };
  Scene scene = testing::rolling_ball(false, 8);
  EXPECT_LT(apart(scene), 1);
  scene.randomizations.push_back({{NumberOwner::body, NumberField::radius, "ball"},
                                  {Distribution::Kind::uniform, 0.5, 1, {}},
                                  {}});
  EXPECT_EQ(apart(scene), INFINITY);
  scene.randomizations.clear();
  scene.links[1].body.shape = PlaneShape{};
  scene.links[1].joint.type = JointType::fixed;
  scene.ground_contacts.clear();
  EXPECT_EQ(apart(scene), INFINITY);
  Scene faced = bar_above_shapes();
  faced.links[1] = faced.links[3];
  faced.links.resize(2);
  std::get<CuboidShape>(faced.links[0].body.shape).contact_resolution = {2, 2, 2};
  faced.pair_contacts = {{"middle", "table", {5e3, 5, 1, 20}, ContactLaw::clamped, 1e-5, {}}};
  EXPECT_TRUE(compile(faced)->view.faced);
  EXPECT_EQ(apart(faced), INFINITY);
}

/// The grid of a mesh is that of scale 1.
TEST(Candidates, TheBallAroundAMeshHasItsScale) {
  Scene scene = testing::rolling_ball(false, 8);
  scene.ground_contacts.clear();
  MeshShape cube = testing::cuboid_mesh({0.01, 0.01, 0.01});
  cube.resolution = 8;
  const auto apart = [&](double scale) {
    cube.scale = scale;
    scene.links[1].body.shape = cube;
    return compile(scene)->link_pairs.at(0).apart;
  };
  const double corner = 0.01 * std::sqrt(3.0), radius = (apart(3) - apart(1)) / 2;
  EXPECT_GE(radius, corner);
  EXPECT_LT(radius, 2 * corner);
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
  w.stage.x[2][3] = -2 * w.own_candidates.lists[0].margin;
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
