// SPDX-License-Identifier: Apache-2.0
// Tests bodies that sleep: when they fall asleep and wake, that results stay within the bound, and
// that bits depend neither on company nor on the order in which bodies fall asleep elsewhere.
#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "engine/derivative/adjoint.hpp"
#include "engine/derivative/tangent.hpp"
#include "kernels/table/kernel_table.hpp"
#include "tests/engine/random_scene.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::q_of;
using testing::v_of;

constexpr double kEdge = 0.04, kApart = 0.06;  // [m]
constexpr int kFinger = 0;                     // tree

/// A finger on three position motors, beside a row of boxes on the ground.
Scene finger_and_boxes(int boxes, double gravity = 9.8) {
  Scene s;
  s.integrator = Integrator::bdf1;
  s.timestep = 5e-3;
  s.gravity = {0, 0, -gravity};
  s.ground = GroundDescription{};
  s.links = {testing::link("finger", JointType::translational, {0, -0.08, 0.03},
                           CuboidShape{{0.02, 0.02, 0.05}, {3, 3, 5}}, 600)};
  MotorDescription motor{"finger_joint", -5, 5, {}};
  motor.control = MotorControl::position;
  motor.P = 200, motor.D = 10;
  s.motors.push_back(motor);
  const ContactCoefficients ground = {5e3, 5, 0.6, 100}, pair = {5e3, 5, 0.6, 1e3};
  for (int k = 0; k < boxes; ++k) {
    const std::string name = "box" + std::to_string(k);
    s.links.push_back(testing::link(name, JointType::free, {kApart * k, 0, kEdge / 2},
                                    CuboidShape{{kEdge, kEdge, kEdge}, {3, 3, 3}}, 600));
    s.ground_contacts.push_back({name, ground, ContactLaw::clamped, 1e-5, {}});
    s.pair_contacts.push_back({"finger", name, pair, ContactLaw::clamped, 1e-5, {}});
    if (k > 0)
      s.pair_contacts.push_back(
          {"box" + std::to_string(k - 1), name, pair, ContactLaw::clamped, 1e-5, {}});
    Distribution d;
    d.b = 1e-3;  // falls by up to a millimetre
    s.randomizations.push_back({{NumberOwner::joint, NumberField::q, name + "_joint", 2}, d, {}});
  }
  return s;
}

StepperOptions sleepy(double share = kUsualSleep) {
  StepperOptions o;
  o.sleep = share;
  return o;
}

bool sleeps(const Batch& batch, int tree, int environment = 0) {
  const SleepState& s = batch.sleep(environment);
  return !s.asleep.empty() && s.asleep[std::size_t(tree)] != 0;
}

/// Goes to and fro before the boxes; from step 300 on into box 2.
std::vector<double> path(int step) {
  if (step < 300) return {step / 100 % 2 == 0 ? 0.2 : 0.0, 0, 0};
  return {2 * kApart, std::min(0.1, 5e-4 * (step - 300)), 0};
}

/// Plays a path from step `first` on.
void play(Stepper& stepper, Batch& batch, int first, int last) {
  for (int k = first; k < last; ++k) testing::step_all(stepper, batch, path(k));
}

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double most = 0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
  return most;
}

/// Everything that is stored of one environment after a run.
struct Record {
  std::vector<double> q, v;
  std::vector<std::uint8_t> asleep;
  std::int64_t slept = 0;
  int evaluations = 0;
  bool operator==(const Record&) const = default;
};

TEST(Sleep, BoxesFallAsleepAndStayWhereTheyAre) {
  const Model model(finger_and_boxes(5));
  Stepper with(model, sleepy()), without(model);
  Batch batch(model, 1, 1), awake(model, 1, 1);
  play(with, batch, 0, 200);
  play(without, awake, 0, 200);
  const std::vector<double> slept = q_of(batch);
  EXPECT_EQ(batch.sleep(0).bodies, 5);
  EXPECT_FALSE(sleeps(batch, kFinger));
  const std::vector<double> v = v_of(batch);
  for (std::size_t i = 3; i < v.size(); ++i) EXPECT_EQ(v[i], 0) << i;
  play(with, batch, 200, 300);
  play(without, awake, 200, 300);
  const std::vector<double> later = q_of(batch);
  for (std::size_t i = 3; i < later.size(); ++i) EXPECT_EQ(later[i], slept[i]) << i;
  // A body is off by at most what it would have moved: share · size in 20 steps, for 10 times 20.
  EXPECT_LT(distance(q_of(batch), q_of(awake)), 10 * kUsualSleep * kEdge);
  EXPECT_EQ(batch.sleep(0).bodies, 5);
  EXPECT_GT(batch.sleep(0).slept, 5 * 200);
  EXPECT_EQ(batch.steps(0), 300);
}

