// SPDX-License-Identifier: Apache-2.0
// Tests which rows a rollout gives, in which order, and what it reports about failures and stops.
#include "tasks/run/rollout.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <string>

#include "engine/sense/readout.hpp"
#include "io/scene/scene_reader.hpp"

namespace tangere {
namespace {

using testing::ElementsAre;
using ::testing::HasSubstr;

/// A pad that sinks onto a ball, with a sensor read every 2 steps and one without an interval.
Model pad_on_ball() {
  return Model(parse_scene(R"(<tangere model="pad">
  <option unit="m-kg" gravity="0 0 -9.8" timestep="5e-3" integrator="BDF1"/>
  <robot><link name="pad">
    <joint name="pad" type="prismatic" axis="0 0 1" pos="0 0 0.0249" damping="1"/>
    <body name="pad" type="cuboid" size="0.05 0.05 0.01" density="1000"/>
  </link></robot>
  <robot><link name="ball">
    <joint name="ball" type="fixed"/>
    <body name="ball" type="sphere" radius="0.02" density="1"/>
  </link></robot>
  <actuator><motor joint="pad" ctrl="force" ctrl_range="-1 1"/></actuator>
  <contact>
    <general_primitive_contact general_body="pad" primitive_body="ball"
                               kn="50" kt="1" mu="1" damping="1"/>
  </contact>
  <sensor>
    <tactile name="even" body="pad" type="rect_array" resolution="3 5" every="2"
             rect_pos0="-0.02 0.02 -0.005" rect_pos1="0.02 -0.02 -0.005"
             axis0="0 -1 0" axis1="1 0 0" kn="1" kt="0.01" mu="2" damping="0"/>
    <tactile name="open" body="pad" type="rect_array" resolution="7 7"
             rect_pos0="-0.02 0.02 -0.005" rect_pos1="0.02 -0.02 -0.005"
             axis0="0 -1 0" axis1="1 0 0" kn="1" kt="0.01" mu="2" damping="0"/>
  </sensor>
  <variable><endeffector joint="pad" pos="0.01 0 0"/><endeffector joint="ball" )"
                           R"(pos="0 0 0.02"/></variable>
</tangere>)",
                           "pad.xml")
                   .scene);
}

struct StoredState {
  std::int64_t step;
  double time;
  std::vector<double> q, v, pose, twist, end_effectors;
};
struct StoredStep {
  std::int64_t step;
  std::vector<double> u;
  std::vector<std::int32_t> iterations;
  std::vector<std::int8_t> status;
  std::vector<double> residual;
};
struct StoredField {
  FieldOutput output;
  std::int64_t frame, step;
  std::vector<double> force;
};

template <class T>
std::vector<T> copy(std::span<const T> values) {
  return {values.begin(), values.end()};
}

/// Keeps everything, and the order in which it came: "q0 u0 q1 t1[0]1 …".
class Memory : public RowSink {
 public:
  void write(const StateRow& row) override {
    order += "q" + std::to_string(row.step) + " ";
    states.push_back({row.step, row.time, copy(row.q), copy(row.v), copy(row.body_pose),
                      copy(row.body_twist), copy(row.end_effectors)});
  }
  void write(const StepRow& row) override {
    order += "u" + std::to_string(row.step) + " ";
    steps.push_back(
        {row.step, copy(row.u), copy(row.iterations), copy(row.status), copy(row.residual)});
  }
  void write(const TactileRow& row) override {
    order += "t" + std::to_string(row.output.sensor) + "[" + std::to_string(row.frame) + "]" +
             std::to_string(row.step) + " ";
    fields.push_back({row.output, row.frame, row.step, copy(row.numbers)});
  }
  std::string order;
  std::vector<StoredState> states;
  std::vector<StoredStep> steps;
  std::vector<StoredField> fields;
};

class Rollout : public testing::Test {
 protected:
  RolloutSummary run(Batch& batch, const RolloutOptions& options, RowSink& sink,
                     const ProgressCallback& progress = {}, const std::stop_token& stop = {}) {
    Stepper stepper(model_);
    const ControlProgram controls(model_, stepper.timestep(), 0, control_);
    return run_rollout(batch, std::span(&stepper, 1), controls, options, sink, progress, stop);
  }

  Model model_ = pad_on_ball();
  ControlDescription control_ = CsvControl{{{0.1}, {0.2}, {0.3}, {0.4}, {0.5}}, "u.csv"};
  Memory memory_;
};

