// SPDX-License-Identifier: Apache-2.0
// Rows of a wave of blocks are kept until its last episode has ended: only then is an episode's length known.
#include "tasks/task_episodes.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <map>
#include <memory>

#include "tasks/busy_time.hpp"

namespace tangere {
namespace {

constexpr int kBlockEpisodes = 16;

std::size_t size(std::int64_t n) { return static_cast<std::size_t>(n); }

/// Widths of a row of q, v and the task's observations.
std::vector<std::size_t> widths_of(const Task& task) {
  std::vector<std::size_t> widths{size(task.model().nq()), size(task.model().nv())};
  for (const TensorSpec& tensor : task.spec().observations) widths.push_back(tensor.size());
  return widths;
}

/// Rows of the episodes of one wave, T as they are stored.
template <class T>
class Rows {
 public:
  Rows(const Task& task, int episodes)
      : widths_(widths_of(task)), actions_width_(task.spec().action.size()), rows_(size(task.spec().horizon)) {
    for (const std::size_t width : widths_) values_.emplace_back(size(episodes) * (rows_ + 1) * width);
    actions_.resize(size(episodes) * rows_ * actions_width_);
    rewards_.resize(size(episodes) * rows_);
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
    std::transform(action.begin(), action.end(), actions_.begin() + static_cast<std::ptrdiff_t>(at * actions_width_),
                   [](double x) { return static_cast<float>(x); });
    rewards_[at] = static_cast<float>(vector.rewards()[size(e)]);
  }

  /// Of the block that begins with environment `first`.
  [[nodiscard]] EpisodeRows block(const VectorTask& vector, int first, int episodes, std::span<const EpisodeEnd> ends) {
    std::vector<Observation>& observations = observations_[first];
    observations.clear();
    for (std::size_t name = 0; name < widths_.size(); ++name) {
      const std::size_t numbers = (rows_ + 1) * widths_[name];
      observations.emplace_back(std::span<const T>(values_[name]).subspan(size(first) * numbers, size(episodes) * numbers));
    }
    EpisodeRows piece;
    piece.first_episode = vector.episodes()[size(first)];
    piece.episodes = episodes;
    piece.rows = static_cast<int>(rows_) + 1;
    piece.action_rows = static_cast<int>(rows_);
    piece.actions = std::span<const float>(actions_).subspan(size(first) * rows_ * actions_width_,
                                                             size(episodes) * rows_ * actions_width_);
    piece.rewards = std::span<const float>(rewards_).subspan(size(first) * rows_, size(episodes) * rows_);
    piece.observations = observations;
    piece.ends = ends;
    return piece;
  }

 private:
  void put(std::size_t name, int e, std::int64_t row, std::span<const double> from) {
    const std::size_t at = (size(e) * (rows_ + 1) + size(row)) * widths_[name];
    std::transform(from.begin(), from.end(), values_[name].begin() + static_cast<std::ptrdiff_t>(at),
                   [](double x) { return static_cast<T>(x); });
  }

  std::vector<std::size_t> widths_;
  std::size_t actions_width_, rows_;
  std::vector<std::vector<T>> values_;  // per name (episodes, rows + 1, width)
  std::vector<float> actions_, rewards_;
  std::map<int, std::vector<Observation>> observations_;  // of a block, by its first environment
};

/// A block whose episodes have ended.
struct EndedBlock {
  std::vector<EpisodeEnd> ends;
  std::vector<FailedEpisode> failures;
  std::vector<double> randomized;
  EpisodeRows piece;
};

class EpisodeRun {
 public:
  EpisodeRun(const Task& task, const Policy& policy, const TaskEpisodeOptions& options, EpisodeSink& sink,
             const EpisodeProgress& progress, const StopRequest& stop)
      : task_(task), policy_(policy), options_(options), sink_(sink), progress_(progress), stop_(stop), arena_(options.threads) {}

  template <class T>
  TaskEpisodeSummary run() {
    const std::int64_t wave = std::int64_t{kBlockEpisodes} * options_.threads;
    std::optional<Rows<T>> rows;
    for (const EpisodeRange& w : waves()) {
      if (summary_.run.stopped) break;
      const std::int64_t first = w.first;
      const int episodes = static_cast<int>(w.end - w.first);
      if (!rows) rows.emplace(task_, static_cast<int>(std::min(wave, options_.episodes)));
      VectorOptions of_wave;
      of_wave.seed = options_.seed;
      of_wave.first_episode = first;
      of_wave.threads = options_.threads;
      of_wave.precision = options_.precision;
      of_wave.autoreset = false;
      VectorTask vector(task_, episodes, of_wave);
      bool ended = false;
      {
        const Stopwatch watch(playing_);
        ended = play(vector, *rows);
      }
      if (ended) store(vector, *rows);
    }
    // Of all threads, as where blocks travel on their own; here each of the three waits for the one before.
    summary_.run.simulation_seconds = playing_.seconds() * options_.threads;
    summary_.run.encoding_seconds = preparing_.seconds() * options_.threads;
    summary_.run.writing_seconds = writing_.seconds();
    const std::int64_t played = summary_.run.episodes - static_cast<std::int64_t>(summary_.run.failures.size());
    summary_.mean_return = played > 0 ? total_ / static_cast<double>(played) : 0;
    return std::move(summary_);
  }