TEST(Sleep, ATouchWakesOneBoxAndItMovesAsIfItHadNeverSlept) {
  for (const Integrator scheme : integrators()) {
    const Model model(finger_and_boxes(5));
    StepperOptions options = sleepy(), plain;
    options.integrator = plain.integrator = scheme;
    Stepper with(model, options), without(model, plain);
    Batch batch(model, 1, 1), awake(model, 1, 1);
    play(with, batch, 0, 300);
    play(without, awake, 0, 300);
    ASSERT_EQ(batch.sleep(0).bodies, 5) << to_string(scheme);
    play(with, batch, 300, 560);
    play(without, awake, 300, 560);
    EXPECT_EQ(batch.sleep(0).bodies, 4) << to_string(scheme);
    EXPECT_FALSE(sleeps(batch, 3)) << to_string(scheme);
    const std::vector<double> q = q_of(batch), expected = q_of(awake);
    EXPECT_GT(expected[3 + 2 * 7 + 1], 0.03) << to_string(scheme);  // box 2 was pushed
    EXPECT_LT(distance(q, expected), 2e-4) << to_string(scheme);
    EXPECT_FALSE(failed(batch.status(0)));
  }
}

/// A finger at 1.5 m/s covers 7.5 mm a step, far more than the margin of any contact.
TEST(Sleep, AFastBodyWakesWhatItHits) {
  const auto shoot = [&](Stepper& stepper, const Model& model) {
    Batch batch(model, 1, 1);
    play(stepper, batch, 0, 150);
    EXPECT_EQ(batch.sleep(0).bodies, stepper.sleep() > 0 ? 2 : 0);
    const auto go = [&](int steps, double from, double by) {
      for (int k = 0; k < steps; ++k) testing::step_all(stepper, batch, {0, from + k * by, 0});
    };
    go(100, -0.3, 0);
    go(60, -0.3, 7.5e-3);
    go(60, 0.15, 0);
    return q_of(batch);
  };
  const Model model(finger_and_boxes(2));
  Stepper with(model, sleepy()), without(model);
  const std::vector<double> q = shoot(with, model), expected = shoot(without, model);
  EXPECT_GT(std::abs(expected[3 + 1]), 0.02);  // box 0 was hit
  EXPECT_LT(distance(q, expected), 1e-3);
}

/// The finger sleeps 3 mm from a box, and then is driven so hard that it gets there in one step:
/// the step is taken again, with the box awake.
TEST(Sleep, ATouchWithinOneStepIsNotMissed) {
  const double gap = 3e-3, near = 0.08 - kEdge / 2 - 0.01 - gap;
  const Model model(finger_and_boxes(1));
  Stepper with(model, sleepy()), without(model);
  Batch batch(model, 1, 1), awake(model, 1, 1);
  for (int k = 0; k < 300; ++k) {
    testing::step_all(with, batch, {0, near, 0});
    testing::step_all(without, awake, {0, near, 0});
  }
  ASSERT_EQ(batch.sleep(0).bodies, 2);
  ASSERT_NE(batch.sleep(0).island[0], batch.sleep(0).island[1]);
  for (int k = 0; k < 3; ++k) {
    testing::step_all(with, batch, {0, 0.5, 0});
    testing::step_all(without, awake, {0, 0.5, 0});
    EXPECT_EQ(batch.sleep(0).bodies, 0) << k;
    EXPECT_GT(v_of(awake)[3 + 1], 0.1) << k;
    EXPECT_NEAR(v_of(batch)[3 + 1], v_of(awake)[3 + 1], 1e-2 * v_of(awake)[3 + 1]) << k;
  }
}

