// SPDX-License-Identifier: Apache-2.0
// The flow graph. A block owns its slot from the limiter to its last chunk, so the limiter bounds
// the memory. Chunks of different blocks are independent, because the sink has a place for each.
#include "tasks/run/episodes.hpp"

#include <fmt/format.h>
#include <tbb/flow_graph.h>
#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <stdexcept>

#include "tasks/run/busy_time.hpp"
#include "tasks/run/episode_slot.hpp"
#include "tasks/run/thread_probe.hpp"
#include "tasks/run/tsan_order.hpp"

namespace tangere {
namespace {

namespace flow = tbb::flow;

void check(const EpisodeOptions& options) {
  check_at_least_one("episodes", options.episodes);
  check_at_least_one("threads", options.threads);
  check_at_least_one("blocks in flight", options.blocks_in_flight);
}

/// Slots for the blocks in flight, made when first needed.
template <class Slot>
class SlotPool {
 public:
  explicit SlotPool(int most) : most_(static_cast<std::size_t>(most)) {}

  template <class Make>
  Slot* take(const Make& make) {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) {
      if (slots_.size() == most_) throw std::logic_error("more blocks in flight than the limit");
      slots_.push_back(make());
      free_.push_back(slots_.back().get());
    }
    Slot* const slot = free_.back();
    free_.pop_back();
    peak_ = std::max(peak_, slots_.size() - free_.size());
    return slot;
  }
  void give_back(Slot* slot) {
    const std::lock_guard lock(mutex_);
    free_.push_back(slot);
  }
  [[nodiscard]] int peak() const { return static_cast<int>(peak_); }

 private:
  std::mutex mutex_;
  std::size_t most_, peak_ = 0;
  std::vector<std::unique_ptr<Slot>> slots_;
  std::vector<Slot*> free_;
};

/// A block on its way. It has no slot until it is first simulated.
template <class T>
struct Traveller {
  std::size_t number = 0;  // counts blocks
  EpisodeRange range;
  EpisodeSlot<T>* slot = nullptr;
};

/// T: type of the numbers in pieces.
template <class T>
class EpisodeGraph {
 public:
  EpisodeGraph(const EpisodeSource& source, const EpisodeOptions& options, EpisodeSink& sink,
               const ProgressCallback& progress, const std::stop_token& stop)
      : source_(source),
        options_(options),
        ranges_(checked_ranges(options.ranges, options.episodes)),
        next_episode_(ranges_.front().first),
        sink_(sink),
        progress_(progress),
        stop_(stop),
        slots_(options.blocks_in_flight) {}

  EpisodeSummary run() {
    using Block = Traveller<T>;
    using Exits = std::tuple<Block, flow::continue_msg>;
    flow::input_node<Block> blocks(graph_, [this](tbb::flow_control& flow) {
      TsanOrder::arrive();
      return next_block(flow);
    });
    flow::limiter_node<Block> limiter(graph_, static_cast<std::size_t>(options_.blocks_in_flight));
    flow::function_node<Block, Block> simulator(graph_, flow::unlimited, [this](Block t) {
      TsanOrder::arrive();
      return simulate(t);
    });
    flow::function_node<Block, Block> encoder(graph_, flow::unlimited, [this](Block t) {
      TsanOrder::arrive();
      const TsanOrder::Task task(order_, t.slot);
      const Stopwatch watch(encoding_);
      sink_.prepare(t.slot->piece());
      return t;
    });
    flow::sequencer_node<Block> in_order(graph_, [](const Block& t) { return t.number; });
    flow::multifunction_node<Block, Exits> writer(
        graph_, flow::serial, [this](const Block& t, auto& exits) {
          TsanOrder::arrive();
          if (write(t)) {
            std::get<1>(exits).try_put(flow::continue_msg());
          } else {
            std::get<0>(exits).try_put(t);
          }
        });
    flow::make_edge(blocks, limiter);
    flow::make_edge(limiter, simulator);
    flow::make_edge(simulator, encoder);
    if (source_.whole) {
      flow::make_edge(encoder, in_order);
      flow::make_edge(in_order, writer);
    } else {
      flow::make_edge(encoder, writer);
    }
    flow::make_edge(flow::output_port<0>(writer), simulator);
    flow::make_edge(flow::output_port<1>(writer), limiter.decrementer());
    order_.begin();
    wait_for_all(blocks);
    return concluded();
  }

