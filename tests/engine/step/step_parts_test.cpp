// SPDX-License-Identifier: Apache-2.0
// Tests steps that are cut into parts: errors follow the accuracy, parts are short only where they
// must be, bits do not depend on company, and what was missed is said.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"

namespace tangere {
namespace {

using testing::q_of;
using testing::v_of;

constexpr double kLong = 25e-3;  // five of the scene's own steps, whose controls last longer

StepperOptions keeping(double accuracy, double timestep = kLong) {
  return {.integrator = {}, .timestep = timestep, .tolerance = {}, .accuracy = accuracy};
}

struct Played {
  std::vector<double> q, v;
  std::vector<double> way;  ///< the ball's places every 25 ms [m]
  int evaluations = 0, coarse = 0;
};

/// Plays 1.5 s of the rolling ball and records one environment among others.
Played play(const Model& model, const StepperOptions& options, int environments = 1,
            int wanted = 0) {
  Stepper stepper(model, options);
  Batch batch(model, environments, 3, 20 - wanted);
  Played run;
  const int steps = static_cast<int>(std::lround(kLong / stepper.timestep()));
  for (int k = 0; k < 300; k += 5) {
    for (int part = 0; part < steps; ++part) {
      testing::step_all(stepper, batch, testing::rolling_ball_control(k));
      run.evaluations += batch.iterations(wanted);
      run.coarse += batch.status(wanted) == StepStatus::accuracy_not_met ? 1 : 0;
      EXPECT_FALSE(failed(batch.status(wanted)));
    }
    const std::vector<double> q = q_of(batch, wanted);
    run.way.insert(run.way.end(), q.begin() + 3, q.begin() + 6);
  }
  run.q = q_of(batch, wanted);
  run.v = v_of(batch, wanted);
  return run;
}

/// Root mean square distance of the ball's places [m].
double distance(const Played& a, const Played& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.way.size(); ++i)
    sum += (a.way[i] - b.way[i]) * (a.way[i] - b.way[i]);
  return std::sqrt(sum / (static_cast<double>(a.way.size()) / 3));
}

TEST(StepParts, ErrorsAndCostFollowTheAccuracy) {
  const Model model(testing::rolling_ball(false, 24));
  const Played exact = play(model, testing::options(Integrator::sdirk4, 6.25e-4, 1e-12));
  double last = HUGE_VAL;
  int cost = 0;
  for (const double accuracy : {1e-1, 1e-2, 1e-3, 1e-4}) {
    const Played run = play(model, keeping(accuracy));
    const double error = distance(run, exact) / 0.02;  // of the ball's radius
    EXPECT_LT(error, 1.01 * last) << accuracy << ": whole steps may do for two of them";
    EXPECT_LT(error, 0.1 * accuracy);
    EXPECT_GT(run.evaluations, cost);
    last = error, cost = run.evaluations;
  }
}

/// SDIRK2 is exact in free fall, so nothing is cut before the touch.
TEST(StepParts, AreShortWhereTheyMustBe) {
  Scene scene;
  scene.ground = GroundDescription{};
  scene.timestep = 0.01;
  scene.integrator = Integrator::sdirk2;
  scene.links = {testing::link("ball", JointType::free, {0, 0, 0.15}, SphereShape{0.05}, 1000)};
  scene.ground_contacts.push_back({"ball", {1e4, 1, 0.5, 10}, ContactLaw::linear, 1e-5, {}});
  const Model model(scene);
  Stepper stepper(model, keeping(1e-3, 0.01));
  Batch batch(model, 1);
  int falling = 0, touching = 0;
  for (int k = 0; k < 20; ++k) {
    stepper.step(batch, {});
    (k < 13 ? falling : touching) = std::max(k < 13 ? falling : touching, batch.iterations(0));
  }
  EXPECT_LE(falling, 8) << "two stages and the estimate";
  EXPECT_GT(touching, 4 * falling) << "it touches after 0.143 s";
}

TEST(StepParts, BitsDoNotDependOnCompany) {
  Scene scene = testing::rolling_ball(false, 24);
  Distribution d;
  d.a = -3e-3, d.b = 3e-3;
  scene.randomizations.push_back({{NumberOwner::joint, NumberField::q, "ball_joint", 0}, d, {}});
  const Model model(scene);
  const Played alone = play(model, keeping(1e-3));
  for (const int environments : {2, 8, 13}) {
    const Played among = play(model, keeping(1e-3), environments, environments - 1);
    EXPECT_EQ(alone.q, among.q) << environments;
    EXPECT_EQ(alone.v, among.v);
    EXPECT_EQ(alone.evaluations, among.evaluations);
  }
}

TEST(StepParts, SayWhatTheyMissed) {
  const Model model(testing::rolling_ball(false, 24));
  EXPECT_EQ(play(model, keeping(1e-2)).coarse, 0);
  EXPECT_GT(play(model, keeping(1e-9, 5e-3)).coarse, 0);
}

/// A step of one part has the bits of a plain one.
TEST(StepParts, OnePartIsAPlainStep) {
  const Model model(testing::rolling_ball(false, 24));
  StepperOptions plain = testing::options(Integrator::sdirk2, 1e-3, 1e-6), cut = plain;
  cut.accuracy = 0.999;
  const Played a = play(model, plain), b = play(model, cut);
  EXPECT_EQ(a.q, b.q);
  EXPECT_EQ(a.v, b.v);
}

TEST(StepParts, SchemeThatKeepsAnAccuracy) {
  Scene scene = testing::rolling_ball(false, 4);
  for (const Integrator low : {Integrator::bdf1, Integrator::bdf2}) {
    scene.integrator = low;
    EXPECT_EQ(Stepper(Model(scene), keeping(1e-2)).integrator(), Integrator::sdirk3);
    EXPECT_EQ(Stepper(Model(scene), keeping(0)).integrator(), low);
    scene.solver.accuracy = 1e-2;
    EXPECT_EQ(Model(scene).integrator(), Integrator::sdirk3);
    scene.solver.accuracy.reset();
  }
  scene.integrator = Integrator::sdirk3;
  EXPECT_EQ(Stepper(Model(scene), keeping(1e-2)).integrator(), Integrator::sdirk3);
  StepperOptions asked = keeping(1e-2);
  asked.integrator = Integrator::bdf1;
  EXPECT_EQ(Stepper(Model(scene), asked).integrator(), Integrator::bdf1);
  asked.integrator = Integrator::bdf2;
  EXPECT_THROW(Stepper(Model(scene), asked), InputError) << "it has no estimate";
  for (const double none : {-1e-3, 1.0, std::nan("")})
    EXPECT_THROW(Stepper(Model(scene), keeping(none)), InputError) << none;
}

/// A yardstick of Drake's CENIC: a ball of 0.1 m that rolls at 0.8 m/s goes 0.8 m in a second.
/// Sends a joint at 1 m/s against something of 1e4 N/m that takes 3 ms to throw it back. Steps are
/// 5 ms long, so one begins in the touch while all of its stages lie beyond.
double speed_thrown_back(Scene scene, int dof) {
  scene.gravity = {0, 0, 0};
  scene.solver.bounded_energy = false;
  const Model model(scene);
  Stepper stepper(model, keeping(1e-3, 5e-3));
  Batch batch(model, 1);
  std::vector<double> v(std::size_t(model.nv()));
  v[std::size_t(dof)] = -1;
  batch.set_state(0, q_of(batch), v);
  for (int k = 0; k < 4; ++k) stepper.step(batch, {});
  EXPECT_EQ(batch.status(0), StepStatus::converged);
  return v_of(batch)[std::size_t(dof)];
}

TEST(StepParts, NoticeAReleaseThatNoStageSees) {
  Scene ball;
  ball.integrator = Integrator::sdirk2;
  ball.ground = GroundDescription{};
  ball.links = {testing::link("ball", JointType::translational, {0, 0, 0.0123}, SphereShape{0.01},
                              2387.3241)};  // 10 g
  ball.ground_contacts.push_back({"ball", {1e4, 0, 0, 0}, ContactLaw::linear, 1e-5, {}});
  EXPECT_NEAR(speed_thrown_back(ball, 2), 1, 1e-3);
  Scene slide;
  slide.integrator = Integrator::sdirk2;
  slide.links = {
      testing::link("slide", JointType::prismatic, {0, 0, 0}, SphereShape{0.01}, 2387.3241)};
  slide.links[0].joint.limits = {-0.0023, 1};
  slide.links[0].joint.limit_stiffness = 1e4;
  EXPECT_NEAR(speed_thrown_back(slide, 0), 1, 1e-3);
}

enum class Push { ground, limit };

/// The error of the velocity with which a ball leaves the ground or the limit of its joint, which
/// lets it go `after` into a step of 5 ms. Its stages see some of the push.
double error_of_release(Push push, const Integrator& scheme, double accuracy, double after) {
  constexpr double kMass = 0.01, kRadius = 0.01, kStiffness = 400, kGravity = 9.8, kStep = 5e-3;
  Scene scene;
  scene.integrator = scheme;
  const double density = kMass / (4.0 / 3 * M_PI * 1e-6);
  scene.links = {
      testing::link("ball", JointType::prismatic, {0, 0, kRadius}, SphereShape{kRadius}, density)};
  scene.links[0].joint.axis0 = {0, 0, 1};
  if (push == Push::ground) {
    scene.ground = GroundDescription{};
    scene.ground_contacts.push_back({"ball", {kStiffness, 0, 0, 0}, ContactLaw::linear, 1e-5, {}});
  } else {
    scene.links[0].joint.limits = {0, 1};
    scene.links[0].joint.limit_stiffness = kStiffness;
  }
  const Model model(scene);
  Stepper stepper(model, keeping(accuracy, kStep));
  Batch batch(model, 1);
  // z = -rest + a sin ωt + rest cos ωt is zero with the velocity `speed` at t = 0, where it leaves.
  constexpr double kSpeed = 0.3, kRest = kMass * kGravity / kStiffness;
  const double rate = std::sqrt(kStiffness / kMass), a = kSpeed / rate, angle = rate * -after;
  const double z = -kRest + a * std::sin(angle) + kRest * std::cos(angle);
  const double v = rate * (a * std::cos(angle) - kRest * std::sin(angle));
  batch.set_state(0, std::vector<double>{z}, std::vector<double>{v});
  stepper.step(batch, {});
  EXPECT_EQ(batch.status(0), StepStatus::converged);
  return std::abs(v_of(batch)[0] - (kSpeed - kGravity * (kStep - after))) / kSpeed;
}

TEST(StepParts, KeepTheMomentumOfAReleaseThatStagesSee) {
  for (const Push push : {Push::ground, Push::limit})
    for (const Integrator scheme : {Integrator::sdirk2, Integrator::sdirk3})
      for (const double accuracy : {1e-2, 1e-3})
        for (int k = 1; k < 20; ++k)
          EXPECT_LT(error_of_release(push, scheme, accuracy, k * 0.25e-3), 2 * accuracy)
              << static_cast<int>(push) << ", " << accuracy << ", after " << k << " twentieths";
}

TEST(StepParts, NoticeThemWithAFactorToo) {
  // With gravity the first guess of a stage is no root, so there is a factor. It says that what was
  // left behind is far away.
  const auto energy_kept = [](Scene scene, int dof, double drop, double period,
                              const auto& energy) {
    for (const double accuracy : {1e-3, 1e-4, 1e-5})
      for (const double step : {2e-3, 4e-3, 1e-2}) {
        const Model model(scene);
        Stepper stepper(model, keeping(accuracy, step));
        Batch batch(model, 1);
        const double before = energy(q_of(batch)[std::size_t(dof)], 0.0);
        for (int k = 0; k * step < 6 * period; ++k) stepper.step(batch, {});
        const double after = energy(q_of(batch)[std::size_t(dof)], v_of(batch)[std::size_t(dof)]);
        EXPECT_NEAR(after, before, 0.02 * drop) << accuracy << ", " << step;
      }
  };
  constexpr double kStiffness = 1e6, kFall = 4.9, kGravity = 9.8;
  Scene ball;
  ball.integrator = Integrator::sdirk3;
  ball.ground = GroundDescription{};
  ball.links = {testing::link("ball", JointType::translational, {0, 0, 0.1 + kFall},
                              SphereShape{0.1}, 2387.3241)};  // 10 kg
  ball.ground_contacts.push_back({"ball", {kStiffness, 0, 0, 0}, ContactLaw::linear, 1e-5, {}});
  energy_kept(ball, 2, 10 * kGravity * kFall, 2, [](double q, double v) {
    const double depth = std::min(q + kFall, 0.0);
    return 10 * kGravity * q + 5 * v * v + 0.5 * kStiffness * depth * depth;
  });
  Scene slide;
  slide.integrator = Integrator::sdirk3;
  slide.links = {
      testing::link("slide", JointType::prismatic, {0, 0, 0}, SphereShape{0.1}, 2387.3241)};
  slide.links[0].joint.axis0 = {0, 0, 1};
  slide.links[0].joint.limits = {-kFall, 100};
  slide.links[0].joint.limit_stiffness = kStiffness;
  energy_kept(slide, 0, 10 * kGravity * kFall, 2, [](double q, double v) {
    const double beyond = std::min(q + kFall, 0.0);
    return 10 * kGravity * q + 5 * v * v + 0.5 * kStiffness * beyond * beyond;
  });
}

TEST(StepParts, ARollingBallKeepsItsWay) {
  constexpr double kRadius = 0.1, kStiffness = 1e5, kSpeed = 0.8;
  Scene scene;
  scene.ground = GroundDescription{};
  scene.links = {
      testing::link("ball", JointType::free, {0, 0, kRadius}, SphereShape{kRadius}, 1000)};
  scene.ground_contacts.push_back({"ball", {kStiffness, 100, 0.5, 10}, ContactLaw::linear, 0, {}});
  const Model model(scene);
  Stepper stepper(model, keeping(1e-3));
  Batch batch(model, 1);
  std::vector<double> q = q_of(batch);
  q[2] = -9.8 * model.mass(0) / kStiffness;
  batch.set_state(0, q, std::vector<double>{kSpeed, 0, 0, 0, kSpeed / kRadius, 0});
  for (int k = 0; k < 40; ++k) stepper.step(batch, {});
  EXPECT_NEAR(q_of(batch)[0], kSpeed, 1e-3);
  EXPECT_NEAR(q_of(batch)[1], 0, 1e-6);
}

/// Another: an undamped double pendulum that falls from the horizontal for two seconds. Its energy
/// error falls with the accuracy.
TEST(StepParts, EnergyErrorsFallWithTheAccuracy) {
  constexpr double kLength = 0.5, kWidth = 0.05, kMiddle = kLength / 2;
  Scene scene;
  scene.timestep = kLong;
  for (const char* name : {"upper", "lower"}) {
    LinkDescription link = testing::link(name, JointType::revolute, {0, 0, 0},
                                         CuboidShape{{kWidth, kWidth, kLength}, {2, 2, 2}}, 1000);
    link.joint.axis0 = {0, 1, 0};
    link.body.pose.position = {0, 0, -kMiddle};
    scene.links.push_back(link);
  }
  scene.links[1].parent = 0;
  scene.links[1].joint.pose.position = {0, 0, -kLength};
  const Model model(scene);
  const double mass = model.mass(0);
  const double inertia = mass / 12 * (kLength * kLength + kWidth * kWidth);
  const auto energy = [&](const Batch& batch) {
    const std::vector<double> q = q_of(batch), v = v_of(batch);
    const double a = q[0], b = q[0] + q[1], va = v[0], vb = v[0] + v[1];
    const double moving = 0.5 * (inertia + mass * kMiddle * kMiddle) * (va * va + vb * vb) +
                          0.5 * mass * kLength * kLength * va * va +
                          mass * kLength * kMiddle * std::cos(a - b) * va * vb;
    return moving - mass * 9.8 * ((kMiddle + kLength) * std::cos(a) + kMiddle * std::cos(b));
  };
  double last = HUGE_VAL;
  for (const double accuracy : {1e-1, 1e-2, 1e-3, 1e-4, 1e-5}) {
    Batch batch(model, 1);
    batch.set_state(0, std::vector<double>{M_PI / 2, 0}, std::vector<double>{0, 0});
    const double start = energy(batch);
    Stepper stepper(model, keeping(accuracy));
    double error = 0;
    for (int k = 0; k < 80; ++k) {
      stepper.step(batch, {});
      error = std::max(error, std::abs(energy(batch) - start));
    }
    error /= 2 * mass * 9.8 * kLength;  // by what a fall of both would free
    EXPECT_LE(error, last) << accuracy << ": whole steps may do for two of them";
    EXPECT_LT(error, 3 * accuracy) << accuracy;
    last = error;
  }
}

}  // namespace
}  // namespace tangere