/// Parts of a model that are larger than a third of it are not worth their while in a group where
/// every lane has another.
TEST(Sleep, NobodySleepsWhileMoreThanAThirdIsAwake) {
  Scene s = finger_and_boxes(3);
  for (int k = 0; k < 3; ++k)
    s.motors.push_back({"box" + std::to_string(k) + "_joint", -0.01, 0.01, {}});
  const Model model(s);  // 3 + 18 dofs
  Stepper stepper(model, sleepy());
  Batch batch(model, 1, 1);
  const auto drive = [&](int boxes) {
    for (int k = 0; k < 200; ++k) {
      std::vector<double> u(std::size_t(model.nu()));
      for (int b = 0; b < boxes; ++b) u[std::size_t(3 + 6 * b)] = k % 2 == 0 ? 1 : -1;
      testing::step_all(stepper, batch, u);
    }
    return batch.sleep(0).bodies;
  };
  EXPECT_EQ(drive(2), 0);  // 12 dofs move
  EXPECT_EQ(drive(1), 3);  // 6 dofs
  EXPECT_EQ(drive(2), 0);
}

TEST(Sleep, AStackWakesWhole) {
  Scene s = finger_and_boxes(3);
  for (int k = 0; k < 3; ++k)
    s.links[std::size_t(k + 1)].joint.pose.position = {0.12, 0, kEdge * (k + 0.5)};
  s.ground_contacts.resize(1);  // the lowest alone
  s.randomizations.clear();
  const Model model(s);
  Stepper stepper(model, sleepy());
  Batch batch(model, 1, 1);
  play(stepper, batch, 0, 300);
  ASSERT_EQ(batch.sleep(0).bodies, 3);
  EXPECT_EQ(batch.sleep(0).island, (std::vector<int>{-1, 1, 1, 1}));
  int k = 300;
  while (batch.sleep(0).bodies == 3 && k < 500) play(stepper, batch, k, k + 1), ++k;
  EXPECT_EQ(batch.sleep(0).bodies, 0);  // all in one step
  EXPECT_LT(k, 450);
}

TEST(Sleep, ControlsResetsAndSettersWake) {
  Scene s = finger_and_boxes(3);
  s.motors.push_back({"box1_joint", -0.5, 0.5, {}});
  Distribution d;
  d.a = 0.5, d.b = 0.7;
  s.randomizations.push_back({{NumberOwner::ground, NumberField::mu, "box0"}, d, {}});
  const Model model(s);
  Stepper stepper(model, sleepy());
  Batch batch(model, 2, 1);
  std::vector<double> u(std::size_t(2 * model.nu()));
  const auto rest = [&] {
    for (int k = 0; k < 200; ++k) stepper.step(batch, u);
    ASSERT_EQ(batch.sleep(0).bodies, 4) << "the finger's target stands still, so it sleeps, too";
    ASSERT_EQ(batch.sleep(1).bodies, 4);
  };
  rest();
  u[3 + 1] = 0.9;  // environment 0: box 1 alone is driven
  stepper.step(batch, u);
  EXPECT_TRUE(sleeps(batch, 0, 0) && sleeps(batch, 1, 0) && !sleeps(batch, 2, 0));
  EXPECT_EQ(batch.sleep(1).bodies, 4);
  EXPECT_GT(v_of(batch)[3 + 6 + 1], 0);
  u[3 + 1] = 0;
  rest();
  batch.set_state(0, q_of(batch), v_of(batch));
  EXPECT_EQ(batch.sleep(0).bodies, 0);
  EXPECT_EQ(batch.sleep(1).bodies, 4);
  rest();
  batch.set_randomized_value(0, 3, 0.65);
  EXPECT_EQ(batch.sleep(0).bodies, 0);
  rest();
  batch.reset(0, 0);
  EXPECT_EQ(batch.sleep(0).bodies, 0);
  EXPECT_EQ(batch.sleep(0).slept, 0);
  EXPECT_GT(batch.sleep(1).slept, 0);
  batch.hold(1);
  const std::int64_t before = batch.sleep(1).slept;
  rest();
  EXPECT_EQ(batch.sleep(1).slept, before);
  Stepper(model).step(batch, u);  // it knows no sleep
  EXPECT_EQ(batch.sleep(0).bodies, 0);
}

