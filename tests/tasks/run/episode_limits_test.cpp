// SPDX-License-Identifier: Apache-2.0
// Tests that a run of episodes keeps its limits, ends when it must, and refuses invalid requests.
#include "tasks/run/episodes.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <thread>

#include "tests/tasks/episode_by_hand.hpp"

namespace tangere {
namespace {

using namespace testing;
using ::testing::HasSubstr;

constexpr std::size_t kWhole = std::size_t{1} << 28, kSome = std::size_t{1} << 21;

/// Holds the first caller until the threads have simulated all that the limit allows.
class SlowSink : public EpisodeSink {
 public:
  SlowSink(const std::atomic<std::int64_t>& asked, std::int64_t all) : asked_(asked), all_(all) {}
  void write(const EpisodeRows&) override {
    if (!first_) return;
    first_ = false;
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(2);
    while (asked_ < all_ && std::chrono::steady_clock::now() < deadline)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // for a block too many
    seen = asked_;
  }
  void finish(std::int64_t, std::span<const FailedEpisode>, const EpisodeSteps&) override {}
  std::int64_t seen = 0;

 private:
  const std::atomic<std::int64_t>& asked_;
  std::int64_t all_;
  bool first_ = true;
};

TEST(EpisodeLimits, AsManyBlocksAreInFlightAsTheLimitSays) {
  for (const int limit : {1, 2, 4}) {
    EpisodeOptions o = options(2);
    o.blocks_in_flight = limit;
    o.piece_bytes = kWhole;  // a block is one piece: every row is counted once per block
    std::atomic<std::int64_t> rows = 0;
    SlowSink sink(rows, std::int64_t{limit} * kRows);
    const EpisodeSummary summary = run(small_ball(), o, sink, [&](std::int64_t) { ++rows; });
    EXPECT_EQ(sink.seen, std::int64_t{limit} * kRows);
    EXPECT_EQ(summary.peak_blocks_in_flight, limit);
    EXPECT_EQ(summary.episodes, kEpisodes);
  }
}

TEST(EpisodeLimits, MemoryGrowsWithBlocksInFlightAndPieces) {
  EpisodeOptions o = options();
  o.blocks_in_flight = 1;
  const double one = episode_bytes(small_ball(), o);
  o.blocks_in_flight = 4;
  EXPECT_EQ(episode_bytes(small_ball(), o), 4 * one);
  o.blocks_in_flight = 100;  // there are five blocks
  EXPECT_EQ(episode_bytes(small_ball(), o), 5 * one);
  o.blocks_in_flight = 1;
  o.piece_bytes = 1;
  EXPECT_LT(episode_bytes(small_ball(), o), one);
  EXPECT_GT(episode_bytes(small_ball(), o), 16 * (10 + 9 + 3 * 1024) * 8.0);
}

/// Throws at the n-th call, whichever function is called.
class FailingSink : public EpisodeSink {
 public:
  explicit FailingSink(int call) : call_(call) {}
  void write(const EpisodeRows&) override { count(); }
  void finish(std::int64_t, std::span<const FailedEpisode>, const EpisodeSteps&) override {
    count();
  }
  int calls = 0;