 private:
  void wait_for_all(flow::input_node<Traveller<T>>& blocks) {
    struct AtEnd {  // runs also if waiting throws
      EpisodeGraph& run;
      ~AtEnd() {
        run.order_.end();
        tsan_acquire_tasks_of(run.graph_);
      }
    } const at_end{*this};
    blocks.activate();
    graph_.wait_for_all();
  }

  EpisodeSummary concluded() {
    const auto played = summary_.episodes - std::ssize(summary_.failures);
    if (played > 0) summary_.mean_return /= static_cast<double>(played);
    summary_.peak_blocks_in_flight = slots_.peak();
    summary_.stopped = stopped_;
    summary_.simulation_seconds = simulation_.seconds();
    summary_.encoding_seconds = encoding_.seconds();
    summary_.writing_seconds = writing_.seconds();
    std::sort(summary_.failures.begin(), summary_.failures.end(),
              [](const FailedEpisode& a, const FailedEpisode& b) { return a.episode < b.episode; });
    return std::move(summary_);
  }

  Traveller<T> next_block(tbb::flow_control& flow) {
    const TsanOrder::Task task(order_, &next_episode_);
    if (next_episode_ >= ranges_[range_].end && ++range_ < ranges_.size())
      next_episode_ = ranges_[range_].first;
    if (range_ == ranges_.size()) {
      flow.stop();
      return {};
    }
    const EpisodeRange block{next_episode_,
                             std::min(next_episode_ + kBlockEpisodes, ranges_[range_].end)};
    next_episode_ = block.end;
    return {blocks_++, block, nullptr};
  }

  Traveller<T> simulate(Traveller<T> t) {
    const TsanOrder::Task start(order_, nullptr);
    const bool first = t.slot == nullptr;
    if (first)
      t.slot = slots_.take([&] { return std::make_unique<EpisodeSlot<T>>(source_, options_); });
    const TsanOrder::Task task(order_, t.slot);
    const auto ends = [this] {
      if (stop_.stop_requested()) stopped_ = true;
      return stopped_ || tbb::is_current_task_group_canceling();  // a throw elsewhere
    };
    const Stopwatch watch(simulation_);
    if (first) t.slot->begin(t.range);
    if (!t.slot->simulate(ends, [this](std::int64_t steps) { tell(steps); })) graph_.cancel();
    return t;
  }

  void tell(std::int64_t steps) {
    if (!progress_) return;
    const std::lock_guard lock(progress_mutex_);
    progress_(steps_ += steps);
  }

  /// Returns true if that was the block's last piece.
  bool write(const Traveller<T>& t) {
    const TsanOrder::Task writer(order_, &summary_), task(order_, t.slot);
    const Stopwatch watch(writing_);
    const EpisodeRows piece = t.slot->piece();
    sink_.write(piece);
    if (!t.slot->last()) return false;
    sink_.finish(piece.first_episode, t.slot->failures(), t.slot->steps());
    t.slot->add_to(summary_);
    slots_.give_back(t.slot);  // before the limiter lets the next block in
    return true;
  }

