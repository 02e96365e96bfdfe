// SPDX-License-Identifier: Apache-2.0
// Tests that whoever reads an imperfect sensor gets the same: data sets on any number of threads, a
// rollout, the benchmark, a task; and that derivatives go through the same place.
#include <gmock/gmock.h>

#include <cmath>
#include <map>

#include "tasks/gradients/gradient_check.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/losses.hpp"
#include "tasks/run/benchmark_run.hpp"
#include "tasks/run/rollout.hpp"
#include "tests/tasks/episode_by_hand.hpp"
#include "tests/tasks/recorded.hpp"
#include "tests/tasks/task_check.hpp"

namespace tangere {
namespace {

using testing::ByHand;
using ::testing::ElementsAreArray;
using testing::kSeed;
using testing::RecordedEpisode;

Scene with_imperfections(Scene scene, bool memory = false, double quantisation = 1e-5) {
  for (TactileDescription& d : scene.sensors) {
    SensorImperfections& i = d.imperfections;
    i.source = {"s.xml", 3};
    if (d.points.empty()) i.crosstalk = 0.05, i.spread = 0.001;
    i.gain = 0.05, i.sensor_gain = 0.03, i.dead = 0.02;
    i.bias = {1e-4, 5e-5}, i.noise = {2e-4, 1e-4};
    i.saturation = {2e-2, 1e-2};
    i.quantisation = {quantisation, quantisation};
    if (memory) i.delay = 0.012, i.low_pass = 0.01;
  }
  return scene;
}

const Model& imperfect_ball(bool memory) {
  static const Model plain(with_imperfections(testing::small_scene())),
      slow(with_imperfections(testing::small_scene(), true));
  return memory ? slow : plain;
}

std::map<std::int64_t, RecordedEpisode> episodes(const Model& model, int threads, std::size_t piece,
                                                 Precision precision = Precision::f64) {
  EpisodeOptions o = testing::options(threads, precision);
  o.piece_bytes = piece;
  testing::Recorder recorder(testing::kRows);
  testing::run(model, o, recorder);
  return recorder.episodes;
}

class ImperfectSensors : public ::testing::TestWithParam<bool> {};

TEST_P(ImperfectSensors, EpisodesHaveTheBitsOfOneSteppedByHand) {
  const Model& model = imperfect_ball(GetParam());
  for (const Precision precision : {Precision::f64, Precision::mixed}) {
    const auto one = episodes(model, 1, 1 << 20, precision);
    EXPECT_EQ(episodes(model, 3, 1 << 14, precision), one);
    for (const std::int64_t number : {0, 15, 16, 69}) {
      const EpisodeOptions o = testing::options(1, precision);
      if (precision == Precision::f64) {
        EXPECT_EQ(one.at(number), ByHand<double>(model, o, number).episode) << number;
      } else {
        EXPECT_EQ(one.at(number), ByHand<float>(model, o, number).episode) << number;
      }
    }
  }
}

TEST_P(ImperfectSensors, ARolloutReadsWhatADataSetStores) {
  const Model& model = imperfect_ball(GetParam());
  const auto stored = episodes(model, 2, 1 << 20);
  Batch batch(model, 20, kSeed);
  Stepper stepper(model);
  RolloutOptions o;
  o.steps = testing::kSteps;
  o.every = testing::kEvery;
  testing::Recorded rows(rollout_recording(batch, stepper, o, {}));
  run_rollout(batch, std::span(&stepper, 1), ControlProgram(model, model.timestep(), kSeed), o,
              rows, {});
  const std::vector<testing::RecordedRow>& fields =
      rows["tactile/" + std::string(model.sensors()[0].name) + "/force"];
  for (int e = 0; e < 20; ++e) {
    const std::string& all = stored.at(e).observations.back();  // from row 0 on
    std::string here;
    for (const testing::RecordedRow& row : fields) {
      const std::size_t width = row.numbers.size() / 20;
      here += testing::bytes_of(std::span(row.numbers).subspan(std::size_t(e) * width, width));
    }
    ASSERT_EQ(all.size(), here.size() / testing::kRows * (testing::kRows + 1));
    EXPECT_EQ(all.substr(all.size() - here.size()), here) << e;
  }
}

TEST_P(ImperfectSensors, ChecksumsDoNotDependOnThreadsFramesAndBatches) {
  const Model& model = imperfect_ball(GetParam());
  const auto sums = [&](int environments, int threads, FrameKind frames) {
    const BenchmarkOptions o{{120, 30, {}}, frames, Precision::f64, threads, 1};
    return run_benchmark(Batch(model, environments, kSeed),
                         ControlProgram(model, model.timestep(), kSeed), o, {})
        .checksums;
  };
  const std::vector<std::uint64_t> one = sums(40, 1, FrameKind::dense);
  EXPECT_THAT(sums(40, 3, FrameKind::dense), ElementsAreArray(one));
  EXPECT_THAT(sums(40, 1, FrameKind::compact), ElementsAreArray(one));
  EXPECT_THAT(sums(17, 1, FrameKind::dense), ElementsAreArray(one.begin(), one.begin() + 17));
}

INSTANTIATE_TEST_SUITE_P(Memory, ImperfectSensors, ::testing::Bool());

TEST(ImperfectSensors, AMemoryKeepsToTheStepsOfItsScene) {
  const Model& model = imperfect_ball(true);
  Batch batch(model, 1);
  StepperOptions half;
  half.timestep = model.timestep() / 2;
  Stepper stepper(model, half);
  RolloutOptions o;
  o.steps = 2;
  const ControlProgram controls(model, *half.timestep, 0);
  try {
    testing::Recorded nothing;
    run_rollout(batch, std::span(&stepper, 1), controls, o, nothing, {});
    ADD_FAILURE();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("s.xml:3: delay, low_pass and hysteresis"));
  }
}

std::unique_ptr<Task> task_with_imperfections(const std::string& name, double quantisation) {
  return make_task(
      name,
      with_imperfections(read_scene(TANGERE_SOURCE_DIR "/scenes/" + task_spec(name).scene).scene,
                         false, quantisation));
}

TEST(ImperfectSensors, ATaskSeesTheirReadingsOnAnyNumberOfThreads) {
  const auto ideal = testing::task_named("box_pushing");
  const auto task = task_with_imperfections("box_pushing", 1e-5);
  VectorOptions options;
  options.seed = 3;
  const auto one = testing::play(*task, PolicyKind::random, 20, 4, options);
  options.threads = 3;
  EXPECT_EQ(testing::play(*task, PolicyKind::random, 20, 4, options), one);
  EXPECT_NE(testing::play(*ideal, PolicyKind::random, 20, 4, options), one);
}

void expect_right(const GradientCheck& c) {
  for (const CheckedInput& i : c.inputs) {
    EXPECT_LE(i.difference_error, 1e-5) << i.name << " at " << i.worst;
    EXPECT_LE(i.tangent_error, 1e-8) << i.name;
  }
  EXPECT_GT(c.inputs[0].compared, 0U);
  EXPECT_GT(c.inputs[0].norm, 0);
}

TEST(ImperfectSensors, GradientsOfALossAgreeByThreeRoutes) {
  const Model model(with_imperfections(testing::small_scene(), false, 0));
  Batch start(model, 1, 3);
  start.set_steps(0, 7);
  const ControlProgram program(model, model.timestep(), 3);
  const auto loss = make_loss(LossKind::tactile, model, 5);
  CheckOptions options;
  options.length = 100;
  options.entries = 3;
  options.settled = 1e-6;
  options.stepper.tolerance = 1e-12;
  expect_right(check_gradient(
      start, [&](std::int64_t step, int e, std::span<double> u) { program.evaluate(step, e, u); },
      *loss, options));
}

TEST(ImperfectSensors, GradientsOfATaskAgreeByThreeRoutes) {
  const auto task = task_with_imperfections("ball_rolling_small", 0);
  const Policy policy(*task, PolicyKind::scripted);
  CheckOptions options;
  options.length = 12;
  options.entries = 3;
  options.seed = 4;
  options.stepper.tolerance = 1e-12;
  const GradientCheck check = check_task_gradient(
      *task, [](const Scene& scene) { return make_task("ball_rolling_small", scene); },
      [&](const TaskView& view, std::span<const double> o, std::span<double> a) {
        policy.act(view, o, a);
      },
      options);
  expect_right(check);
}

/// Readings with lag depend on earlier states, on the tape and before it.
TEST(ImperfectSensors, GradientsOfReadingsWithMemoryAgreeByThreeRoutes) {
  const Model model(with_imperfections(testing::small_scene(), true, 0));
  const ControlProgram program(model, model.timestep(), 3);
  CheckOptions options;
  options.length = 100;
  options.entries = 3;
  options.settled = 1e-6;
  options.stepper.tolerance = 1e-12;
  expect_right(check_gradient(
      Batch(model, 1, 3),
      [&](std::int64_t step, int e, std::span<double> u) { program.evaluate(step, e, u); },
      *make_loss(LossKind::tactile, model, 5), options));
}

}  // namespace
}  // namespace tangere