 private:
  /// Ranges cut into what is played side by side.
  [[nodiscard]] std::vector<EpisodeRange> waves() const {
    const std::int64_t wave = std::int64_t{kBlockEpisodes} * options_.threads;
    std::vector<EpisodeRange> waves;
    for (const EpisodeRange& range : checked_ranges(options_.ranges, options_.episodes))
      for (std::int64_t first = range.first; first < range.end; first += wave)
        waves.push_back({first, std::min(first + wave, range.end)});
    return waves;
  }

  template <class T>
  bool play(VectorTask& vector, Rows<T>& rows) {
    const int episodes = vector.environments();
    std::vector<double> actions(size(episodes) * task_.spec().action.size());
    const auto over = [&](int e) { return vector.terminated()[size(e)] != 0 || vector.truncated()[size(e)] != 0; };
    for (int e = 0; e < episodes; ++e) rows.observe(vector, e, 0);
    std::vector<bool> live(size(episodes), true);
    for (std::int64_t row = 0; row < task_.spec().horizon && std::count(live.begin(), live.end(), true) > 0; ++row) {
      if (stop_ && stop_()) {
        summary_.run.stopped = true;
        return false;
      }
      policy_.act(vector, actions);
      vector.step(actions);
      for (int e = 0; e < episodes; ++e) {
        if (!live[size(e)]) continue;
        rows.act(vector, e, row);
        rows.observe(vector, e, row + 1);
        live[size(e)] = !over(e);
      }
      if (progress_) progress_(summary_.run.environment_steps + vector.counts().environment_steps);
    }
    return true;
  }

  template <class T>
  void store(const VectorTask& vector, Rows<T>& rows) {
    const VectorCounts counts = vector.counts();
    summary_.run.environment_steps += counts.environment_steps;
    summary_.run.newton_iterations += counts.newton_iterations;
    summary_.run.split_steps += counts.split_steps;
    summary_.simulation_steps += counts.simulation_steps;
    const int blocks = (vector.environments() + kBlockEpisodes - 1) / kBlockEpisodes;
    summary_.run.peak_blocks_in_flight = std::max(summary_.run.peak_blocks_in_flight, blocks);
    std::vector<EndedBlock> ended(size(blocks));
    for (int b = 0; b < blocks; ++b) {
      const int first = b * kBlockEpisodes, episodes = std::min(kBlockEpisodes, vector.environments() - first);
      collect(vector, first, episodes, ended[size(b)]);
      ended[size(b)].piece = rows.block(vector, first, episodes, ended[size(b)].ends);
      ended[size(b)].piece.randomized = ended[size(b)].randomized;
    }
    {
      const Stopwatch watch(preparing_);
      arena_.execute([&] {
        tbb::parallel_for(0, blocks, [&](int b) { sink_.prepare(ended[size(b)].piece); });
      });
    }
    const Stopwatch watch(writing_);
    for (const EndedBlock& block : ended) {
      sink_.write(block.piece);
      sink_.finish(block.piece.first_episode, block.failures);
      summary_.run.episodes += block.piece.episodes;
      summary_.run.failures.insert(summary_.run.failures.end(), block.failures.begin(), block.failures.end());
    }
  }

  /// How the episodes of a block ended.
  void collect(const VectorTask& vector, int first, int episodes, EndedBlock& block) {
    const auto varied = static_cast<int>(task_.model().scene().randomizations.size());
    for (int e = first; e < first + episodes; ++e) {
      for (int k = 0; k < varied; ++k) block.randomized.push_back(vector.batch().randomized_value(e, k));
      block.ends.push_back({vector.lengths()[size(e)], vector.returns()[size(e)], vector.terminated()[size(e)] != 0,
                            vector.success()[size(e)] != 0});
      if (failed(vector.status(e))) {
        block.failures.push_back(failure(vector, e));
        continue;
      }
      summary_.run.rows += block.ends.back().length;
      summary_.successes += block.ends.back().success ? 1 : 0;
      total_ += block.ends.back().total;
    }
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
  double total_ = 0;
  BusyTime playing_, preparing_, writing_;
  tbb::task_arena arena_;
  TaskEpisodeSummary summary_;
};

}  // namespace

TaskEpisodeSummary run_task_episodes(const Task& task, const Policy& policy, const TaskEpisodeOptions& options,
                                     EpisodeSink& sink, const EpisodeProgress& progress, const StopRequest& stop) {
  if (options.episodes < 1 || options.threads < 1)
    throw InputError(fmt::format("{} episodes on {} threads; expected at least 1", options.episodes, options.threads));
  const auto start = std::chrono::steady_clock::now();
  EpisodeRun run(task, policy, options, sink, progress, stop);
  TaskEpisodeSummary summary = options.precision == Precision::mixed ? run.run<float>() : run.run<double>();
  summary.run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

double task_episode_bytes(const Task& task, const TaskEpisodeOptions& options) {
  const std::int64_t wave = std::min<std::int64_t>(std::int64_t{kBlockEpisodes} * options.threads, options.episodes);
  double row = 0;
  for (const std::size_t width : widths_of(task)) row += static_cast<double>(width);
  const double number = options.precision == Precision::mixed ? sizeof(float) : sizeof(double);
  return static_cast<double>(wave) * (task.spec().horizon + 1) * row * number +
         VectorTask::bytes(task, static_cast<int>(wave), options.threads);
}

}  // namespace tangere