TEST_F(Rollout, RowsDoNotDependOnThreads) {
  Memory alone, shared;
  for (const int threads : {1, 3}) {
    Memory& to = threads == 1 ? alone : shared;
    Batch batch(model_, 70);
    std::vector<Stepper> steppers;
    for (int k = 0; k < threads; ++k) steppers.emplace_back(model_);
    const ControlProgram controls(model_, steppers[0].timestep(), 0, control_);
    const RolloutSummary summary = run_rollout(batch, steppers, controls, {5, 0}, to);
    EXPECT_EQ(summary.counts.simulation_steps, 350);
  }
  EXPECT_EQ(shared.order, alone.order);
  ASSERT_EQ(shared.states.size(), alone.states.size());
  for (std::size_t k = 0; k < alone.states.size(); ++k) {
    EXPECT_EQ(shared.states[k].q, alone.states[k].q);
    EXPECT_EQ(shared.states[k].pose, alone.states[k].pose);
  }
  ASSERT_EQ(shared.fields.size(), alone.fields.size());
  for (std::size_t k = 0; k < alone.fields.size(); ++k)
    EXPECT_EQ(shared.fields[k].force, alone.fields[k].force);
}

TEST_F(Rollout, GivesEveryRowInOrder) {
  Batch batch(model_, 2);
  const RolloutSummary summary = run(batch, {5, 0}, memory_);
  EXPECT_EQ(memory_.order,
            "q0 u0 q1 t1[0]1 u1 q2 t0[0]2 t1[1]2 u2 q3 t1[2]3 u3 q4 t0[1]4 t1[3]4 u4 q5 t1[4]5 ");
  EXPECT_EQ(summary.steps, 5);
  EXPECT_EQ(summary.counts.simulation_steps, 10);
  EXPECT_FALSE(summary.stopped);
  EXPECT_TRUE(summary.failures.empty());
  EXPECT_GT(summary.seconds, 0);
  std::int64_t iterations = 0;
  for (const StoredStep& step : memory_.steps)
    for (std::int32_t i : step.iterations) iterations += i;
  EXPECT_EQ(summary.counts.newton_iterations, iterations);
  EXPECT_GT(iterations, 0);
}

TEST_F(Rollout, OptionReplacesTheScenesInterval) {
  Batch batch(model_, 1);
  run(batch, {5, 3}, memory_);
  EXPECT_EQ(memory_.order, "q0 u0 q1 u1 q2 u2 q3 t0[0]3 t1[0]3 u3 q4 u4 q5 ");
  EXPECT_EQ(tactile_interval(model_.sensors()[0], {5, 0}), 2);
  EXPECT_EQ(tactile_interval(model_.sensors()[1], {5, 0}), 1);
  EXPECT_EQ(tactile_interval(model_.sensors()[0], {5, 7}), 7);
}

TEST_F(Rollout, RowsAreTheBatchStepByStep) {
  constexpr int kEnvironments = 19;  // more than a block, less than two
  Batch batch(model_, kEnvironments);
  run(batch, {5, 1}, memory_);

  Batch again(model_, kEnvironments);
  Stepper stepper(model_);
  Readout readout(model_);
  std::vector<double> pose(14), twist(12), q(1), v(1), force(49 * 3), end_effectors(6);
  for (std::size_t t = 0;; ++t) {
    const StoredState& row = memory_.states[t];
    EXPECT_EQ(row.step, static_cast<std::int64_t>(t));
    EXPECT_EQ(row.time, static_cast<double>(t) * 5e-3);
    for (int e = 0; e < kEnvironments; ++e) {
      const auto at = static_cast<std::size_t>(e);
      again.get_q(e, q);
      again.get_v(e, v);
      EXPECT_EQ(row.q[at], q[0]);
      EXPECT_EQ(row.v[at], v[0]);
      readout.bodies(again, e, pose, twist);
      for (std::size_t i = 0; i < 14; ++i) EXPECT_EQ(row.pose[at * 14 + i], pose[i]);
      for (std::size_t i = 0; i < 12; ++i) EXPECT_EQ(row.twist[at * 12 + i], twist[i]);
      readout.end_effectors(again, e, end_effectors);
      ASSERT_EQ(row.end_effectors.size(), 6U * kEnvironments);
      for (std::size_t i = 0; i < 6; ++i)
        EXPECT_EQ(row.end_effectors[at * 6 + i], end_effectors[i]);
      EXPECT_NEAR(end_effectors[2], 0.0249 + q[0], 1e-15);
      if (t == 0) continue;
      readout.tactile(again, e, 1, force);
      const StoredField& field = memory_.fields[2 * t - 1];
      for (std::size_t i = 0; i < force.size(); ++i)
        EXPECT_EQ(field.force[at * force.size() + i], force[i]);
    }
    if (t == 5) break;
    const std::vector<double> u(kEnvironments, 0.1 * static_cast<double>(t + 1));
    EXPECT_EQ(memory_.steps[t].u.size(), u.size());
    for (std::size_t e = 0; e < u.size(); ++e) EXPECT_NEAR(memory_.steps[t].u[e], u[e], 1e-15);
    stepper.step(again, memory_.steps[t].u);
  }
  double touched = 0;
  for (double f : memory_.fields.back().force) touched += std::abs(f);
  EXPECT_GT(touched, 0) << "the pad never came down on the ball, so nothing was compared";
}

