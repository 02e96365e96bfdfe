// SPDX-License-Identifier: Apache-2.0
// Compares with the published simulator's rolling ball: fields at its states, its states in our
// residual, its trajectory.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "engine/sense/readout.hpp"
#include "engine/step/rotation_log.hpp"
#include "engine/step/stepper.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/engine/stage_buffers.hpp"

namespace tangere {
namespace {

using kernels::Quat;
using kernels::Vec3;
using Table = std::vector<std::vector<double>>;

Table read(const std::string& name) {
  const std::string path = std::string(TANGERE_TEST_DATA) + "/rolling_ball/" + name;
  std::ifstream file(path);
  EXPECT_TRUE(file) << path << " is missing";
  Table rows;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::stringstream cells(line);
    rows.emplace_back();
    for (std::string cell; std::getline(cells, cell, ',');) rows.back().push_back(std::stod(cell));
  }
  return rows;
}

class Reference : public ::testing::Test {
 protected:
  Model model{testing::rolling_ball(true)};
  Table u = read("u.csv"), q = read("q_tight.csv"), rate = read("qdot_tight.csv");

  /// Converts their coordinates to ours: rotation vector to quaternion, and ṙ to the body's angular
  /// velocity ω = J_r(r) ṙ.
  void state(std::size_t row, std::vector<double>& our_q, std::vector<double>& our_v) const {
    our_q.assign(10, 0);
    our_v.assign(9, 0);
    for (std::size_t i = 0; i < 6; ++i) our_q[i] = q[row][i], our_v[i] = rate[row][i];
    // Their rotation vector grows without bound; the quaternion exponential's series is for |r| ≤
    // 2π and exact there.
    const Vec3<double> r = {q[row][6], q[row][7], q[row][8]},
                       w = {rate[row][6], rate[row][7], rate[row][8]};
    ASSERT_LT(dot(r, r), 39.0);
    const Quat<double> turn = kernels::quaternion_exp(r);
    our_q[6] = turn.w, our_q[7] = turn.x, our_q[8] = turn.y, our_q[9] = turn.z;
    const double t = std::sqrt(dot(r, r));
    const double b = t > 1e-3 ? (1 - std::cos(t)) / (t * t) : 0.5 - t * t / 24;
    const double c = t > 1e-3 ? (t - std::sin(t)) / (t * t * t) : 1.0 / 6 - t * t / 120;
    const Vec3<double> x = cross(r, w), xx = cross(r, x);
    const Vec3<double> omega = w - b * x + c * xx;
    our_v[6] = omega.x, our_v[7] = omega.y, our_v[8] = omega.z;
  }
};

TEST_F(Reference, TactileFieldsAtItsStatesAgreeToRounding) {
  const Table fields = read("tactile_tight.csv"), points = read("tactile_points.csv"),
              sums = read("tactile_sums_tight.csv");
  ASSERT_EQ(fields.size(), 70U);
  ASSERT_EQ(points.size(), 400U);
  Batch batch(model, 1);
  Readout readout(model);
  std::vector<double> our_q, our_v, force(3 * 40000);
  double worst = 0, peak = 0;
  for (std::size_t k = 0; k < fields.size(); ++k) {
    const std::size_t row = std::size_t(fields[k][0]) + 1;
    state(row, our_q, our_v);
    batch.set_state(0, our_q, our_v);
    readout.tactile(batch, 0, 0, force);
    for (std::size_t p = 0; p < points.size(); ++p)
      for (std::size_t c = 0; c < 3; ++c) {
        const double theirs = fields[k][1 + 3 * p + c];
        worst = std::max(worst, std::abs(force[3 * std::size_t(points[p][0]) + c] - theirs));
        peak = std::max(peak, std::abs(theirs));
      }
    double squares = 0, nonzero = 0;
    for (std::size_t p = 0; p < 40000; ++p) {
      const double n = force[3 * p] * force[3 * p] + force[3 * p + 1] * force[3 * p + 1] +
                       force[3 * p + 2] * force[3 * p + 2];
      squares += n;
      nonzero += n > 0;
    }
    EXPECT_NEAR(squares, sums[k][4], 1e-8 * sums[k][4]) << "field " << k;
    EXPECT_EQ(nonzero, sums[k][5]) << "field " << k;
  }
  EXPECT_GT(peak, 1e-3);
  EXPECT_LT(worst, 1e-15 * 1e2 * peak);
}

/// Puts their row t + 1 into our BDF2 residual, with the rotation chart centred on row t. Uses
/// planar rows only, because both charts coincide there.
TEST_F(Reference, ItsStatesSolveOurResidual) {
  const CompiledModel& m = compiled(model);
  testing::StageBuffers<double> b(m);
  const double h = m.scene.timestep;
  std::vector<double> before_q, before_v, now_q, now_v, next_q, next_v;
  int stick_only = 0, slipping = 0;
  double worst_stick = 0, worst_other = 0, worst_switched = 0;
  for (std::size_t t = 1; t < 200; ++t) {
    state(t - 1, before_q, before_v);
    state(t, now_q, now_v);
    state(t + 1, next_q, next_v);
    const auto quat = [](const std::vector<double>& x) {
      return Quat<double>{x[6], x[7], x[8], x[9]};
    };
    const Vec3<double> turn = rotation_log(conjugate(quat(now_q)) * quat(next_q));
    const Vec3<double> history = rotation_log(conjugate(quat(now_q)) * quat(before_q));
    const double turns[3] = {turn.x, turn.y, turn.z},
                 histories[3] = {history.x, history.y, history.z};
    for (std::size_t i = 0; i < 10; ++i) b.centre[i] = now_q[i];
    for (std::size_t i = 0; i < 9; ++i) {
      b.x[i] = i < 6 ? next_q[i] - now_q[i] : turns[i - 6];
      b.r[i] = 0.5 * (i < 6 ? before_q[i] - now_q[i] : histories[i - 6]);
      b.s[i] = 0.5 * before_v[i] - 2 * now_v[i];
      b.tau[i] = i < 3 ? u[t][i] : 0;
    }
    b.residual(1.5 / h, 1 / h);
    // The friction bounds differ only at slipping points (theirs uses the norm of a 6-D wrench).
    const kernels::PairContact& pair = m.pairs[0];
    bool slips = false;
    const kernels::Mat3<double> turned = to_matrix(quat(next_q));
    const kernels::Frame<double> pad = {kernels::diagonal(1.0),
                                        {next_q[0], next_q[1], 0.06 + next_q[2]}};
    const Vec3<double> centre = Vec3<double>{next_q[3], next_q[4], 0.02 + next_q[5]} - pad.p;
    const Vec3<double> omega = turned * Vec3<double>{next_v[6], next_v[7], next_v[8]};
    const Vec3<double> relative = Vec3<double>{next_v[3], next_v[4], next_v[5]} -
                                  Vec3<double>{next_v[0], next_v[1], next_v[2]};
    const kernels::LawParameters<double> law = {{5, 1, 1, 1}, ContactLaw::paper, 0};
    std::vector<double> theirs = b.g;
    for (int k = 0; k < pair.n_points; ++k) {
      const Vec3<double> xi = {pair.points[3 * k], pair.points[3 * k + 1], pair.points[3 * k + 2]};
      const auto p =
          point_contact(kernels::SphereDistance<double>{pair.size.x}, law, kernels::diagonal(1.0),
                        centre, omega, relative - cross(omega, centre), xi);
      if (!(p.d < 0)) continue;
      slips = slips || p.tangential.slip > 0;
      // Their bound takes the norm of the normal wrench at the pad's origin, torque included.
      // Nothing else differs here: the pad does not turn, so the points of velocity and of force
      // make no difference to any dof.
      const Vec3<double> arm = cross(xi, p.n);
      const double speed = std::sqrt(dot(p.vt, p.vt)),
                   bound = law.mu * std::sqrt(1 + dot(arm, arm)) * p.normal.bound;
      const double scale = law.kt * speed > bound ? bound / speed : law.kt;
      const Vec3<double> more =
          (p.tangential.scale - scale) * p.vt;  // their force on the pad minus ours
      const Vec3<double> torque = transposed_times(turned, cross(p.x2 - centre, more));
      const double change[9] = {-more.x, -more.y,  -more.z,  more.x,  more.y,
                                more.z,  torque.x, torque.y, torque.z};
      for (std::size_t i = 0; i < 9; ++i) theirs[i] += change[i];
    }
    for (double g : theirs) worst_switched = std::max(worst_switched, std::abs(g));
    double worst = 0;
    for (std::size_t i = 0; i < 9; ++i) worst = std::max(worst, std::abs(b.g[i]));
    if (slips) {
      ++slipping;
      worst_other = std::max(worst_other, worst);
    } else {
      ++stick_only;
      worst_stick = std::max(worst_stick, worst);
    }
  }
  EXPECT_GT(stick_only, 50);
  EXPECT_GT(slipping, 50);
  EXPECT_LT(worst_stick, 1e-9) << "of " << stick_only << " steps without slip";
  EXPECT_LT(worst_other, 1e-6) << "of " << slipping << " steps with slip";
  EXPECT_LT(worst_switched, 1e-8) << "with the published friction bound";
}

TEST_F(Reference, FirstStepIsTheSameSdirkStep) {
  StepperOptions o;
  o.tolerance = 1e-12;
  Stepper stepper(model, o);
  Batch batch(model, 1);
  stepper.step(batch, u[0]);
  std::vector<double> our_q(10);
  batch.get_q(0, our_q);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_NEAR(our_q[i], q[1][i], 1e-16);
}

TEST_F(Reference, PlanarTrajectoryAgreesWithinTheFrictionDifference) {
  // The bounds differ by √(1 + |x × n|²) - 1 ≤ 3e-4 of a slipping point's friction (|x| ≤ 25 mm),
  // and at most a few points slip at a time. If 0.2 N acted this way for 0.6 s on 25 g with damping
  // 1 N s/m, the pad would move by under 1e-5 m. The measured distance is far less, because slip is
  // rare.
  StepperOptions o;
  o.tolerance = 1e-12;
  Stepper stepper(model, o);
  Batch batch(model, 1);
  std::vector<double> our_q(10);
  double worst = 0;
  for (std::size_t t = 0; t < 200; ++t) {
    stepper.step(batch, u[t]);
    ASSERT_FALSE(failed(batch.status(0))) << "step " << t;
    batch.get_q(0, our_q);
    for (std::size_t i = 0; i < 6; ++i) worst = std::max(worst, std::abs(our_q[i] - q[t + 1][i]));
  }
  EXPECT_LT(worst, 1e-6);
}

TEST_F(Reference, LaterRowsDifferByNoMoreThanOurStepSize) {
  // From row 200 on the charts differ, and so do the two discretisations. The bound is the change
  // of our own answer when h is halved.
  const auto run = [&](int refine) {
    StepperOptions o;
    o.tolerance = 1e-11;
    o.timestep = model.timestep() / refine;
    Stepper stepper(model, o);
    Batch batch(model, 1);
    std::vector<std::vector<double>> rows;
    for (std::size_t t = 0; t < 350; ++t) {
      for (int k = 0; k < refine; ++k) stepper.step(batch, u[t]);
      rows.emplace_back(10);
      batch.get_q(0, rows.back());
    }
    EXPECT_EQ(batch.failed_count(), 0);
    return rows;
  };
  const auto coarse = run(1), fine = run(2);
  for (std::size_t i = 0; i < 6; ++i) {
    double refinement = 0, difference = 0;
    for (std::size_t t = 200; t < 350; ++t) {
      refinement = std::max(refinement, std::abs(coarse[t][i] - fine[t][i]));
      difference = std::max(difference, std::abs(coarse[t][i] - q[t + 1][i]));
    }
    EXPECT_LT(difference, refinement + 1e-9) << "coordinate " << i;
  }
}

}  // namespace
}  // namespace tangere
