// SPDX-License-Identifier: Apache-2.0
// Tests that effects are timed from the states of a run: a step from a recorded state is the run's
// own step, also in a model without an effect, whose controls and numbers are at other places.
#include "tasks/effects/timed_model.hpp"
#include "tasks/effects/ablation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "io/scene/scene_reader.hpp"
#include "tasks/effects/comparison.hpp"
#include "tasks/effects/effect_costs.hpp"

namespace tangere {
namespace {

constexpr int kPlayed = 19, kPlayedSteps = 12;

/// BDF2 with numbers that vary; every step of a run is an instant.
Scene short_run() {
  Scene scene = read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball_small.xml").scene;
  std::get<PiecewiseControl>(*scene.control) = {
      {0}, {{0.3, -0.2, 0.1}}, kPlayedSteps * scene.timestep};
  scene.initial.push_back({"pad_joint", {0, 0, -0.0155}, {}, {}});
  scene.solver.tolerance = 3e-7;  // what is timed checks its solves, so what is recorded should too
  return scene;
}

double distance(const std::vector<double>& recorded, const Batch& batch, bool velocity) {
  const auto n = std::size_t(velocity ? batch.model().nv() : batch.model().nq());
  std::vector<double> own(n);
  double most = 0;
  for (int e = 0; e < batch.environments(); ++e) {
    velocity ? batch.get_v(e, own) : batch.get_q(e, own);
    for (std::size_t k = 0; k < n; ++k)
      most = std::max(most, std::abs(own[k] - recorded[std::size_t(e) * n + k]));
  }
  return most;
}

TEST(TimedModel, StepsAsTheRunDid) {
  const Model model(short_run());
  const RecordedStates states = record_states(model, kPlayed, kPlayedSteps, 3);
  ASSERT_EQ(states.instants.size(), std::size_t(kPlayedSteps));
  TimedModel timed(model, states, {});
  for (int i = 0; i + 1 < kPlayedSteps; ++i) {
    const TimedStep step = timed.time_step(i);
    const RecordedInstant& next = states.instants[std::size_t(i) + 1];
    EXPECT_EQ(distance(next.q, timed.batch(), false), 0) << i;
    EXPECT_EQ(distance(next.v, timed.batch(), true), 0) << i;
    EXPECT_EQ(step.steps, kPlayed);
    EXPECT_EQ(step.failures, 0);
    EXPECT_GE(step.group_passes, 1);
  }
}

/// Joint damping that is zero changes nothing when it is removed. Here what is removed stands
/// before what stays: a motor with its controls, and a number that varies.
TEST(TimedModel, FindsControlsAndNumbersOfATrimmedScene) {
  Scene scene = short_run();
  LinkDescription bystander = scene.links.back();
  bystander.name = bystander.body.name = bystander.joint.name = "bystander";
  bystander.joint.type = JointType::translational;
  bystander.joint.pose.position = {1, 0, 1};
  scene.links.push_back(bystander);
  MotorDescription idle;
  idle.joint = "bystander";
  idle.control = MotorControl::position;
  scene.motors.insert(scene.motors.begin(), idle);
  for (std::vector<double>& values : std::get<PiecewiseControl>(*scene.control).values)
    values.insert(values.begin(), {7, 8, 9});
  scene.randomizations.insert(scene.randomizations.begin(),
                              {{NumberOwner::motor, NumberField::P, "bystander"},
                               {Distribution::Kind::list, 0, 0, {0}},
                               {}});
  const Model model(scene);
  const RecordedStates states = record_states(model, kPlayed, kPlayedSteps, 3);
  const Model trimmed(without(scene, {EffectKind::position_motors}));
  ASSERT_EQ(trimmed.nu(), 3);
  TimedModel timed(trimmed, states, {{}, {}, Stepper(model).tolerance()});
  for (int i = 0; i + 1 < kPlayedSteps; ++i) {
    timed.time_step(i);
    const RecordedInstant& next = states.instants[std::size_t(i) + 1];
    EXPECT_EQ(distance(next.q, timed.batch(), false), 0) << i;
    EXPECT_EQ(distance(next.v, timed.batch(), true), 0) << i;
  }
}

/// A transmission is the first joint of the run. Without it the others have other places. Its path
/// has no stiffness, so that the motion is the same.
TEST(TimedModel, FindsCoordinatesOfASceneWithoutItsTransmission) {
  Scene scene = short_run();
  LinkDescription cord;
  cord.name = cord.body.name = cord.joint.name = "cord";
  cord.joint.type = JointType::prismatic;
  cord.body.shape = AbstractShape{};
  scene.links.insert(scene.links.begin(), cord);
  for (LinkDescription& link : scene.links)
    if (link.parent >= 0) ++link.parent;
  TransmissionDescription path;
  path.joint = "cord";
  path.path = {{PathPart::Kind::point, "", {0, 0, 0.2}}, {PathPart::Kind::point, "ball"}};
  scene.transmissions.push_back(path);
  const Model model(scene);
  const RecordedStates states = record_states(model, kPlayed, kPlayedSteps, 3);
  const Model trimmed(without(scene, {EffectKind::transmissions}));
  ASSERT_EQ(trimmed.nq(), model.nq() - 1);
  TimedModel timed(trimmed, states, {{}, {}, Stepper(model).tolerance()});
  const auto nq = std::size_t(model.nq());
  std::vector<double> q(nq - 1);
  for (int i = 0; i + 1 < kPlayedSteps; ++i) {
    EXPECT_EQ(timed.time_step(i).failures, 0);
    double most = 0;
    for (int e = 0; e < kPlayed; ++e) {
      timed.batch().get_q(e, q);
      for (std::size_t k = 0; k + 1 < nq; ++k)
        most = std::max(
            most,
            std::abs(q[k] - states.instants[std::size_t(i) + 1].q[std::size_t(e) * nq + k + 1]));
    }
    EXPECT_LT(most, 1e-9) << i;
  }
}

/// A step that accepts every first guess evaluates the residual once per stage, and steps are not
/// cut to the scene's accuracy.
TEST(TimedModel, StagesAreCounted) {
  for (const auto& [scheme, stages] :
       {std::pair{"BDF1", 1.0}, std::pair{"SDIRK2", 2.0}, std::pair{"SDIRK3", 3.0}}) {
    Scene scene = short_run();
    for (const Integrator known : integrators())
      if (to_string(known) == std::string(scheme)) scene.integrator = known;
    const Model model(scene);
    const RecordedStates states = record_states(model, 16, 3, 3);
    TimedModel timed(model, states, {});
    const StepTimes times = measure_times(timed, 1e-9, 1);
    EXPECT_EQ(times.stages, stages) << scheme;
    EXPECT_GT(times.passes, stages) << scheme;
  }
  Scene cut = short_run();
  cut.solver.accuracy = 1e-3;
  EffectCostOptions options;
  options.environments = 2, options.instants = 1, options.seconds = 0;
  const EffectCosts costs = measure_effects(Model(cut), options);
  EXPECT_TRUE(costs.uncut);
  EXPECT_EQ(costs.times.stages, 3) << "of SDIRK3, which keeps accuracies";
  EXPECT_GT(costs.times.reading, 0) << "a run with one instant reads at it";
}

TEST(TimedModel, ALooserToleranceTakesFewerPasses) {
  const Model model(short_run());
  const RecordedStates states = record_states(model, kPlayed, kPlayedSteps, 3);
  TimedModel timed(model, states, {});
  const double passes = timed.time_step(kPlayedSteps - 1).passes;
  timed.solve_to(1e12);
  EXPECT_EQ(timed.time_step(kPlayedSteps - 1).group_passes, 1);
  timed.solve_to(Stepper(model).tolerance());
  EXPECT_EQ(timed.time_step(kPlayedSteps - 1).passes, passes);
  EXPECT_GT(passes, 1);
}

/// Steps that are taken again because they create energy would count against an effect that keeps
/// them from it.
TEST(EffectCosts, ComparesStepsThatAreTakenOnce) {
  Scene checked = short_run(), free = checked;
  free.solver.bounded_energy = false;
  const EffectCosts one = measure_effects(Model(checked), {8, 2, 1e-3, 0}),
                    two = measure_effects(Model(free), {8, 2, 1e-3, 0});
  ASSERT_EQ(one.effects.size(), two.effects.size());
  for (std::size_t k = 0; k < one.effects.size(); ++k)
    if (one.effects[k].measured && one.effects[k].effect.on) {
      EXPECT_EQ(one.effects[k].passes_without, two.effects[k].passes_without)
          << one.effects[k].effect.name;
    }
}

/// Structure alone: what is timed differs from run to run.
TEST(EffectCosts, HasARowPerEffectOfTheModel) {
  const Model model(short_run());
  const EffectCosts costs = measure_effects(model, {8, 2, 1e-3, 0});
  EXPECT_EQ(costs.instants, 2);
  EXPECT_EQ(costs.run_steps, kPlayedSteps);
  EXPECT_EQ(costs.rounds, kLeastRounds);
  EXPECT_GT(costs.times.step, 0);
  EXPECT_GT(costs.times.reading, 0);
  ASSERT_EQ(costs.effects.size(), model.effects().size());
  for (std::size_t k = 0; k < costs.effects.size(); ++k) {
    const EffectCost& cost = costs.effects[k];
    EXPECT_EQ(cost.effect.name, model.effects()[k].name);
    EXPECT_TRUE(cost.measured.has_value() || !cost.note.empty()) << cost.effect.name;
    if (!cost.effect.on) {
      EXPECT_EQ(cost.measured->share, 0) << cost.effect.name;
      EXPECT_EQ(cost.bytes, 0) << cost.effect.name;
    }
    if (cost.effect.effect == Effect{EffectKind::tactile, 0}) {
      EXPECT_EQ(cost.bytes, 3 * 8 * model.sensors()[0].points + 8);  // kt varies
    }
  }
}

}  // namespace
}  // namespace tangere