 private:
  void count() {
    if (++calls == call_) throw IoError("the disk is full at call " + std::to_string(call_));
  }
  int call_;
};

TEST(EpisodeLimits, EndWithWhatTheSinkThrows) {
  for (const int threads : {1, 2, 4}) {
    for (const int call : {1, 2, 7}) {
      EpisodeOptions o = options(threads);
      o.episodes = 100000;  // hours of work: only a run that ends early ends
      o.piece_bytes = kSome;
      FailingSink sink(call);
      try {
        run(small_ball(), o, sink);
        ADD_FAILURE() << "it went on";
      } catch (const IoError& error) {
        EXPECT_EQ(std::string(error.what()), "the disk is full at call " + std::to_string(call));
      }
      EXPECT_EQ(sink.calls, call) << "the sink was called again after it threw";
    }
  }
}

TEST(EpisodeLimits, EndWhenAskedTo) {
  for (const int threads : {1, 2, 4}) {
    EpisodeOptions o = options(threads);
    o.episodes = 100000;
    std::stop_source source;
    std::int64_t done = 0;
    const auto stop_later = [&](std::int64_t steps) {
      done = steps;
      if (steps > std::int64_t{7} * 16 * kSteps) source.request_stop();
    };
    Recorder recorder(kRows);
    const EpisodeSummary summary = run(small_ball(), o, recorder, stop_later, source.get_token());
    EXPECT_TRUE(summary.stopped);
    // Every thread may end the row that it has begun.
    EXPECT_LE(done, std::int64_t{16} * (7 * kSteps + (threads + 1) * kEvery));
    EXPECT_EQ(summary.episodes, 16 * std::ssize(recorder.finished));
    EXPECT_LE(summary.episodes, 16 * 7);
    for (const std::int64_t first : recorder.finished)  // what was finished is whole
      EXPECT_TRUE(recorder.episodes.at(first) == ByHand<double>(small_ball(), o, first).episode);
  }
}

TEST(EpisodeLimits, ProgressCountsEveryStep) {
  std::vector<std::int64_t> seen;
  EpisodeOptions o = options();
  o.piece_bytes = kSome;
  Recorder recorder(kRows);
  run_episodes(small_ball(), {}, ControlProgram(small_ball(), 5e-3, kSeed), o, recorder,
               [&](std::int64_t steps) { seen.push_back(steps); });
  ASSERT_EQ(std::ssize(seen), 5 * kRows) << "blocks times rows";
  EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
  EXPECT_EQ(seen.back(), kEpisodes * kSteps);
}

/// The message of the error; "" if there is none.
std::string complaint(const EpisodeOptions& o, const ControlProgram& controls) {
  FailingSink sink(1);  // called: not refused
  try {
    run_episodes(small_ball(), {}, controls, o, sink);
  } catch (const InputError& error) {
    return error.what();
  }
  return "nothing";
}

std::string complaint(const EpisodeOptions& o) {
  return complaint(o, ControlProgram(small_ball(), 5e-3, kSeed));
}

TEST(EpisodeLimits, RefuseNumbersThatMakeNoSense) {
  EpisodeOptions o = options();
  o.episodes = 0;
  EXPECT_THAT(complaint(o), HasSubstr("0 episodes; expected at least 1"));
  o = options();
  o.threads = 0;
  EXPECT_THAT(complaint(o), HasSubstr("0 threads; expected at least 1"));
  o = options();
  o.blocks_in_flight = 0;
  EXPECT_THAT(complaint(o), HasSubstr("0 blocks in flight; expected at least 1"));
  o = options();
  o.steps = 0;
  EXPECT_THAT(complaint(o), HasSubstr("0 steps; expected at least 1"));
  o = options();
  o.every = 0;
  EXPECT_THAT(complaint(o), HasSubstr("0 steps per action; expected at least 1"));
  o = options();
  o.every = 7;
  EXPECT_THAT(complaint(o),
              HasSubstr("120 steps, and an action is held for 7; expected a multiple of 7"));
}

TEST(EpisodeLimits, RefuseControlsThatDoNotFit) {
  EXPECT_THAT(complaint(options(), ControlProgram(small_ball(), 1e-2, kSeed)),
              HasSubstr("controls laid out for a timestep of 0.01 s; the stepper's is 0.005 s"));
  EpisodeOptions o = options();
  o.every = 8;  // the scene's controls change at step 100
  EXPECT_THAT(complaint(o), HasSubstr("change at step 100, but an action is held for 8 steps"));
  const ControlProgram noise(small_ball(), 5e-3, kSeed, RandomControl{1, 0.05});
  EXPECT_THAT(complaint(options(), noise), HasSubstr("change at step 1, but"));
  const ControlProgram table(small_ball(), 5e-3, kSeed,
                             CsvControl{std::vector<std::vector<double>>(119, {0, 0, 0}), "u.csv"});
  EXPECT_THAT(complaint(options(), table), HasSubstr("119 rows of controls for 120 steps"));
}

TEST(EpisodeLimits, TheIntervalIsTheSensors) {
  EXPECT_EQ(action_interval(small_ball(), 0), 5);
  EXPECT_EQ(action_interval(small_ball(), 3), 3);
  Scene scene = small_scene();
  scene.sensors[0].every = 0;
  EXPECT_EQ(action_interval(Model(scene), 0), 1);
  scene.sensors.push_back(scene.sensors[0]);
  scene.sensors[1].name = "second";
  scene.sensors[1].every = 4;
  EXPECT_EQ(action_interval(Model(scene), 0), 4);
  scene.sensors[0].every = 5;
  EXPECT_EQ(action_interval(Model(scene), 2), 2);
  try {
    action_interval(Model(scene), 0);
    ADD_FAILURE() << "sensors that disagree were accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("sensor pad is read every 5 steps and sensor second every 4"));
  }
}

TEST(EpisodeLimits, ThereIsAThreadToRunOn) { EXPECT_GE(available_threads(), 1); }

}  // namespace
}  // namespace tangere
