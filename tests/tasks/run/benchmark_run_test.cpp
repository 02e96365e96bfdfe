// SPDX-License-Identifier: Apache-2.0
// Tests that timed episodes take the same steps and read the same fields, however they are spread
// over threads and batches.
#include "tasks/run/benchmark_run.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <string>

#include "io/scene/scene_reader.hpp"
#include "tasks/run/block_threads.hpp"
#include "tasks/run/checksum.hpp"
#include "tasks/run/pinned_threads.hpp"
#include "tests/tasks/recorded.hpp"
#include "tests/tasks/task_check.hpp"

namespace tangere {
namespace {

using ::testing::ElementsAreArray;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr std::uint64_t kSeed = 5;
constexpr int kSteps = 80;  // the pad is on the ball from step 40 or so
constexpr int kEvery = 20;

const Model& small_ball() {
  static const Model model(read_scene(TANGERE_SOURCE_DIR "/scenes/rolling_ball_small.xml").scene);
  return model;
}

BenchmarkOptions options(int threads, FrameKind frames = FrameKind::dense,
                         Precision precision = Precision::f64) {
  return {{kSteps, kEvery, {}}, frames, precision, threads, /*repeat=*/1};
}

BenchmarkResult result_of(const Batch& start, const BenchmarkOptions& what,
                          const std::stop_token& stop = {}) {
  const Model& model = start.model();
  return run_benchmark(start, ControlProgram(model, model.timestep(), kSeed), what, stop);
}

BenchmarkResult result_of(int environments, const BenchmarkOptions& what) {
  return result_of(Batch(small_ball(), environments, kSeed), what);
}

TEST(BenchmarkRun, ChecksumsDoNotDependOnThreads) {
  constexpr int kEnvironments = 70;  // more blocks than threads
  const BenchmarkResult one = result_of(kEnvironments, options(1));
  ASSERT_THAT(one.checksums, SizeIs(kEnvironments));
  for (const int threads : {2, 4}) {
    const BenchmarkResult more = result_of(kEnvironments, options(threads));
    EXPECT_EQ(more.checksum(), one.checksum()) << threads << " threads";
    EXPECT_THAT(more.checksums, ElementsAreArray(one.checksums)) << threads << " threads";
    EXPECT_EQ(more.counts.newton_iterations, one.counts.newton_iterations);
  }
}

TEST(BenchmarkRun, PinnedThreadsTakeTheSameSteps) {
  BenchmarkOptions pinned = options(1);
  pinned.pinned = true;
  const std::vector<int> before = usable_processors();
  const BenchmarkResult plain = result_of(40, options(1));
  for (const int threads : {1, 2, 5}) {
    pinned.threads = threads;
    EXPECT_EQ(result_of(40, pinned).checksum(), plain.checksum()) << threads << " threads";
    EXPECT_EQ(usable_processors(), before) << "this thread may run where it could";
  }
}

TEST(BenchmarkRun, APinnedThreadRunsOnOneProcessor) {
  const std::vector<int> all = usable_processors();
  for (const int threads : {1, 3}) {
    BlockThreads pinned(threads, true);
    std::vector<std::vector<int>> of(static_cast<std::size_t>(threads));
    pinned.for_each(64, of, [](std::vector<int>& own, int) {
      const std::vector<int> now = usable_processors();
      EXPECT_THAT(now, SizeIs(1));
      own.push_back(now[0]);
    });
    for (std::size_t k = 0; k < of.size(); ++k)
      for (const int processor : of[k]) EXPECT_EQ(processor, all[k % all.size()]);
  }
}

TEST(BenchmarkRun, AnEnvironmentHasItsChecksumInAnyBatch) {
  const std::vector<std::uint64_t> all = result_of(40, options(2)).checksums;
  for (const int environments : {1, 16, 23}) {
    const std::vector<std::uint64_t> some = result_of(environments, options(1)).checksums;
    EXPECT_THAT(some, ElementsAreArray(all.begin(), all.begin() + environments));
  }
  // The place in the batch does not matter either: episodes 16 … 39 are environments 0 … 23.
  const BenchmarkResult later = result_of(Batch(small_ball(), 24, kSeed, 16), options(1));
  EXPECT_THAT(later.checksums, ElementsAreArray(all.begin() + 16, all.end()));
}

TEST(BenchmarkRun, ChecksumsTellEnvironmentsSeedsFieldsAndStepsApart) {
  std::vector<std::uint64_t> sums = result_of(20, options(1)).checksums;
  std::sort(sums.begin(), sums.end());
  EXPECT_EQ(std::adjacent_find(sums.begin(), sums.end()), sums.end());
  const std::uint64_t plain = result_of(2, options(1)).checksum();
  EXPECT_NE(result_of(Batch(small_ball(), 2, kSeed + 1), options(1)).checksum(), plain);
  EXPECT_NE(result_of(2, options(1, FrameKind::none)).checksum(), plain);
  BenchmarkOptions shorter = options(1);
  shorter.rollout.steps = kSteps - 1;
  EXPECT_NE(result_of(2, shorter).checksum(), plain);
}

TEST(BenchmarkRun, CompactFramesHoldTheBitsOfDenseOnes) {
  for (const Precision precision : {Precision::f64, Precision::mixed}) {
    const BenchmarkResult dense = result_of(20, options(1, FrameKind::dense, precision));
    const BenchmarkResult compact = result_of(20, options(2, FrameKind::compact, precision));
    EXPECT_THAT(compact.checksums, ElementsAreArray(dense.checksums)) << to_string(precision);
    EXPECT_EQ(compact.tactile_points, dense.tactile_points);
  }
  EXPECT_NE(result_of(2, options(1, FrameKind::dense, Precision::mixed)).checksum(),
            result_of(2, options(1)).checksum());
}

TEST(BenchmarkRun, AChainFeelsEveryBitAndTheOrder) {
  using Numbers = std::span<const double>;
  const std::vector<double> numbers{0, 1, -2.5, 1e-300, 7, 0, 0};
  const std::uint64_t plain = chain_bits(1, Numbers(numbers));
  EXPECT_NE(chain_bits(2, Numbers(numbers)), plain);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    std::vector<double> other = numbers;
    other[i] = -other[i];  // one bit, also where the number is zero
    EXPECT_NE(chain_bits(1, Numbers(other)), plain) << "sign of number " << i;
    std::swap(other[i] = numbers[i], other[(i + 4) % numbers.size()]);
    if (other != numbers) {
      EXPECT_NE(chain_bits(1, Numbers(other)), plain) << "place of number " << i;
    }
  }
  std::vector<double> both = numbers;
  both[0] = -both[0], both[4] = -both[4];  // beside each other in one of the chains within
  EXPECT_NE(chain_bits(1, Numbers(both)), plain);
}

TEST(BenchmarkRun, StepsAndReadsWhatARolloutDoes) {
  constexpr std::size_t kEnvironments = 3;
  const Model& model = small_ball();
  Batch batch(model, kEnvironments, kSeed);
  Stepper stepper(model);
  const ControlProgram controls(model, model.timestep(), kSeed);
  testing::Recorded sink(rollout_recording(batch, stepper, {kSteps, kEvery}, {}));
  const RolloutSummary summary =
      run_rollout(batch, std::span(&stepper, 1), controls, {kSteps, kEvery}, sink);
  const BenchmarkResult result = result_of(kEnvironments, options(1));
  EXPECT_EQ(result.environment_steps, summary.counts.simulation_steps);
  EXPECT_EQ(result.counts.newton_iterations, summary.counts.newton_iterations);
  EXPECT_EQ(result.tactile_points, kSteps / kEvery * std::int64_t{kEnvironments} * 32 * 32);

  const std::vector<testing::RecordedRow>& fields =
      sink["tactile/" + std::string(model.sensors()[0].name) + "/force"];
  ASSERT_THAT(fields, SizeIs(kSteps / kEvery));
  const auto part = [](const std::vector<double>& all, std::size_t e) {
    const std::size_t width = all.size() / kEnvironments;
    return std::vector<double>(&all[e * width], &all[e * width] + width);
  };
  const auto touched = [](const auto& f) {
    return std::count(f.begin(), f.end(), 0.0) < std::ssize(f);
  };
  EXPECT_TRUE(touched(fields.back().numbers)) << "the pad does not touch: the test tests nothing";
  for (std::size_t e = 0; e < kEnvironments; ++e) {
    std::uint64_t chain = e;
    for (const testing::RecordedRow& row : fields) chain = chain_bits(chain, part(row.numbers, e));
    EXPECT_EQ(result.checksums[e], chain_bits(chain_bits(chain, part(sink["q"].back().numbers, e)),
                                              part(sink["v"].back().numbers, e)));
  }
}

TEST(BenchmarkRun, WithoutFramesNothingIsRead) {
  const BenchmarkResult result = result_of(17, options(2, FrameKind::none));
  EXPECT_EQ(result.tactile_points, 0);
  EXPECT_EQ(result.environment_steps, 17 * kSteps);
}

TEST(BenchmarkRun, EveryPassIsTimed) {
  BenchmarkOptions four = options(1, FrameKind::none);
  four.repeat = 4;
  const BenchmarkResult result = result_of(1, four);
  ASSERT_THAT(result.times, SizeIs(4));
  for (const BenchmarkTime& time : result.times) EXPECT_GT(time.seconds, 0);
  EXPECT_LE(result.best().seconds, result.median().seconds);
}

TEST(BenchmarkRun, MedianIsTheMiddleOfEachTime) {
  BenchmarkResult result;
  result.times = {{3, 1}, {1, 9}, {2, 5}};
  EXPECT_EQ(result.best().seconds, 1);
  EXPECT_EQ(result.best().cpu_seconds, 9);
  EXPECT_EQ(result.median().seconds, 2);
  EXPECT_EQ(result.median().cpu_seconds, 5);
  result.times.push_back({7, 6});
  EXPECT_EQ(result.median().seconds, 2.5);
  EXPECT_EQ(result.median().cpu_seconds, 5.5);
}

TEST(BenchmarkRun, FailedEnvironmentsAreListedAndNotRead) {
  Scene scene = small_ball().scene();
  scene.timestep = 86400;  // no step of a day has a solution: the ball turns too far
  const Model model(scene);
  BenchmarkOptions two_days = options(2);
  two_days.rollout = {2, 1};
  const BenchmarkResult result = result_of(Batch(model, 20, kSeed), two_days);
  ASSERT_THAT(result.failures, SizeIs(20));
  for (int e = 0; e < 20; ++e) {
    EXPECT_EQ(result.failures[std::size_t(e)].environment, e);
    EXPECT_EQ(result.failures[std::size_t(e)].step, 0);
  }
  EXPECT_EQ(result.environment_steps, 20);
  EXPECT_EQ(result.tactile_points, 0);
}

TEST(BenchmarkRun, StopsBetweenSteps) {
  std::stop_source source;
  source.request_stop();
  const BenchmarkResult result =
      result_of(Batch(small_ball(), 40, kSeed), options(2), source.get_token());
  EXPECT_TRUE(result.stopped);
  EXPECT_THAT(result.times, IsEmpty());
  EXPECT_EQ(result.counts.newton_iterations, 0) << "a stopped block was stepped on";
}

/// This includes episodes that end and start anew, on any number of threads.
TEST(BenchmarkRun, ATaskIsPlayedAsAVectorTaskPlaysIt) {
  constexpr int kEnvironments = 20;
  for (const char* name : {"dummy", "insertion_translation"}) {
    const auto task = ::tangere::testing::task_named(name);
    const std::int64_t actions = task->spec().horizon + 2;
    const Policy policy(*task, PolicyKind::random);
    VectorOptions of_vector;
    of_vector.seed = kSeed;
    VectorTask vector(*task, kEnvironments, of_vector);
    std::vector<std::uint64_t> expected(vector.episodes().begin(), vector.episodes().end());
    std::vector<double> chosen(kEnvironments * task->spec().action.size());
    for (std::int64_t t = 0; t < actions; ++t) {
      policy.act(vector, chosen);
      vector.step(chosen);
      for (int e = 0; e < kEnvironments; ++e) {
        const auto i = std::size_t(e);
        const std::vector<double> rest{vector.rewards()[i], double(vector.terminated()[i]),
                                       double(vector.truncated()[i]), double(vector.success()[i])};
        expected[i] = chain_bits(chain_bits(expected[i], vector.observation(e)),
                                 std::span<const double>(rest));
      }
    }
    for (const int threads : {1, 2}) {
      BenchmarkOptions o = options(threads, FrameKind::dense, Precision::mixed);
      o.rollout = {actions};
      const BenchmarkResult result =
          run_benchmark(Batch(task->model(), kEnvironments, kSeed), *task, policy, o);
      EXPECT_THAT(result.checksums, ElementsAreArray(expected)) << name;
      EXPECT_EQ(result.environment_steps, vector.counts().environment_steps);
      EXPECT_EQ(result.counts.simulation_steps, vector.counts().steps.simulation_steps);
      EXPECT_EQ(result.counts.newton_iterations, vector.counts().steps.newton_iterations);
    }
  }
}

TEST(BenchmarkRun, RefusesWhatMakesNoSense) {
  const auto complaint = [](const BenchmarkOptions& what, double timestep = 5e-3) {
    try {
      run_benchmark(Batch(small_ball(), 1), ControlProgram(small_ball(), timestep, 0), what);
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("nothing");
  };
  EXPECT_THAT(complaint(options(0)), HasSubstr("0 threads"));
  BenchmarkOptions o = options(1);
  o.repeat = 0;
  EXPECT_THAT(complaint(o), HasSubstr("0 timed passes"));
  o = options(1);
  o.rollout.steps = 0;
  EXPECT_THAT(complaint(o), HasSubstr("0 steps"));
  o = options(1);
  o.rollout.every = -1;
  EXPECT_THAT(complaint(o), HasSubstr("every -1"));
  EXPECT_THAT(complaint(options(1), 1e-3), HasSubstr("timestep"));
}

TEST(BenchmarkRun, MemoryGrowsWithFramesAndThreads) {
  const double none = benchmark_bytes(small_ball(), 100, options(1, FrameKind::none));
  const double dense = benchmark_bytes(small_ball(), 100, options(1));
  EXPECT_EQ(dense - none, 100 * 32 * 32 * 3 * 8.0);
  EXPECT_GT(benchmark_bytes(small_ball(), 100, options(2)), dense);
}

}  // namespace
}  // namespace tangere
