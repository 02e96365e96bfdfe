// SPDX-License-Identifier: Apache-2.0
// Blocks of 16 episodes are played by all threads, each by one; their rows are kept until the
// block's last episode has ended, for only then is an episode's length known. They are written in
// ascending order while others are played.
#include "tasks/run/task_episodes.hpp"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>

#include "tasks/run/busy_time.hpp"
#include "tasks/run/thread_order.hpp"

namespace tangere {
namespace {

constexpr int kBlockEpisodes = 16;

std::size_t size(std::int64_t n) { return static_cast<std::size_t>(n); }

/// Those that wait for an earlier one to be written included: episodes differ in length.
int blocks_in_flight(const TaskEpisodeOptions& options) { return 2 * options.threads + 1; }

/// Widths of a row of q, v and the task's observations.
std::vector<std::size_t> widths_of(const Task& task) {
  std::vector<std::size_t> widths{size(task.model().nq()), size(task.model().nv())};
  for (const TensorSpec& tensor : task.spec().observations) widths.push_back(tensor.size());
  return widths;
}

/// Rows of the episodes of one block, T as they are stored.
template <class T>
class Rows {
 public:
  explicit Rows(const Task& task)
      : widths_(widths_of(task)),
        actions_width_(task.spec().action.size()),
        rows_(size(task.spec().horizon)) {
    for (const std::size_t width : widths_)
      values_.emplace_back(kBlockEpisodes * (rows_ + 1) * width);
    actions_.resize(kBlockEpisodes * rows_ * actions_width_);
    rewards_.resize(kBlockEpisodes * rows_);
  }

  /// What environment e shows now is its row `row`.
  void observe(const VectorTask& vector, int e, std::int64_t row) {
    const Moment now = vector.view(e).now();
    put(0, e, row, now.q);
    put(1, e, row, now.v);
    std::span<const double> rest = vector.observation(e);
    for (std::size_t name = 2; name < widths_.size(); ++name) {
      put(name, e, row, rest.first(widths_[name]));
      rest = rest.subspan(widths_[name]);
    }
  }
  /// The action that was taken from row `row` on.
  void act(const VectorTask& vector, int e, std::int64_t row) {
    const std::size_t at = size(e) * rows_ + size(row);
    const auto action = vector.actions().subspan(size(e) * actions_width_, actions_width_);
    std::transform(action.begin(), action.end(),
                   actions_.begin() + static_cast<std::ptrdiff_t>(at * actions_width_),
                   [](double x) { return static_cast<float>(x); });
    rewards_[at] = static_cast<float>(vector.rewards()[size(e)]);
  }

  [[nodiscard]] EpisodeRows piece(const VectorTask& vector) {
    const std::size_t episodes = size(vector.environments());
    observations_.clear();
    for (std::size_t name = 0; name < widths_.size(); ++name)
      observations_.emplace_back(
          std::span<const T>(values_[name]).first(episodes * (rows_ + 1) * widths_[name]));
    EpisodeRows piece;
    piece.first_episode = vector.episodes()[0];
    piece.episodes = vector.environments();
    piece.rows = static_cast<int>(rows_) + 1;
    piece.action_rows = static_cast<int>(rows_);
    piece.actions = std::span<const float>(actions_).first(episodes * rows_ * actions_width_);
    piece.rewards = std::span<const float>(rewards_).first(episodes * rows_);
    piece.observations = observations_;
    return piece;
  }

 private:
  void put(std::size_t name, int e, std::int64_t row, std::span<const double> from) {
    const std::size_t at = (size(e) * (rows_ + 1) + size(row)) * widths_[name];
    std::transform(from.begin(), from.end(),
                   values_[name].begin() + static_cast<std::ptrdiff_t>(at),
                   [](double x) { return static_cast<T>(x); });
  }

  std::vector<std::size_t> widths_;
  std::size_t actions_width_, rows_;
  std::vector<std::vector<T>> values_;  // per name (episodes, rows + 1, width)
  std::vector<float> actions_, rewards_;
  std::vector<Observation> observations_;
};

/// A block on its way. Its rows are used again for another.
template <class T>
struct Block {
  explicit Block(const Task& task) : rows(task) {}

  EpisodeRange range;
  Rows<T> rows;
  VectorCounts counts;
  std::vector<EpisodeEnd> ends;
  std::vector<FailedEpisode> failures;
  std::vector<double> randomized;
  EpisodeRows piece;
  bool ended = false;
};

template <class T>
class EpisodeRun {
 public:
  EpisodeRun(const Task& task, const Policy& policy, const TaskEpisodeOptions& options,
             EpisodeSink& sink, const EpisodeProgress& progress, const StopRequest& stop)
      : task_(task),
        policy_(policy),
        options_(options),
        sink_(sink),
        progress_(progress),
        stop_(stop),
        ranges_(checked_ranges(options.ranges, options.episodes)),
        next_(ranges_.front().first) {
    for (int k = 0; k < blocks_in_flight(options); ++k) free_.push_back(nullptr);
  }