  const EpisodeSource& source_;
  const EpisodeOptions& options_;
  std::vector<EpisodeRange> ranges_;
  std::size_t range_ = 0, blocks_ = 0;
  std::int64_t next_episode_;
  TsanOrder order_;
  EpisodeSink& sink_;
  const ProgressCallback& progress_;
  const std::stop_token& stop_;
  SlotPool<EpisodeSlot<T>> slots_;
  flow::graph graph_;
  std::atomic<bool> stopped_{false};
  std::mutex progress_mutex_;
  std::int64_t steps_ = 0;
  BusyTime simulation_, encoding_, writing_;
  EpisodeSummary summary_;
};

EpisodeSummary run(const EpisodeSource& source, const EpisodeOptions& options, EpisodeSink& sink,
                   const ProgressCallback& progress, const std::stop_token& stop) {
  const auto start = std::chrono::steady_clock::now();
  require_threads(options.threads);
  // More threads than cores need both. Tests use that to compare bits at any number of threads.
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(options.threads));
  tbb::task_arena arena(options.threads);
  EpisodeSummary summary = arena.execute([&] {
    return options.precision == Precision::mixed
               ? EpisodeGraph<float>(source, options, sink, progress, stop).run()
               : EpisodeGraph<double>(source, options, sink, progress, stop).run();
  });
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
}

double bytes_of(const EpisodeSource& source, const EpisodeOptions& options, double scratch) {
  const std::int64_t blocks = (options.episodes + kBlockEpisodes - 1) / kBlockEpisodes;
  const double slots =
      static_cast<double>(std::min<std::int64_t>(blocks, options.blocks_in_flight));
  const double state = static_cast<double>(source.model->state_bytes_per_environment() +
                                           Stepper::candidate_bytes(*source.model)) *
                       kBlockEpisodes;
  return slots * (piece_bytes(source, options) + state + scratch +
                  static_cast<double>(Stepper::workspace_bytes(*source.model)));
}

}  // namespace

EpisodeSummary run_episodes(const Model& model, const StepperOptions& solver,
                            const ControlProgram& controls, const EpisodeOptions& options,
                            EpisodeSink& sink, const ProgressCallback& progress,
                            const std::stop_token& stop) {
  check(options);
  return run(source_of(model, solver, controls, options), options, sink, progress, stop);
}

EpisodeSummary run_episodes(const Task& task, const Policy& policy, const EpisodeOptions& options,
                            EpisodeSink& sink, const ProgressCallback& progress,
                            const std::stop_token& stop) {
  check(options);
  return run(source_of(task, policy, options), options, sink, progress, stop);
}

std::vector<EpisodeRange> checked_ranges(const std::vector<EpisodeRange>& ranges,
                                         std::int64_t episodes) {
  if (ranges.empty()) return {{0, episodes}};
  for (const EpisodeRange& range : ranges)
    if (range.first < 0 || range.first % kBlockEpisodes != 0 || range.end <= range.first ||
        range.end > episodes || (range.end % kBlockEpisodes != 0 && range.end != episodes))
      throw InputError(fmt::format("episodes {} to {} of {}; expected whole blocks of {}",
                                   range.first, range.end, episodes, kBlockEpisodes));
  return ranges;
}

int action_interval(const Model& model, int every) {
  if (every > 0) return every;
  const SensorInfo* first = nullptr;
  for (const SensorInfo& sensor : model.sensors()) {
    if (sensor.every == 0) continue;
    if (first == nullptr) first = &sensor;
    if (sensor.every != first->every)
      throw InputError(fmt::format(
          "sensor {} is read every {} steps and sensor {} every {}; rows of a data set need one "
          "interval: give --every",
          first->name, first->every, sensor.name, sensor.every));
  }
  return first == nullptr ? 1 : first->every;
}

int available_threads() { return tbb::info::default_concurrency(); }

double episode_bytes(const Model& model, const EpisodeOptions& options) {
  return bytes_of(shape_of(model, options), options, 0);
}
double episode_bytes(const Task& task, const EpisodeOptions& options) {
  return bytes_of(shape_of(task, options), options,
                  BlockWorker::bytes(task) + kBlockEpisodes * EnvironmentData::bytes(task));
}

}  // namespace tangere
