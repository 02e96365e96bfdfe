// SPDX-License-Identifier: Apache-2.0
// Tests episodes of tasks on their way to a sink: in ascending order, the same bits on any number
// of threads, few at a time, ended by errors and on request.
#include <gmock/gmock.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <map>
#include <mutex>
#include <set>
#include <thread>

#include "tasks/run/episodes.hpp"
#include "tests/sanitized.hpp"
#include "tests/tasks/task_check.hpp"

namespace tangere {
namespace {

using ::tangere::testing::task_named;

constexpr std::int64_t kEpisodes = kSanitized ? 104 : 200;  // the last block is short

/// Keeps what it receives, and reports what is out of order.
class Keeper : public EpisodeSink {
 public:
  void prepare(const EpisodeRows& piece) override {
    ++prepared;
    const std::int64_t ahead = piece.first_episode / 16 - written;
    std::int64_t most = most_ahead;
    while (ahead > most && !most_ahead.compare_exchange_weak(most, ahead)) {
    }
  }
  void write(const EpisodeRows& piece) override {
    EXPECT_EQ(callers_++, 0) << "two threads in the sink";
    EXPECT_GT(piece.first_episode, last_);
    last_ = piece.first_episode;
    episodes_ = piece.episodes;
    if (fail_at == last_) throw IoError("the disk is full");
    for (int e = 0; e < piece.episodes; ++e) {
      const EpisodeEnd& end = piece.ends[static_cast<std::size_t>(e)];
      std::string& all = episodes.emplace_back();
      add(all, piece.actions, e, piece.action_rows, end.length);
      add(all, piece.rewards, e, piece.action_rows, end.length);
      for (const Observation& values : piece.observations)
        std::visit([&](const auto& numbers) { add(all, numbers, e, piece.rows, end.length + 1); },
                   values);
      all.append(reinterpret_cast<const char*>(&end.total), sizeof end.total);
    }
    if (slow) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    // The first write lasts until another block is played, which shows that writing delays nobody.
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(2);
    while (slow && most_ahead < 1 && std::chrono::steady_clock::now() < deadline)
      std::this_thread::yield();
    ++written;
    --callers_;
  }
  void finish(std::int64_t first, std::span<const FailedEpisode>, const EpisodeSteps&) override {
    EXPECT_EQ(first, last_);
  }

  std::vector<std::string> episodes;  // bytes of each episode
  std::int64_t fail_at = -1;
  bool slow = false;
  std::atomic<int> prepared{0}, written{0};
  std::atomic<std::int64_t> most_ahead{0};