  TaskEpisodeSummary run() {
    using tbb::filter_mode;
    const auto next = [this](tbb::flow_control& flow) {
      TaskOrder::arrive();
      const TaskOrder::Task task_of_thread(order_, &next_);
      Block<T>* const block = next_block();
      if (block == nullptr) flow.stop();
      return block;
    };
    const auto play = [this](Block<T>* block) {
      TaskOrder::arrive();
      const TaskOrder::Task task_of_thread(order_, block);
      play_block(*block);
      return block;
    };
    const auto write = [this](Block<T>* block) {
      TaskOrder::arrive();
      const TaskOrder::Task task_of_thread(order_, &next_), of_block(order_, block);
      write_block(*block);
      const std::lock_guard lock(free_mutex_);
      free_.push_back(block);
    };
    order_.begin();
    struct AtEnd {  // also where a filter throws
      const TaskOrder& order;
      ~AtEnd() { order.end(); }
    } const at_end{order_};
    tbb::parallel_pipeline(
        free_.size(),
        tbb::make_filter<void, Block<T>*>(filter_mode::serial_in_order, ByReference{&next}) &
            tbb::make_filter<Block<T>*, Block<T>*>(filter_mode::parallel, ByReference{&play}) &
            tbb::make_filter<Block<T>*, void>(filter_mode::serial_in_order, ByReference{&write}));
    summary_.run.stopped = stopped_;
    summary_.run.simulation_seconds = playing_.seconds();
    summary_.run.encoding_seconds = preparing_.seconds();
    summary_.run.writing_seconds = writing_.seconds();
    summary_.run.peak_blocks_in_flight = static_cast<int>(blocks_.size());
    const std::int64_t played =
        summary_.run.episodes - static_cast<std::int64_t>(summary_.run.failures.size());
    summary_.mean_return = played > 0 ? total_ / static_cast<double>(played) : 0;
    return std::move(summary_);
  }

 private:
  /// Null when there is none or the run is to stop.
  Block<T>* next_block() {
    if (next_ >= ranges_[range_].end && ++range_ < ranges_.size()) next_ = ranges_[range_].first;
    if (range_ == ranges_.size() || stopped_) return nullptr;
    Block<T>* block = take();
    block->range = {next_, std::min(next_ + kBlockEpisodes, ranges_[range_].end)};
    next_ = block->range.end;
    return block;
  }

  /// As many as may be on their way, made when first needed.
  Block<T>* take() {
    const std::lock_guard lock(free_mutex_);
    Block<T>* block = free_.back();
    free_.pop_back();
    if (block == nullptr) block = blocks_.emplace_back(std::make_unique<Block<T>>(task_)).get();
    return block;
  }

  void play_block(Block<T>& block) {
    VectorOptions of_block;
    of_block.seed = options_.seed;
    of_block.first_episode = block.range.first;
    of_block.precision = options_.precision;
    of_block.autoreset = false;
    {
      const Stopwatch watch(playing_);
      VectorTask vector(task_, static_cast<int>(block.range.end - block.range.first), of_block);
      block.ended = play(vector, block.rows);
      if (!block.ended) return;
      block.counts = vector.counts();
      collect(vector, block);
    }
    const Stopwatch watch(preparing_);
    sink_.prepare(block.piece);
  }

  bool play(VectorTask& vector, Rows<T>& rows) {
    const int episodes = vector.environments();
    std::vector<double> actions(size(episodes) * task_.spec().action.size());
    const auto over = [&](int e) {
      return vector.terminated()[size(e)] != 0 || vector.truncated()[size(e)] != 0;
    };
    for (int e = 0; e < episodes; ++e) rows.observe(vector, e, 0);
    std::vector<bool> live(size(episodes), true);
    for (std::int64_t row = 0;
         row < task_.spec().horizon && std::count(live.begin(), live.end(), true) > 0; ++row) {
      if (stop_ && stop_()) stopped_ = true;
      if (stopped_ || tbb::is_current_task_group_canceling()) return false;
      const std::int64_t before = vector.counts().environment_steps;
      policy_.act(vector, actions);
      vector.step(actions);
      for (int e = 0; e < episodes; ++e) {
        if (!live[size(e)]) continue;
        rows.act(vector, e, row);
        rows.observe(vector, e, row + 1);
        live[size(e)] = !over(e);
      }
      tell(vector.counts().environment_steps - before);
    }
    return true;
  }

  void tell(std::int64_t steps) {
    steps_ += steps;
    if (!progress_) return;
    const std::lock_guard lock(progress_mutex_);
    progress_(steps_);
  }