TEST(Sleep, WhatIsInTheAirOrOnTheMoveStaysAwake) {
  Scene s = finger_and_boxes(1);
  const Model model(s);
  Stepper stepper(model, sleepy());
  Batch batch(model, 1, 1);
  std::vector<double> q = q_of(batch), v = v_of(batch);
  v[3 + 2] = 1.5;  // flies for 0.3 s
  batch.set_state(0, q, v);
  for (int k = 0; k < 60; ++k) {
    testing::step_all(stepper, batch, {0, 0, 0});
    EXPECT_FALSE(sleeps(batch, 1)) << k;
  }
}

/// Viscous friction lets a box creep down a slope at a constant speed, which sleep ends.
TEST(Sleep, ABodyIsOffByNoMoreThanTheBound) {
  Scene s = finger_and_boxes(1);
  s.gravity[1] = -2e-3;  // the ground resists with 5 N s/m a point that touches, of 9
  const Model model(s);
  Stepper without(model);
  Batch awake(model, 1, 1);
  constexpr int kSteps = 600;
  std::vector<double> before;
  for (int k = 0; k < kSteps; ++k) {
    if (k == 100) before = q_of(awake);
    testing::step_all(without, awake, {0, 0, 0});
  }
  const double creep = std::abs(q_of(awake)[4] - before[4]) / (kSteps - 100);  // [m] a step
  EXPECT_GT(creep, 1e-9);
  // How far a step at rest may go: share · size / n, by a measure that at most doubles a slide.
  const double size = kEdge / 2 * std::sqrt(3.0);
  const double n = std::max(20.0, std::ceil(2 * std::sqrt(size / 9.8) / s.timestep));
  for (const double times : {0.5, 4.0}) {
    const double share = times * creep * n / size;
    Stepper with(model, sleepy(share));
    Batch batch(model, 1, 1);
    for (int k = 0; k < kSteps; ++k) testing::step_all(with, batch, {0, 0, 0});
    EXPECT_EQ(sleeps(batch, 1), times > 1);
    const double off = distance(q_of(batch), q_of(awake));
    EXPECT_LE(off, kSteps / n * share * size);
    if (times > 1) {
      EXPECT_GT(off, 0.5 * creep * (kSteps - 100));
    }
  }
}

/// Trees of random joints, with spheres and cuboids in contact, that damping brings to rest.
TEST(Sleep, RandomMachinesHaveTheSameBitsAloneAndInAGroup) {
  int slept = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    Scene scene =
        testing::random_contacts(seed, 3 + static_cast<int>(seed % 4), ContactLaw::clamped);
    for (LinkDescription& link : scene.links) link.joint.damping = 500;
    const Model model(scene);
    const auto run_of = [&](int environments, int wanted) {
      Batch batch(model, environments);
      Stepper stepper(model, sleepy(0.2));
      for (int e = 0; e < environments; ++e) {
        std::vector<double> v = v_of(batch, e);
        testing::Random random(1000 * seed + static_cast<unsigned>(e == wanted ? 3 : 100 + e));
        for (double& x : v) x = 0.02 * random.normal();
        batch.set_state(e, q_of(batch, e), v);
      }
      const std::vector<double> u(std::size_t(environments * model.nu()));
      Record r;
      for (int k = 0; k < 150; ++k) {
        stepper.step(batch, u);
        r.evaluations += batch.iterations(wanted);
      }
      r.q = q_of(batch, wanted);
      r.v = v_of(batch, wanted);
      r.asleep = batch.sleep(wanted).asleep;
      r.slept = batch.sleep(wanted).slept;
      return r;
    };
    const Record alone = run_of(1, 0);
    EXPECT_EQ(alone, run_of(8, 5)) << "seed " << seed;
    EXPECT_EQ(alone, run_of(17, 2)) << "seed " << seed;
    slept += alone.slept > 0 ? 1 : 0;
  }
  EXPECT_GT(slept, 3);
}