 private:
  template <class T>
  void add(std::string& to, std::span<const T> all, int episode, std::int64_t rows,
           std::int64_t used) const {
    const std::size_t each = all.size() / static_cast<std::size_t>(episodes_);
    const std::size_t width = each / static_cast<std::size_t>(rows);
    to.append(reinterpret_cast<const char*>(all.data() + static_cast<std::size_t>(episode) * each),
              static_cast<std::size_t>(used) * width * sizeof(T));
  }
  int episodes_ = 0;  // of the piece that is written
  std::int64_t last_ = -1;
  std::atomic<int> callers_{0};
};

EpisodeOptions options_on(int threads) {
  EpisodeOptions options;
  options.episodes = kEpisodes;
  options.seed = 4;
  options.precision = Precision::mixed;
  options.threads = threads;
  options.blocks_in_flight = 2 * threads + 1;
  return options;
}

EpisodeSummary play(const Task& task, Keeper& keeper, int threads,
                    const ProgressCallback& progress = {}, const std::stop_token& stop = {}) {
  return run_episodes(task, Policy(task, PolicyKind::random), options_on(threads), keeper, progress,
                      stop);
}

TEST(TaskEpisodes, AreTheSameInTheSameOrderOnAnyNumberOfThreads) {
  const auto task = task_named("dummy");
  Keeper one;
  const EpisodeSummary alone = play(*task, one, 1);
  ASSERT_EQ(std::ssize(one.episodes), kEpisodes);
  EXPECT_NE(one.episodes[0], one.episodes[1]);
  for (const int threads : {2, 3, 8}) {
    Keeper many;
    const EpisodeSummary summary = play(*task, many, threads);
    EXPECT_TRUE(many.episodes == one.episodes) << threads;
    EXPECT_EQ(many.prepared, (kEpisodes + 15) / 16);
    EXPECT_EQ(summary.mean_return, alone.mean_return) << "summed in another order";
    EXPECT_EQ(summary.rows, alone.rows);
    EXPECT_EQ(summary.environment_steps, kEpisodes * 40);
    EXPECT_LE(summary.peak_blocks_in_flight, 2 * threads + 1);
  }
}

/// What a program was asked about an episode: its observations, in order.
struct Requested {
  std::mutex mutex;
  std::map<std::int64_t, std::vector<double>> seen;
  std::map<std::int64_t, std::set<std::vector<std::int64_t>>> among;
  bool in_order = true;
};

TEST(TaskEpisodes, OfAProgramAreAskedForInBlocks) {
  constexpr std::int64_t kAsked = kSanitized ? 24 : 40;  // a block and a half
  const auto task = task_named("stable_grasp");          // episodes of one to nine actions
  const std::size_t width = task->spec().action.size(), size = task->spec().observation_size();
  const auto played = [&](int threads, Keeper& keeper, Requested& asked) {
    const Policy policy(*task, "half", [&](const PolicyInputs& question, std::span<double> to) {
      const std::lock_guard lock(asked.mutex);
      EXPECT_EQ(question.observations.size(), question.episodes.size() * size);
      EXPECT_EQ(to.size(), question.episodes.size() * width);
      for (std::size_t e = 0; e < question.episodes.size(); ++e) {
        std::vector<double>& seen = asked.seen[question.episodes[e]];
        asked.in_order &= std::ssize(seen) == question.actions[e] * std::ssize(to) /
                                                  std::ssize(question.episodes) *
                                                  std::int64_t(size);
        const auto row = question.observations.subspan(e * size, size);
        seen.insert(seen.end(), row.begin(), row.end());
        asked.among[question.episodes[e]].emplace(question.episodes.begin(),
                                                  question.episodes.end());
        for (std::size_t k = 0; k < width; ++k) to[e * width + k] = 0.5 * std::tanh(row[k]);
      }
    });
    EXPECT_THAT(policy.players(), ::testing::ElementsAre("half"));
    EpisodeOptions options = options_on(threads);
    options.episodes = kAsked;
    return run_episodes(*task, policy, options, keeper);
  };
  Keeper one, many;
  Requested alone, together;
  const EpisodeSummary summary = played(1, one, alone);
  played(3, many, together);
  EXPECT_TRUE(one.episodes == many.episodes);
  EXPECT_TRUE(alone.seen == together.seen);
  EXPECT_TRUE(alone.among == together.among) << "an episode's neighbours depend on threads";
  EXPECT_TRUE(alone.in_order && together.in_order);
  std::int64_t rows = 0;
  for (const auto& [episode, seen] : alone.seen) rows += std::ssize(seen) / std::int64_t(size);
  EXPECT_EQ(std::ssize(alone.seen), kAsked);
  EXPECT_EQ(rows, summary.rows) << "asked about an episode that was over";
  EXPECT_LT(rows, kAsked * 9);
  EXPECT_EQ(alone.among.at(kAsked - 1).begin()->size(), 8U) << "the last block has eight episodes";
}

TEST(TaskEpisodes, EndWithWhatAProgramThrows) {
  const auto task = task_named("dummy");
  for (const int threads : {1, 4}) {
    const Policy policy(*task, "broken", [](const PolicyInputs& question, std::span<double> to) {
      if (question.actions[0] > 3) throw InputError("no answer");
      std::fill(to.begin(), to.end(), 0.0);
    });
    Keeper keeper;
    EXPECT_THROW(run_episodes(*task, policy, options_on(threads), keeper), InputError);
  }
}

TEST(TaskEpisodes, OfRangesAreThoseOfAllOfThem) {
  const auto task = task_named("dummy");
  Keeper all, some;
  play(*task, all, 2);
  EpisodeOptions options = options_on(2);
  options.ranges = {{16, 48}, {kEpisodes - 8, kEpisodes}};
  const auto summary = run_episodes(*task, Policy(*task, PolicyKind::random), options, some);
  EXPECT_EQ(summary.episodes, 40);
  std::vector<std::string> expected(all.episodes.begin() + 16, all.episodes.begin() + 48);
  expected.insert(expected.end(), all.episodes.end() - 8, all.episodes.end());
  EXPECT_TRUE(some.episodes == expected);
}

TEST(TaskEpisodes, ASlowSinkHoldsThemUpInsteadOfMemory) {
  const auto task = task_named("dummy");
  Keeper keeper;
  keeper.slow = true;
  const EpisodeSummary summary = play(*task, keeper, 2);
  EXPECT_LE(keeper.most_ahead, 5);
  EXPECT_LE(summary.peak_blocks_in_flight, 5);
  EXPECT_GE(keeper.most_ahead, 1) << "nothing was played while the sink wrote";
}

TEST(TaskEpisodes, EndWithWhatTheSinkThrows) {
  const auto task = task_named("dummy");
  for (const int threads : {1, 4}) {
    Keeper keeper;
    keeper.fail_at = 32;
    EXPECT_THROW(play(*task, keeper, threads), IoError);
    EXPECT_EQ(keeper.written, 2) << "the sink was called again after it threw";
  }
}

TEST(TaskEpisodes, EndWhenAskedTo) {
  const auto task = task_named("dummy");
  for (const int threads : {1, 4}) {
    Keeper keeper;
    std::stop_source source;
    std::int64_t done = 0;
    const auto stop_later = [&](std::int64_t actions) {
      done = actions;
      if (actions > 400) source.request_stop();
    };
    const EpisodeSummary summary = play(*task, keeper, threads, stop_later, source.get_token());
    EXPECT_TRUE(summary.stopped);
    EXPECT_LE(done, 400 + 16 * (threads + 1));
    EXPECT_EQ(std::ssize(keeper.episodes), summary.episodes);
    EXPECT_LT(summary.episodes, 48);
  }
}

TEST(TaskEpisodes, ProgressCountsEveryAction) {
  const auto task = task_named("dummy");
  std::vector<std::int64_t> seen;
  Keeper keeper;
  play(*task, keeper, 4, [&](std::int64_t steps) { seen.push_back(steps); });
  EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
  EXPECT_EQ(seen.back(), kEpisodes * 40);
}

}  // namespace
}  // namespace tangere
