// SPDX-License-Identifier: Apache-2.0
// The flow graph. A block owns its slot from the limiter to its last piece, so memory is bounded by
// the limiter and no piece waits for another block's: the sink has a place for each.
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
#include "tasks/run/thread_order.hpp"

namespace tangere {
namespace {

namespace flow = tbb::flow;

void check_at_least_one(const char* what, std::int64_t value) {
  if (value < 1) throw InputError(fmt::format("{} {}; expected at least 1", value, what));
}

/// Every action is held for K steps, so the controls may not change in between. The kinds of
/// control change at the same steps in every episode, so one is looked at.
void check_held(const ControlProgram& controls, const EpisodeOptions& options, int nu) {
  std::vector<double> action(static_cast<std::size_t>(nu)), u(static_cast<std::size_t>(nu));
  for (std::int64_t t = 0; options.every > 1 && t < options.steps; ++t) {
    std::vector<double>& now = t % options.every == 0 ? action : u;
    controls.evaluate(t, 0, now);
    for (double& x : now) x = std::clamp(x, -1.0, 1.0);
    if (t % options.every != 0 && u != action)
      throw InputError(fmt::format(
          "the controls change at step {}, but an action is held for {} steps; expected "
          "changes at multiples of {} steps, or another --every",
          t, options.every, options.every));
  }
}

void check(const ControlProgram& controls, double timestep, const EpisodeOptions& options, int nu) {
  check_at_least_one("episodes", options.episodes);
  check_at_least_one("threads", options.threads);
  check_at_least_one("blocks in flight", options.blocks_in_flight);
  static_cast<void>(action_rows(options));
  if (controls.timestep() != timestep)
    throw InputError(fmt::format("controls laid out for a timestep of {} s; the stepper's is {} s",
                                 controls.timestep(), timestep));
  controls.check_covers(options.steps);
  check_held(controls, options, nu);
}

/// As many slots as blocks may be in flight, made when first needed.
class SlotPool {
 public:
  explicit SlotPool(int most) : most_(static_cast<std::size_t>(most)) {}

  template <class Make>
  EpisodeSlot* take(const Make& make) {
    const std::lock_guard lock(mutex_);
    if (free_.empty()) {
      if (slots_.size() == most_) throw std::logic_error("more blocks in flight than the limit");
      slots_.push_back(make());
      free_.push_back(slots_.back().get());
    }
    EpisodeSlot* const slot = free_.back();
    free_.pop_back();
    peak_ = std::max(peak_, slots_.size() - free_.size());
    return slot;
  }
  void give_back(EpisodeSlot* slot) {
    const std::lock_guard lock(mutex_);
    free_.push_back(slot);
  }
  [[nodiscard]] int peak() const { return static_cast<int>(peak_); }

 private:
  std::mutex mutex_;
  std::size_t most_, peak_ = 0;
  std::vector<std::unique_ptr<EpisodeSlot>> slots_;
  std::vector<EpisodeSlot*> free_;
};

/// A block on its way; without a slot until it is first simulated.
struct Traveller {
  std::int64_t block = 0;
  EpisodeSlot* slot = nullptr;
};

class EpisodeGraph {
 public:
  EpisodeGraph(const Model& model, const StepperOptions& solver, const ControlProgram& controls,
               const EpisodeOptions& options, EpisodeSink& sink, const EpisodeProgress& progress,
               const StopRequest& stop)
      : options_(options),
        shape_(model, options),
        ranges_(checked_ranges(options.ranges, options.episodes)),
        next_episode_(ranges_.front().first),
        sink_(sink),
        progress_(progress),
        stop_(stop),
        slots_(options.blocks_in_flight),
        make_slot_([&] {
          return std::make_unique<EpisodeSlot>(model, solver, controls, options_, shape_);
        }) {}

  EpisodeSummary run() {
    using Exits = std::tuple<Traveller, flow::continue_msg>;
    flow::input_node<Traveller> blocks(graph_, [this](tbb::flow_control& flow) {
      TaskOrder::arrive();
      return next_block(flow);
    });
    flow::limiter_node<Traveller> limiter(graph_,
                                          static_cast<std::size_t>(options_.blocks_in_flight));
    flow::function_node<Traveller, Traveller> simulator(graph_, flow::unlimited,
                                                        [this](Traveller t) {
                                                          TaskOrder::arrive();
                                                          return simulate(t);
                                                        });
    flow::function_node<Traveller, Traveller> encoder(graph_, flow::unlimited, [this](Traveller t) {
      TaskOrder::arrive();
      const TaskOrder::Task task(order_, t.slot);
      const Stopwatch watch(encoding_);
      t.slot->encode();
      sink_.prepare(t.slot->piece());
      return t;
    });
    flow::multifunction_node<Traveller, Exits> writer(
        graph_, flow::serial, [this](const Traveller& t, auto& exits) {
          TaskOrder::arrive();
          if (write(t)) {
            std::get<1>(exits).try_put(flow::continue_msg());
          } else {
            std::get<0>(exits).try_put(t);
          }
        });
    flow::make_edge(blocks, limiter);
    flow::make_edge(limiter, simulator);
    flow::make_edge(simulator, encoder);
    flow::make_edge(encoder, writer);
    flow::make_edge(flow::output_port<0>(writer), simulator);
    flow::make_edge(flow::output_port<1>(writer), limiter.decrementer());
    order_.begin();
    wait_for_all(blocks);
    summary_.peak_blocks_in_flight = slots_.peak();
    summary_.stopped = stopped_;
    summary_.simulation_seconds = simulation_.seconds();
    summary_.encoding_seconds = encoding_.seconds();
    summary_.writing_seconds = writing_.seconds();
    std::sort(summary_.failures.begin(), summary_.failures.end(),
              [](const FailedEpisode& a, const FailedEpisode& b) { return a.episode < b.episode; });
    return std::move(summary_);
  }