TEST(Sleep, WithNobodyAsleepTheBitsAreThoseWithoutSleep) {
  const Model model(testing::rolling_ball(false, 24));
  Stepper with(model, sleepy()), without(model);
  Batch batch(model, 9, 3), awake(model, 9, 3);
  for (int e = 0; e < 9; ++e) {  // a ball that rolls
    const std::vector<double> q = q_of(batch, e);
    std::vector<double> v = v_of(batch, e);
    v[3] = 0.1 + 0.01 * e;
    v[7] = v[3] / 0.02;
    batch.set_state(e, q, v);
    awake.set_state(e, q, v);
  }
  for (int k = 0; k < 300; ++k) {
    testing::step_all(with, batch, testing::rolling_ball_control(k));
    testing::step_all(without, awake, testing::rolling_ball_control(k));
    ASSERT_EQ(batch.sleep(0).bodies, 0) << k;
  }
  for (int e = 0; e < 9; ++e) {
    EXPECT_EQ(q_of(batch, e), q_of(awake, e));
    EXPECT_EQ(v_of(batch, e), v_of(awake, e));
  }
}

Record run(const Model& model, const StepperOptions& options, int environments, int wanted,
           int steps = 420, bool crash = false) {
  Stepper stepper(model, options);
  Batch batch(model, environments, 7, 20 - wanted);
  Record r;
  for (int k = 0; k < steps; ++k) {
    if (crash && k == 70)
      for (int e = 0; e < environments; ++e) {
        if (e == wanted) continue;
        std::vector<double> q = q_of(batch, e), v = v_of(batch, e);
        if (e % 3 == 0) q[4] = std::nan("");
        if (e % 3 == 1) v[5] = 30;
        batch.set_state(e, q, v);
      }
    // Environments are 7 steps apart, so that they fall asleep and wake one after another.
    std::vector<double> u;
    for (int e = 0; e < environments; ++e) {
      const std::vector<double> one = path(k + 7 * (e - wanted));
      u.insert(u.end(), one.begin(), one.end());
    }
    stepper.step(batch, u);
    r.evaluations += batch.iterations(wanted);
  }
  r.q = q_of(batch, wanted);
  r.v = v_of(batch, wanted);
  r.asleep = batch.sleep(wanted).asleep;
  r.slept = batch.sleep(wanted).slept;
  return r;
}

TEST(Sleep, AnEnvironmentHasTheSameBitsInEveryBatchAndLaneOnEveryInstructionSet) {
  const Model model(finger_and_boxes(4));
  const kernels::KernelTable& before = kernels::active_kernels();
  for (const kernels::KernelTable* table : kernels::available_kernels()) {
    kernels::use_kernels(*table);
    for (const Integrator scheme : {Integrator::bdf1, Integrator::bdf2}) {
      StepperOptions options = sleepy();
      options.integrator = scheme;
      const Record alone = run(model, options, 1, 0);
      EXPECT_GT(alone.slept, 0) << table->name;
      EXPECT_EQ(alone, run(model, options, 7, 5)) << table->name;
      EXPECT_EQ(alone, run(model, options, 16, 9)) << table->name;
      EXPECT_EQ(alone, run(model, options, 21, 3)) << table->name;
      EXPECT_EQ(alone, run(model, options, 16, 4, 420, true)) << table->name;
    }
  }
  kernels::use_kernels(before);
}

TEST(Sleep, ThreadsDoNotMatter) {
  const Model model(finger_and_boxes(3));
  const auto play_all = [&](int threads) {
    Batch batch(model, 64, 5);
    std::vector<std::thread> running;
    for (int t = 0; t < threads; ++t)
      running.emplace_back([&, t] {
        Stepper stepper(model, sleepy());
        std::vector<double> u;
        for (int k = 0; k < 350; ++k) {
          u.clear();
          for (int e = 0; e < 64; ++e) {
            const std::vector<double> one = path(k + e);
            u.insert(u.end(), one.begin(), one.end());
          }
          for (int b = t; b < batch.blocks(); b += threads) stepper.step_block(batch, b, u);
        }
      });
    for (std::thread& thread : running) thread.join();
    return std::vector(batch.block(0),
                       batch.block(batch.blocks() - 1) + (batch.block(1) - batch.block(0)));
  };
  EXPECT_EQ(play_all(1), play_all(3));
}