TEST_F(Rollout, AFailedEnvironmentIsARecordAndDisturbsNobody) {
  Batch healthy(model_, 3);
  Memory without;
  run(healthy, {5, 1}, without);

  Batch batch(model_, 3);
  const std::vector<double> q{0}, v{std::numeric_limits<double>::quiet_NaN()};
  batch.set_state(1, q, v);
  const RolloutSummary summary = run(batch, {5, 1}, memory_);
  ASSERT_EQ(summary.failures.size(), 1U);
  EXPECT_EQ(summary.failures[0].environment, 1);
  EXPECT_EQ(summary.failures[0].step, 0);
  EXPECT_EQ(summary.failures[0].status, batch.status(1));
  EXPECT_TRUE(failed(batch.status(1)));
  EXPECT_EQ(summary.steps, 5);
  EXPECT_EQ(summary.counts.simulation_steps, 2 * 5 + 1);
  EXPECT_GT(memory_.steps[0].iterations[1], 0) << "it was given up without a try";
  for (std::size_t t = 1; t < 5; ++t) EXPECT_EQ(memory_.steps[t].iterations[1], 0) << t;
  for (std::size_t t = 0; t < 5; ++t) {
    EXPECT_TRUE(failed(static_cast<StepStatus>(memory_.steps[t].status[1]))) << t;
    for (const std::size_t e : {std::size_t{0}, std::size_t{2}}) {
      EXPECT_EQ(memory_.states[t + 1].q[e], without.states[t + 1].q[e]);
      EXPECT_EQ(memory_.steps[t].iterations[e], without.steps[t].iterations[e]);
    }
  }
}

TEST_F(Rollout, StopsAfterTheStepInWhichItIsRequested) {
  Batch batch(model_, 1);
  std::vector<std::int64_t> seen;
  std::stop_source source;
  const auto progress = [&](std::int64_t done) {
    seen.push_back(done);
    if (done == 3) source.request_stop();
  };
  const RolloutSummary summary = run(batch, {5, 1}, memory_, progress, source.get_token());
  EXPECT_THAT(seen, ElementsAre(1, 2, 3));
  EXPECT_TRUE(summary.stopped);
  EXPECT_EQ(summary.steps, 3);
  EXPECT_EQ(memory_.states.back().step, 3);
}

TEST_F(Rollout, PassesOnWhatTheSinkThrows) {
  class FullDisk : public Memory {
   public:
    using Memory::write;
    void write(const StateRow& row) override {
      if (row.step == 2) throw IoError("disk full");
      Memory::write(row);
    }
  } sink;
  Batch batch(model_, 1);
  EXPECT_THROW(run(batch, {5, 1}, sink), IoError);
  EXPECT_EQ(sink.steps.size(), 2U);
}

TEST_F(Rollout, RefusesBeforeTheFirstRow) {
  const auto complaint = [&](const RolloutOptions& options) -> std::string {
    Batch batch(model_, 1);
    try {
      run(batch, options, memory_);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(complaint({0, 0}), HasSubstr("0 steps; expected at least 1"));
  EXPECT_THAT(complaint({-1, 0}), HasSubstr("-1 steps"));
  EXPECT_THAT(complaint({5, -1}), HasSubstr("every -1 steps"));
  EXPECT_THAT(complaint({6, 0}), HasSubstr("5 rows of controls for 6 steps"));
  Batch batch(model_, 1);
  Stepper stepper(model_);
  const ControlProgram controls(model_, 1e-3, 0, control_);
  EXPECT_THROW(run_rollout(batch, std::span(&stepper, 1), controls, {5, 0}, memory_), InputError);
  EXPECT_THROW(run_rollout(batch, {}, controls, {5, 0}, memory_), InputError);
  EXPECT_EQ(memory_.order, "");
}

}  // namespace
}  // namespace tangere
