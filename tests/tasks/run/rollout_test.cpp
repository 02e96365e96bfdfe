// SPDX-License-Identifier: Apache-2.0
// Tests which rows a rollout gives, in which order, and what it reports about failures and stops.
#include "tasks/run/rollout.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <string>

#include "engine/sense/readout.hpp"
#include "io/scene/scene_reader.hpp"
#include "tests/tasks/recorded.hpp"

namespace tangere {
namespace {

using ::testing::ElementsAre;
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

/// Keeps everything, and the order in which it came: "q0 u0 q1 t1[0]1 …".
class Memory : public testing::Recorded {
 public:
  void write(std::int64_t step, std::size_t channel, const Numbers& numbers) override {
    Recorded::write(step, channel, numbers);
    const std::string& of = name(channel);
    if (of == "time") order += "q" + std::to_string(step) + " ";
    if (of == "u") order += "u" + std::to_string(step - 1) + " ";
    if (of.ends_with("/force"))
      order += (of == "tactile/even/force" ? "t0[" : "t1[") +
               std::to_string((*this)[of].size() - 1) + "]" + std::to_string(step) + " ";
  }
  std::string order;
};

class Rollout : public ::testing::Test {
 protected:
  RolloutSummary run(Batch& batch, const RolloutOptions& options, RowSink& sink,
                     const ProgressCallback& progress = {}, const std::stop_token& stop = {}) {
    Stepper stepper(model_);
    const ControlProgram controls(model_, stepper.timestep(), 0, control_);
    if (auto* const recorded = dynamic_cast<testing::Recorded*>(&sink))
      recorded->expect(rollout_recording(batch, stepper, options, {}));
    return run_rollout(batch, std::span(&stepper, 1), controls, options, sink, progress, stop);
  }

  [[nodiscard]] const std::vector<double>& numbers(const char* channel, std::size_t row) const {
    return memory_[channel].at(row).numbers;
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
    to.expect(rollout_recording(batch, steppers[0], {5, 0}, {}));
    const RolloutSummary summary = run_rollout(batch, steppers, controls, {5, 0}, to);
    EXPECT_EQ(summary.counts.simulation_steps, 350);
  }
  EXPECT_EQ(shared.order, alone.order);
  EXPECT_EQ(shared.all(), alone.all());
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
  for (const testing::RecordedRow& row : memory_["solver/iterations"])
    for (const double i : row.numbers) iterations += static_cast<std::int64_t>(i);
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
    EXPECT_EQ(memory_["time"][t].step, static_cast<std::int64_t>(t));
    EXPECT_EQ(numbers("time", t)[0], static_cast<double>(t) * 5e-3);
    for (int e = 0; e < kEnvironments; ++e) {
      const auto at = static_cast<std::size_t>(e);
      again.get_q(e, q);
      again.get_v(e, v);
      EXPECT_EQ(numbers("q", t)[at], q[0]);
      EXPECT_EQ(numbers("v", t)[at], v[0]);
      readout.bodies(again, e, pose, twist);
      for (std::size_t i = 0; i < 14; ++i)
        EXPECT_EQ(numbers("bodies/pose", t)[at * 14 + i], pose[i]);
      for (std::size_t i = 0; i < 12; ++i)
        EXPECT_EQ(numbers("bodies/twist", t)[at * 12 + i], twist[i]);
      readout.end_effectors(again, e, end_effectors);
      const std::vector<double>& positions = numbers("variables/position", t);
      ASSERT_EQ(positions.size(), 6U * kEnvironments);
      for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(positions[at * 6 + i], end_effectors[i]);
      EXPECT_NEAR(end_effectors[2], 0.0249 + q[0], 1e-15);
      if (t == 0) continue;
      readout.tactile(again, e, 1, force);
      const std::vector<double>& field = numbers("tactile/open/force", t - 1);
      for (std::size_t i = 0; i < force.size(); ++i)
        EXPECT_EQ(field[at * force.size() + i], force[i]);
    }
    if (t == 5) break;
    const std::vector<double> u(kEnvironments, 0.1 * static_cast<double>(t + 1));
    EXPECT_EQ(numbers("u", t).size(), u.size());
    for (std::size_t e = 0; e < u.size(); ++e) EXPECT_NEAR(numbers("u", t)[e], u[e], 1e-15);
    stepper.step(again, numbers("u", t));
  }
  double touched = 0;
  for (const double f : memory_["tactile/open/force"].back().numbers) touched += std::abs(f);
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
  EXPECT_GT(numbers("solver/iterations", 0)[1], 0) << "it was given up without a try";
  for (std::size_t t = 1; t < 5; ++t) EXPECT_EQ(numbers("solver/iterations", t)[1], 0) << t;
  for (std::size_t t = 0; t < 5; ++t) {
    EXPECT_TRUE(failed(static_cast<StepStatus>(numbers("solver/status", t)[1]))) << t;
    for (const std::size_t e : {std::size_t{0}, std::size_t{2}}) {
      EXPECT_EQ(numbers("q", t + 1)[e], without["q"][t + 1].numbers[e]);
      EXPECT_EQ(numbers("solver/iterations", t)[e], without["solver/iterations"][t].numbers[e]);
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
  EXPECT_EQ(memory_["q"].back().step, 3);
}

TEST_F(Rollout, PassesOnWhatTheSinkThrows) {
  class FullDisk : public Memory {
   public:
    void write(std::int64_t step, std::size_t channel, const Numbers& numbers) override {
      if (step == 2 && name(channel) == "time") throw IoError("disk full");
      Memory::write(step, channel, numbers);
    }
  } sink;
  Batch batch(model_, 1);
  EXPECT_THROW(run(batch, {5, 1}, sink), IoError);
  EXPECT_EQ(sink["u"].size(), 2U);
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