TEST(Sleep, ABlockIsSavedAndRestoredWithWhoSleeps) {
  const Model model(finger_and_boxes(3));
  Stepper stepper(model, sleepy());
  Batch batch(model, 3, 1);
  play(stepper, batch, 0, 250);
  const BlockState saved = batch.save_block(0);
  const Batch copy = batch;
  play(stepper, batch, 250, 420);
  const std::vector<double> went = q_of(batch, 2);
  batch.restore_block(0, saved);
  EXPECT_EQ(batch.sleep(2).bodies, 3);
  play(stepper, batch, 250, 420);
  EXPECT_EQ(q_of(batch, 2), went);
  batch = copy;
  play(stepper, batch, 250, 420);
  EXPECT_EQ(q_of(batch, 2), went);
}

TEST(Sleep, StepsThatKeepAnAccuracySleep) {
  const Model model(finger_and_boxes(4));
  StepperOptions options = sleepy();
  options.accuracy = 1e-2;
  Stepper stepper(model, options);
  Batch batch(model, 1, 1);
  for (int k = 0; k < 600; ++k)  // looser solves take longer to come to rest
    testing::step_all(stepper, batch, path(k % 300));
  EXPECT_EQ(batch.sleep(0).bodies, 4);
  play(stepper, batch, 300, 560);
  EXPECT_EQ(batch.sleep(0).bodies, 3);
  const Record alone = run(model, options, 1, 0, 330);
  EXPECT_GT(alone.slept, 0);
  EXPECT_EQ(alone, run(model, options, 9, 6, 330));
}

/// Lanes that all sleep take steps for nothing.
TEST(Sleep, WhereAllSleepTimeGoesOn) {
  Scene s = finger_and_boxes(2);
  const Model model(s);
  Stepper stepper(model, sleepy());
  Batch batch(model, 10, 1);
  for (int k = 0; k < 300; ++k) testing::step_all(stepper, batch, {0, 0, 0});
  for (int e = 0; e < 10; ++e) {
    EXPECT_EQ(batch.sleep(e).bodies, 3);
    EXPECT_EQ(batch.iterations(e), 0);
    EXPECT_EQ(batch.steps(e), 300);
    EXPECT_EQ(batch.status(e), StepStatus::converged);
  }
  std::vector<double> u(30, 0.0);
  u[3 * 4 + 1] = std::nan("");
  stepper.step(batch, u);
  EXPECT_EQ(batch.status(4), StepStatus::non_finite);
  EXPECT_EQ(batch.status(5), StepStatus::converged);
}

template <class F>
std::string refusal(const F& f) {
  try {
    f();
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Sleep, DerivativesAndMemoryAreRefused) {
  Scene s = finger_and_boxes(1);
  const Model model(s);
  const std::string no = "a body that sleeps has no derivatives";
  EXPECT_NE(refusal([&] { Adjoint(model, sleepy()); }).find(no), std::string::npos);
  EXPECT_NE(refusal([&] { Tangent(model, sleepy()); }).find(no), std::string::npos);
  EXPECT_NE(refusal([&] { Stepper(model, differentiable(sleepy())); }).find(no), std::string::npos);
  EXPECT_EQ(refusal([&] { Stepper(model, differentiable(sleepy(0))); }), "");
  Stepper stepper(model, sleepy());
  Batch batch(model, 1);
  BlockTape tape(model, Integrator::bdf1, 1);
  EXPECT_NE(refusal([&] { stepper.step_block(batch, 0, std::vector<double>(3), &tape); }).find(no),
            std::string::npos);
  for (const double wrong : {-0.1, 1.0, std::nan("")})
    EXPECT_NE(refusal([&] { Stepper(model, sleepy(wrong)); }).find("below 1"), std::string::npos);
  s.ground_contacts[0].coefficients.ks = 100;
  EXPECT_NE(refusal([&] { Stepper(Model(s), sleepy()); }).find("ks"), std::string::npos);
}

}  // namespace
}  // namespace tangere