 private:
  void wait_for_all(flow::input_node<Traveller>& blocks) {
    struct AtEnd {  // also where waiting throws
      EpisodeGraph& run;
      ~AtEnd() {
        run.order_.end();
        ordered_after_tasks_of(run.graph_);
      }
    } const at_end{*this};
    blocks.activate();
    graph_.wait_for_all();
  }

  Traveller next_block(tbb::flow_control& flow) {
    const TaskOrder::Task task(order_, &next_episode_);
    if (next_episode_ >= ranges_[range_].end && ++range_ < ranges_.size())
      next_episode_ = ranges_[range_].first;
    if (range_ == ranges_.size()) {
      flow.stop();
      return {};
    }
    const std::int64_t block = next_episode_ / kBlockEpisodes;
    next_episode_ += kBlockEpisodes;
    return {block, nullptr};
  }

  Traveller simulate(Traveller t) {
    const TaskOrder::Task start(order_, nullptr);
    const bool first = t.slot == nullptr;
    if (first) t.slot = slots_.take(make_slot_);
    const TaskOrder::Task task(order_, t.slot);
    if (first) t.slot->begin(t.block);
    const auto ends = [this] {
      if (stop_ && stop_()) stopped_ = true;
      return stopped_ || tbb::is_current_task_group_canceling();  // a throw elsewhere
    };
    const Stopwatch watch(simulation_);
    if (!t.slot->simulate(ends)) graph_.cancel();
    return t;
  }

  /// True when that was the block's last piece.
  bool write(const Traveller& t) {
    const TaskOrder::Task writer(order_, &summary_), task(order_, t.slot);
    const Stopwatch watch(writing_);
    const EpisodeRows piece = t.slot->piece();
    sink_.write(piece);
    const PieceCounts& counts = t.slot->counts();
    summary_.environment_steps += counts.environment_steps;
    summary_.newton_iterations += counts.newton_iterations;
    summary_.split_steps += counts.split_steps;
    const bool last = t.slot->last();
    if (last) {
      const std::vector<FailedEpisode>& failures = t.slot->failures();
      sink_.finish(piece.first_episode, failures);
      summary_.episodes += piece.episodes;
      summary_.rows += (piece.episodes - static_cast<std::int64_t>(failures.size())) * shape_.rows;
      summary_.failures.insert(summary_.failures.end(), failures.begin(), failures.end());
      slots_.give_back(t.slot);  // before the limiter lets the next block in
    }
    if (progress_) progress_(summary_.environment_steps);
    return last;
  }

  const EpisodeOptions& options_;
  EpisodeShape shape_;
  std::vector<EpisodeRange> ranges_;
  std::size_t range_ = 0;
  std::int64_t next_episode_;
  TaskOrder order_;
  EpisodeSink& sink_;
  const EpisodeProgress& progress_;
  const StopRequest& stop_;
  SlotPool slots_;
  std::function<std::unique_ptr<EpisodeSlot>()> make_slot_;
  flow::graph graph_;
  std::atomic<bool> stopped_{false};
  BusyTime simulation_, encoding_, writing_;
  EpisodeSummary summary_;
};

}  // namespace

EpisodeSummary run_episodes(const Model& model, const StepperOptions& solver,
                            const ControlProgram& controls, const EpisodeOptions& options,
                            EpisodeSink& sink, const EpisodeProgress& progress,
                            const StopRequest& stop) {
  const auto start = std::chrono::steady_clock::now();
  check(controls, Stepper(model, solver).timestep(), options, model.nu());
  // More threads than cores need both; the same bits at any number are tested that way.
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(options.threads));
  tbb::task_arena arena(options.threads);
  EpisodeSummary summary = arena.execute([&] {
    EpisodeGraph graph(model, solver, controls, options, sink, progress, stop);
    return graph.run();
  });
  summary.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return summary;
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

std::int64_t action_rows(const EpisodeOptions& options) {
  check_at_least_one("steps", options.steps);
  check_at_least_one("steps per action", options.every);
  if (options.steps % options.every != 0)
    throw InputError(
        fmt::format("{} steps, and an action is held for {}; expected a multiple of {} steps",
                    options.steps, options.every, options.every));
  return options.steps / options.every;
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
  const EpisodeShape shape(model, options);
  const std::int64_t blocks = (options.episodes + kBlockEpisodes - 1) / kBlockEpisodes;
  const double slots =
      static_cast<double>(std::min<std::int64_t>(blocks, options.blocks_in_flight));
  const double state = static_cast<double>(model.state_bytes_per_environment()) * kBlockEpisodes;
  return slots * (shape.piece_bytes(options) + state +
                  static_cast<double>(Stepper::workspace_bytes(model)));
}

}  // namespace tangere