  void write_block(const Block<T>& block) {
    if (stopped_ || !block.ended) return;
    const Stopwatch watch(writing_);
    EpisodeSummary& run = summary_.run;
    run.environment_steps += block.counts.environment_steps;
    run.newton_iterations += block.counts.newton_iterations;
    run.split_steps += block.counts.split_steps;
    summary_.simulation_steps += block.counts.simulation_steps;
    sink_.write(block.piece);
    sink_.finish(block.piece.first_episode, block.failures);
    run.episodes += block.piece.episodes;
    run.failures.insert(run.failures.end(), block.failures.begin(), block.failures.end());
    auto failure = block.failures.begin();
    for (std::size_t e = 0; e < block.ends.size(); ++e) {
      if (failure != block.failures.end() &&
          failure->episode == block.range.first + static_cast<std::int64_t>(e)) {
        ++failure;
        continue;
      }
      run.rows += block.ends[e].length;
      summary_.successes += block.ends[e].success ? 1 : 0;
      total_ += block.ends[e].total;
    }
  }

  /// How its episodes ended.
  void collect(const VectorTask& vector, Block<T>& block) {
    const auto varied = static_cast<int>(task_.model().scene().randomizations.size());
    block.ends.clear();
    block.failures.clear();
    block.randomized.clear();
    for (int e = 0; e < vector.environments(); ++e) {
      for (int k = 0; k < varied; ++k)
        block.randomized.push_back(vector.batch().randomized_value(e, k));
      block.ends.push_back({vector.lengths()[size(e)], vector.returns()[size(e)],
                            vector.terminated()[size(e)] != 0, vector.success()[size(e)] != 0});
      if (failed(vector.status(e))) block.failures.push_back(failure(vector, e));
    }
    block.piece = block.rows.piece(vector);
    block.piece.ends = block.ends;
    block.piece.randomized = block.randomized;
  }

  /// `step`: the first of the action that could not be carried through.
  FailedEpisode failure(const VectorTask& vector, int e) const {
    const Moment now = vector.view(e).now();
    const std::int64_t action = std::max<std::int64_t>(0, vector.lengths()[size(e)] - 1);
    return {vector.episodes()[size(e)],
            action * task_.spec().steps_per_action,
            vector.status(e),
            {now.q.begin(), now.q.end()},
            {now.v.begin(), now.v.end()}};
  }

  const Task& task_;
  const Policy& policy_;
  const TaskEpisodeOptions& options_;
  EpisodeSink& sink_;
  const EpisodeProgress& progress_;
  const StopRequest& stop_;
  std::vector<EpisodeRange> ranges_;
  std::size_t range_ = 0;
  std::int64_t next_;  // episode
  TaskOrder order_;
  std::mutex free_mutex_, progress_mutex_;
  std::vector<std::unique_ptr<Block<T>>> blocks_;
  std::vector<Block<T>*> free_;  // null: not made yet
  std::atomic<bool> stopped_{false};
  std::atomic<std::int64_t> steps_{0};  // actions
  double total_ = 0;
  BusyTime playing_, preparing_, writing_;
  TaskEpisodeSummary summary_;
};

}  // namespace

TaskEpisodeSummary run_task_episodes(const Task& task, const Policy& policy,
                                     const TaskEpisodeOptions& options, EpisodeSink& sink,
                                     const EpisodeProgress& progress, const StopRequest& stop) {
  if (options.episodes < 1 || options.threads < 1)
    throw InputError(fmt::format("{} episodes on {} threads; expected at least 1", options.episodes,
                                 options.threads));
  const auto start = std::chrono::steady_clock::now();
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(options.threads));
  tbb::task_arena arena(options.threads);
  TaskEpisodeSummary summary = arena.execute([&] {
    return options.precision == Precision::mixed
               ? EpisodeRun<float>(task, policy, options, sink, progress, stop).run()
               : EpisodeRun<double>(task, policy, options, sink, progress, stop).run();
  });
  summary.run.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

double task_episode_bytes(const Task& task, const TaskEpisodeOptions& options) {
  const std::int64_t needed = (options.episodes + kBlockEpisodes - 1) / kBlockEpisodes;
  const auto blocks =
      static_cast<double>(std::min<std::int64_t>(blocks_in_flight(options), needed));
  const auto playing = static_cast<double>(std::min<std::int64_t>(options.threads, needed));
  double row = 0;
  for (const std::size_t width : widths_of(task)) row += static_cast<double>(width);
  const double number = options.precision == Precision::mixed ? sizeof(float) : sizeof(double);
  return blocks * kBlockEpisodes * (task.spec().horizon + 1) * row * number +
         playing * VectorTask::bytes(task, kBlockEpisodes, 1);
}

}  // namespace tangere
